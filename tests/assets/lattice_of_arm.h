#pragma once

#include <cmath>
#include <string>

#include "assets/error.h"
#include "assets/lattice_input.h"
#include "lattice/build.h"
#include "tests/lattice/shapes.h"

/// A lattice to write and read, and what reading says.
namespace sinew::assets {

using Eigen::Vector3d;

/// An ellipsoid with two bones, as a rig would give it.
inline LatticeInput arm() {
  LatticeInput input;
  input.skin.surface = tests::blob({0, 1, 0}, 24, 16, [](const Vector3d& d) {
    return 1.0 / std::sqrt(d.y() * d.y() + (d.x() * d.x() + d.z() * d.z()) / (0.25 * 0.25));
  });
  input.joints.positions.resize(3, 3);
  input.joints.positions << 0, 0.2, 0, 0.01, 1, 0.02, 0, 1.7, 0;
  input.joints.parents = {-1, 0, 1};
  input.joints.names = {"upper", "lower", "hand"};
  for (int v = 0; v < input.skin.surface.points.rows(); ++v) {
    const double y = input.skin.surface.points(v, 1);
    const int frame = y < 1.0 ? 0 : y < 1.7 ? 1 : 2;
    input.skin.surface.weights.push_back({{frame, 1.0}});
  }
  return input;
}

inline lattice::ControlLattice lattice_of(const LatticeInput& input) {
  return lattice::build(input.skin.surface, input.joints, {.cells = 200}).lattice;
}

template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}
}  // namespace sinew::assets
