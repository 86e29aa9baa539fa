#pragma once

#include <string>
#include <vector>

#include "lattice/basis.h"
#include "lattice/box.h"
#include "tests/lattice/shapes.h"

/// Small distorted lattices of every kind of cell, and points inside them.
namespace sinew::tests {

struct NamedLattice {
  std::string name;
  lattice::CellComplex complex;
};

/// Moves every vertex by up to `share` of a unit edge on each axis: faces of hexahedra and wedges are no
/// longer plane.
inline lattice::CellComplex distorted(lattice::CellComplex complex, double share, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v)
    complex.points.row(v) += uniform_point(rng, -share, share).transpose();
  return complex;
}

/// Hexahedra, wedges beside them, tetrahedra on top of the wedges, and nothing on top of the hexahedra:
/// without pyramids the three kinds cannot fill a box.
inline lattice::BoxOptions mixed_box() {
  using lattice::CellType;
  return {{0, 0, 0},
          {2, 1, 2},
          {2, 1, 2},
          CellType::Hexahedron,
          {CellType::Hexahedron, CellType::Wedge, std::nullopt, CellType::Tetrahedron}};
}

inline std::vector<NamedLattice> lattices_of_every_kind(double share) {
  using lattice::CellType;
  std::vector<NamedLattice> all;
  const auto box = [&](const char* name, CellType type, const Eigen::Vector3i& blocks) {
    const lattice::BoxOptions options{{0, 0, 0}, blocks.cast<double>(), blocks, type, {}};
    all.push_back({name, distorted(lattice::box_lattice(options), share, 2002 + all.size())});
  };
  box("tetrahedra", CellType::Tetrahedron, {2, 1, 1});
  box("wedges", CellType::Wedge, {2, 2, 1});
  box("hexahedra", CellType::Hexahedron, {2, 2, 2});
  all.push_back({"mixed", distorted(lattice::box_lattice(mixed_box()), share, 7)});
  return all;
}

inline lattice::LeafMesh uniform_mesh(const lattice::Hierarchy& hierarchy, int level) {
  return lattice::leaf_mesh(hierarchy, lattice::uniform_active_set(hierarchy, level, {}));
}

/// Points inside the leaf cells: random local coordinates of random cells, a third of them on a face, edge or
/// corner.
inline lattice::Points points_inside(const lattice::LeafMesh& mesh, int count, std::mt19937_64& rng) {
  lattice::Points points(count, 3);
  for (int i = 0; i < count; ++i) {
    const auto cell = static_cast<std::size_t>(rng() % mesh.cells.size());
    Eigen::Vector3d xi = uniform_point(rng, 0.0, 1.0);
    if (i % 3 == 0) xi[static_cast<Eigen::Index>(rng() % 3)] = static_cast<double>(rng() % 2);
    if (i % 6 == 0) xi[static_cast<Eigen::Index>(rng() % 3)] = static_cast<double>(rng() % 2);
    points.row(i) =
        lattice::trilinear_weights(xi).transpose() * lattice::hex_corners(mesh.points, mesh.cells[cell]);
  }
  return points;
}

/// Random numbers in [-1, 1), rows x 3.
inline lattice::Points random_points(Eigen::Index rows, std::mt19937_64& rng) {
  lattice::Points points(rows, 3);
  for (Eigen::Index i = 0; i < rows; ++i) points.row(i) = uniform_point(rng, -1.0, 1.0).transpose();
  return points;
}

/// A random affine map of points.
struct Affine {
  Eigen::Matrix3d linear;
  Eigen::Vector3d shift;
  explicit Affine(std::mt19937_64& rng)
      : linear(random_points(3, rng)), shift(uniform_point(rng, -1.0, 1.0)) {}
  lattice::Points operator()(const lattice::Points& x) const {
    return (x * linear.transpose()).rowwise() + shift.transpose();
  }
};

}  // namespace sinew::tests
