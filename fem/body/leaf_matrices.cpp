#include "fem/body/leaf_matrices.h"

#include <algorithm>

namespace sinew::fem {

using lattice::Points;

int LeafMatrices::entry(int row, int col) const {
  const auto begin = column.begin() + row_start[static_cast<std::size_t>(row)];
  const auto end = column.begin() + row_start[static_cast<std::size_t>(row) + 1];
  return static_cast<int>(std::lower_bound(begin, end, col) - column.begin());
}

namespace {

/// Vertices that share a leaf cell or a face's penalty, each row ascending.
void make_pattern(const lattice::LeafMesh& mesh, const std::vector<GhostMatrix>& ghosts,
                  LeafMatrices& matrices) {
  const auto n = static_cast<std::size_t>(mesh.num_vertices());
  std::vector<std::vector<int>> neighbours(n);
  for (const auto& cell : mesh.cells) {
    for (int a : cell)
      neighbours[static_cast<std::size_t>(a)].insert(neighbours[static_cast<std::size_t>(a)].end(),
                                                     cell.begin(), cell.end());
  }
  for (const GhostMatrix& ghost : ghosts) {
    for (const int a : ghost.vertices)
      neighbours[static_cast<std::size_t>(a)].insert(neighbours[static_cast<std::size_t>(a)].end(),
                                                     ghost.vertices.begin(), ghost.vertices.end());
  }
  matrices.row_start.assign(1, 0);
  for (auto& row : neighbours) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    matrices.column.insert(matrices.column.end(), row.begin(), row.end());
    matrices.row_start.push_back(static_cast<int>(matrices.column.size()));
  }
}

template <class Apply>
Points apply_rows(const LeafMatrices& matrices, const Apply& apply) {
  Points y = Points::Zero(matrices.num_vertices(), 3);
  for (int a = 0; a < matrices.num_vertices(); ++a) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int e = matrices.row_start[static_cast<std::size_t>(a)];
         e < matrices.row_start[static_cast<std::size_t>(a) + 1]; ++e) {
      sum += apply(static_cast<std::size_t>(e), matrices.column[static_cast<std::size_t>(e)]);
    }
    y.row(a) = sum.transpose();
  }
  return y;
}

/// B (x) I_3 of a leaf mesh.
Eigen::SparseMatrix<double> expanded_basis(const lattice::LeafMesh& mesh) {
  std::vector<Eigen::Triplet<double>> triplets;
  const auto& basis = mesh.values_from_coefficients;
  for (int a = 0; a < basis.outerSize(); ++a) {
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(basis, a); it; ++it) {
      for (int c = 0; c < 3; ++c)
        triplets.emplace_back(3 * a + c, 3 * static_cast<int>(it.col()) + c, it.value());
    }
  }
  Eigen::SparseMatrix<double> expanded(3 * basis.rows(), 3 * basis.cols());
  expanded.setFromTriplets(triplets.begin(), triplets.end());
  return expanded;
}

template <class Block>
Eigen::SparseMatrix<double> in_functions(const LeafMatrices& matrices, const lattice::LeafMesh& mesh,
                                         const Block& block) {
  std::vector<Eigen::Triplet<double>> triplets;
  for (int a = 0; a < matrices.num_vertices(); ++a) {
    for (int e = matrices.row_start[static_cast<std::size_t>(a)];
         e < matrices.row_start[static_cast<std::size_t>(a) + 1]; ++e) {
      const Eigen::Matrix3d b = block(static_cast<std::size_t>(e));
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
          triplets.emplace_back(3 * a + i, 3 * matrices.column[static_cast<std::size_t>(e)] + j, b(i, j));
      }
    }
  }
  Eigen::SparseMatrix<double> nodal(3 * matrices.num_vertices(), 3 * matrices.num_vertices());
  nodal.setFromTriplets(triplets.begin(), triplets.end());
  const Eigen::SparseMatrix<double> basis = expanded_basis(mesh);
  return basis.transpose() * (nodal * basis);
}

}  // namespace

