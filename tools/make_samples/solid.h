#pragma once

#include <functional>

#include <Eigen/Core>

/// Implicit shapes: a solid is a function that is negative inside and about the signed distance [m] near its
/// surface. Shapes are built from a few primitives and smooth unions.
namespace sinew::samples {

using Solid = std::function<double(const Eigen::Vector3d&)>;

/// Thick segment from a to b whose radius goes linearly from radius_a to radius_b [m].
Solid tapered_capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_a, double radius_b);

/// Ellipsoid with the given half axes [m], turned by `pitch_degrees` about x (nose of +z downwards positive).
Solid ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, double pitch_degrees = 0.0,
                double roll_degrees = 0.0);

/// Union with a fillet of about `blend` [m] (polynomial smooth minimum of second order).
Solid blended(Solid a, Solid b, double blend);

/// The first solid with the second cut away, edges rounded by about `blend` [m].
Solid carved(Solid a, Solid b, double blend);

/// Union of a solid and its mirror image in the plane x = 0; its value is the same, bit for bit, on both
/// sides.
Solid mirrored(Solid solid);

/// Outward unit normal of the solid's level set at p, by central differences.
Eigen::Vector3d outward_normal(const Solid& solid, const Eigen::Vector3d& p);

/// p moved to the surface by Newton steps along the gradient.
Eigen::Vector3d projected(const Solid& solid, Eigen::Vector3d p);

}  // namespace sinew::samples
