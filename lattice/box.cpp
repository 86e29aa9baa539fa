#include "lattice/box.h"

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

namespace sinew::lattice {
namespace {

using Eigen::Vector3i;

/// Corners of a block as bits: x is 1, y is 2, z is 4.
using Bits = std::vector<int>;

const std::vector<Bits>& cells_of_block(CellType type) {
  static const std::vector<Bits> hexahedron{{0, 1, 3, 2, 4, 5, 7, 6}};
  // Both wedges contain the edge x = y of the bottom and of the top.
  static const std::vector<Bits> wedges{{0, 1, 3, 4, 5, 7}, {0, 3, 2, 4, 7, 6}};
  // One tetrahedron per order of the axes: from corner 0 along each axis in turn to corner 7. The odd orders
  // have two corners exchanged, to be of positive volume.
  static const std::vector<Bits> tetrahedra{{0, 1, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7},
                                            {0, 3, 2, 7}, {0, 5, 1, 7}, {0, 6, 4, 7}};
  return type == CellType::Tetrahedron ? tetrahedra : type == CellType::Wedge ? wedges : hexahedron;
}

/// Whether a block of this type shows two triangles on its faces normal to `axis` (else one quadrilateral).
/// All such faces are cut along the diagonal from their lower to their upper corner, so they match.
bool shows_triangles(CellType type, int axis) {
  return type == CellType::Tetrahedron || (type == CellType::Wedge && axis == 2);
}

int index_of(const Vector3i& at, const Vector3i& size) { return at[0] + size[0] * (at[1] + size[1] * at[2]); }

std::string name_of(const Vector3i& block) {
  return "block (" + std::to_string(block[0]) + ", " + std::to_string(block[1]) + ", " +
         std::to_string(block[2]) + ")";
}

template <class Visit>
void for_each_block(const Vector3i& blocks, const Visit& visit) {
  for (int k = 0; k < blocks[2]; ++k) {
    for (int j = 0; j < blocks[1]; ++j) {
      for (int i = 0; i < blocks[0]; ++i) visit(Vector3i(i, j, k));
    }
  }
}

void check_faces(const BoxOptions& options, const std::vector<std::optional<CellType>>& types) {
  for_each_block(options.blocks, [&](const Vector3i& block) {
    const auto own = types[static_cast<std::size_t>(index_of(block, options.blocks))];
    for (int axis = 0; axis < 3 && own; ++axis) {
      const Vector3i beside = block + Vector3i::Unit(axis);
      if (beside[axis] == options.blocks[axis]) continue;
      const auto other = types[static_cast<std::size_t>(index_of(beside, options.blocks))];
      if (other && shows_triangles(*own, axis) != shows_triangles(*other, axis)) {
        throw std::invalid_argument("box_lattice: " + name_of(block) + " and " + name_of(beside) +
                                    " meet in two triangles against a quadrilateral, which takes a pyramid");
      }
    }
  });
}

}  // namespace

void BoxOptions::validate() const {
  for (int c = 0; c < 3; ++c) {
    if (!std::isfinite(min[c]) || !std::isfinite(max[c]) || !(max[c] > min[c])) {
      throw std::invalid_argument("max: got " + std::to_string(max[c]) + ", expected more than min " +
                                  std::to_string(min[c]));
    }
    if (blocks[c] < 1) {
      throw std::invalid_argument("blocks: got " + std::to_string(blocks[c]) + ", expected >= 1");
    }
  }
  if (!types.empty() && types.size() != static_cast<std::size_t>(blocks.prod())) {
    throw std::invalid_argument("types: got " + std::to_string(types.size()) + " of them, expected " +
                                std::to_string(blocks.prod()) + " or none");
  }
}

CellComplex box_lattice(const BoxOptions& options) {
  options.validate();
  std::vector<std::optional<CellType>> types = options.types;
  if (types.empty()) types.assign(static_cast<std::size_t>(options.blocks.prod()), options.type);
  check_faces(options, types);

  CellComplex complex;
  const Vector3i size = options.blocks + Vector3i::Ones();
  std::vector<int> vertex(static_cast<std::size_t>(size.prod()),
                          -1);  // grid point -> vertex, first 0 for used
  for_each_block(options.blocks, [&](const Vector3i& block) {
    const auto type = types[static_cast<std::size_t>(index_of(block, options.blocks))];
    if (!type) return;
    for (const Bits& corners : cells_of_block(*type)) {
      Cell cell;
      cell.type = *type;
      for (std::size_t k = 0; k < corners.size(); ++k) {
        const Vector3i at = block + Vector3i(corners[k] & 1, corners[k] >> 1 & 1, corners[k] >> 2);
        cell.vertices[k] = index_of(at, size);
        vertex[static_cast<std::size_t>(cell.vertices[k])] = 0;
      }
      complex.cells.push_back(cell);
    }
  });

  std::vector<Eigen::Vector3d> points;
  for_each_block(size, [&](const Vector3i& at) {
    int& v = vertex[static_cast<std::size_t>(index_of(at, size))];
    if (v < 0) return;
    v = static_cast<int>(points.size());
    const Eigen::Array3d s = at.cast<double>().array() / options.blocks.cast<double>().array();
    // Both ends exact.
    points.emplace_back((1.0 - s) * options.min.array() + s * options.max.array());
  });
  complex.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    complex.points.row(static_cast<Eigen::Index>(v)) = points[v];
  for (Cell& cell : complex.cells) {
    for (int k = 0; k < num_corners(cell.type); ++k) {
      int& v = cell.vertices[static_cast<std::size_t>(k)];
      v = vertex[static_cast<std::size_t>(v)];
    }
  }
  return complex;
}

}  // namespace sinew::lattice