LeafMatrices assemble(const lattice::LeafMesh& mesh, std::span<const Material> materials,
                      std::span<const lattice::FillFractions> fill, const GhostPenalty& penalty) {
  std::vector<GhostMatrix> ghosts;
  for (const GhostFace& face : ghost_faces(mesh, fill, penalty)) {
    const double mu = 0.5 * (materials[static_cast<std::size_t>(face.cell[0])].mu() +
                             materials[static_cast<std::size_t>(face.cell[1])].mu());
    ghosts.push_back(ghost_matrix(mesh, face, mu, penalty));
  }
  LeafMatrices matrices;
  make_pattern(mesh, ghosts, matrices);
  matrices.ghost.assign(matrices.column.size(), 0.0);
  matrices.mass.assign(matrices.column.size(), 0.0);
  matrices.tie.assign(matrices.column.size(), 0.0);
  matrices.stiffness.assign(matrices.column.size(), Eigen::Matrix3d::Zero());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const lattice::HexCorners corners = lattice::hex_corners(mesh.points, mesh.cells[c]);
    const CellStiffness stiffness = cell_stiffness(corners, fill[c], materials[c]);
    const CellMass mass = cell_mass(corners, fill[c], materials[c].density);
    for (int a = 0; a < 8; ++a) {
      for (int b = 0; b < 8; ++b) {
        const auto e = static_cast<std::size_t>(matrices.entry(mesh.cells[c][static_cast<std::size_t>(a)],
                                                               mesh.cells[c][static_cast<std::size_t>(b)]));
        matrices.mass[e] += mass(a, b);
        matrices.stiffness[e] += stiffness.block<3, 3>(3 * a, 3 * b);
      }
    }
  }
  for (const GhostMatrix& ghost : ghosts) {
    for (std::size_t a = 0; a < ghost.vertices.size(); ++a) {
      for (std::size_t b = 0; b < ghost.vertices.size(); ++b) {
        const auto e = static_cast<std::size_t>(matrices.entry(ghost.vertices[a], ghost.vertices[b]));
        const double s = ghost.matrix(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
        matrices.ghost[e] += s;
        matrices.stiffness[e].diagonal().array() += s;
      }
    }
  }
  return matrices;
}

Points apply_mass(const LeafMatrices& matrices, const Points& x) {
  return apply_rows(matrices, [&](std::size_t e, int b) -> Eigen::Vector3d {
    return matrices.mass[e] * x.row(b).transpose();
  });
}
Points apply_stiffness(const LeafMatrices& matrices, const Points& x) {
  return apply_rows(matrices, [&](std::size_t e, int b) -> Eigen::Vector3d {
    return matrices.stiffness[e] * x.row(b).transpose();
  });
}
Points apply_tie(const LeafMatrices& matrices, const Points& x) {
  return apply_rows(matrices, [&](std::size_t e, int b) -> Eigen::Vector3d {
    return matrices.tie[e] * x.row(b).transpose();
  });
}
Points apply_ghost(const LeafMatrices& matrices, const Points& x) {
  if (x.rows() == 0) return x;
  const Points from_first = x.rowwise() - Eigen::RowVector3d(x.row(0));
  return apply_rows(matrices, [&](std::size_t e, int b) -> Eigen::Vector3d {
    return matrices.ghost[e] * from_first.row(b).transpose();
  });
}

Eigen::SparseMatrix<double> function_mass(const LeafMatrices& matrices, const lattice::LeafMesh& mesh) {
  return in_functions(matrices, mesh, [&](std::size_t e) -> Eigen::Matrix3d {
    return matrices.mass[e] * Eigen::Matrix3d::Identity();
  });
}
Eigen::SparseMatrix<double> function_stiffness(const LeafMatrices& matrices, const lattice::LeafMesh& mesh) {
  return in_functions(matrices, mesh,
                      [&](std::size_t e) -> Eigen::Matrix3d { return matrices.stiffness[e]; });
}

}  // namespace sinew::fem
