#pragma once

#include <vector>

#include "fem/body/body.h"

/// Loads on the flesh besides gravity, given at rest: plain data, turned into forces on leaf vertices here.
namespace sinew::fem {

/// A force on the material point that rests at `at`.
struct PointLoad {
  Eigen::Vector3d at{0, 0, 0};     ///< rest [m]; inside the lattice.
  Eigen::Vector3d force{0, 0, 0};  ///< [N], of fixed direction.
};

/// A force on all of the flesh, of fixed direction.
struct BodyLoad {
  Eigen::Vector3d density{0, 0, 0};       ///< per volume of flesh at rest [N/m^3].
  Eigen::Vector3d acceleration{0, 0, 0};  ///< per mass [m/s^2].
};

/// Faces of the leaf mesh's boundary whose corners all rest within a box (its bounds included). A flat face
/// is a box without thickness; `slack` [m] widens it on all sides.
struct FaceSet {
  Eigen::Vector3d min{0, 0, 0}, max{0, 0, 0};  ///< [m].
  double slack = 1e-9;
};

/// A pressure that pushes against the posed surface and turns with it. In statics flesh is found at rest
/// until some of it has turned by about 90 degrees.
struct PressureLoad {
  FaceSet faces;
  double pressure = 0.0;  ///< [Pa]; positive pushes inwards.
};

/// A force per area of the surface at rest, of fixed direction.
struct TractionLoad {
  FaceSet faces;
  Eigen::Vector3d traction{0, 0, 0};  ///< [Pa].
};

struct Loads {
  std::vector<PointLoad> points;
  std::vector<BodyLoad> bodies;
  std::vector<PressureLoad> pressures;
  std::vector<TractionLoad> tractions;

  bool empty() const { return points.empty() && bodies.empty() && pressures.empty() && tractions.empty(); }
};

/// Four leaf vertices of a boundary face, counter-clockwise seen from outside at rest.
using BoundaryFace = std::array<int, 4>;
/// Boundary faces of the leaf mesh within a set, in the order of cells.
std::vector<BoundaryFace> boundary_faces(const lattice::LeafMesh& mesh, const FaceSet& set);

/// Forces of loads on a body.
class LoadForces {
 public:
  /// Throws std::invalid_argument where a point lies outside the lattice, a set holds no boundary face, or a
  /// number is not finite.
  LoadForces(const Body& body, const Loads& loads);

  /// Forces on the leaf vertices at positions x [N], num_vertices x 3.
  lattice::Points at(const lattice::Points& x) const;
  /// The forces depend on x.
  bool follow() const { return !pressures_.empty(); }

 private:
  struct Pressed {
    std::vector<BoundaryFace> faces;
    double pressure;
  };
  lattice::Points fixed_;  ///< those that do not depend on x.
  std::vector<Pressed> pressures_;
};

}  // namespace sinew::fem
