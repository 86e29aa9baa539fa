#include "tools/session/plain_loads.h"

#include <numbers>

#include <Eigen/Geometry>

namespace sinew::tools {
namespace {

/// The boundary faces on a side of the box. Their vertices are means of the box's corners: off by rounding.
fem::FaceSet faces_on(const PlainBox& box, const BoxFace& face) {
  fem::FaceSet set{box.corner, box.corner + box.size, 1e-9 * box.size.norm()};
  (face.high ? set.min : set.max)[face.axis] = (face.high ? set.max : set.min)[face.axis];
  return set;
}

}  // namespace

fem::Loads loads_of(const PlainScene& plain) {
  fem::Loads loads;
  for (const PlainPointLoad& load : plain.point_loads) loads.points.push_back({load.at, load.force});
  for (const PlainBodyLoad& load : plain.body_loads)
    loads.bodies.push_back({load.density, load.acceleration});
  for (const PlainFaceLoad& load : plain.face_loads) {
    const fem::FaceSet faces = faces_on(plain.box, load.face);
    if (load.pressure != 0.0) loads.pressures.push_back({faces, load.pressure});
    if (!load.traction.isZero(0.0)) loads.tractions.push_back({faces, load.traction});
  }
  return loads;
}

lattice::Points starting_velocity(const PlainScene& plain, const lattice::Points& x) {
  if (!plain.velocity) return lattice::Points::Zero(x.rows(), 3);
  const PlainVelocity& velocity = *plain.velocity;
  const Eigen::Vector3d about = velocity.about.value_or(plain.box.corner + 0.5 * plain.box.size);
  const Eigen::Vector3d spin = velocity.spin * (std::numbers::pi / 180.0);
  lattice::Points v(x.rows(), 3);
  for (Eigen::Index a = 0; a < x.rows(); ++a)
    v.row(a) = (velocity.linear + spin.cross(x.row(a).transpose() - about)).transpose();
  return v;
}

}  // namespace sinew::tools
