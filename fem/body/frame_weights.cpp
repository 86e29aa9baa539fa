#include "fem/body/frame_weights.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include <Eigen/SparseCholesky>

namespace sinew::fem {
namespace {

/// Edges of the coarse cells, each once, over vertices that the mesh uses.
std::set<std::pair<int, int>> coarse_edges(const lattice::Hierarchy& hierarchy,
                                           const lattice::LeafMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (const auto& cell : hierarchy.coarse().cells) {
    const auto neighbours = lattice::corner_neighbours(cell.type);
    for (std::size_t k = 0; k < neighbours.size(); ++k) {
      const int a = mesh.leaf_of_vertex[static_cast<std::size_t>(cell.vertices[k])];
      for (int n : neighbours[k]) {
        const int b =
            mesh.leaf_of_vertex[static_cast<std::size_t>(cell.vertices[static_cast<std::size_t>(n)])];
        if (a >= 0 && b >= 0) edges.insert(std::minmax(a, b));
      }
    }
  }
  return edges;
}

int nearest_frame(const FrameTree& tree, const Eigen::Vector3d& p) {
  int nearest = 0;
  for (int f = 1; f < tree.num_frames(); ++f) {
    const auto distance = [&](int g) {
      return (tree.frames[static_cast<std::size_t>(g)].origin_rest - p).squaredNorm();
    };
    if (distance(f) < distance(nearest)) nearest = f;
  }
  return nearest;
}

/// Solves (L + D) s = rhs with L the graph Laplacian of `edges`; fixed rows keep their values.
Eigen::MatrixXd solve_laplacian(const std::set<std::pair<int, int>>& edges, const Eigen::VectorXd& d,
                                Eigen::MatrixXd rhs, const std::vector<std::uint8_t>& is_fixed,
                                const Eigen::MatrixXd& fixed) {
  const int num_rows = static_cast<int>(d.size());
  std::vector<Eigen::Triplet<double>> triplets;
  Eigen::VectorXd diagonal = d;
  const auto couple = [&](int a, int b) {
    if (is_fixed[static_cast<std::size_t>(a)]) return;
    diagonal[a] += 1.0;
    if (is_fixed[static_cast<std::size_t>(b)]) {
      rhs.row(a) += fixed.row(b);
    } else {
      triplets.emplace_back(a, b, -1.0);
    }
  };
  for (const auto& [a, b] : edges) {
    couple(a, b);
    couple(b, a);
  }
  for (int a = 0; a < num_rows; ++a) {
    const bool known = is_fixed[static_cast<std::size_t>(a)] != 0;
    triplets.emplace_back(a, a, known ? 1.0 : diagonal[a]);
    if (known) rhs.row(a) = fixed.row(a);
  }
  Eigen::SparseMatrix<double> matrix(num_rows, num_rows);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
  if (factor.info() != Eigen::Success) throw std::runtime_error("frame_weights: the M-matrix did not factor");
  return factor.solve(rhs);
}

/// Level-0 hats at the skin's vertices, num_points x num_coarse; level-0 functions are the first ones.
Eigen::SparseMatrix<double, Eigen::RowMajor> coarse_hats(const lattice::LeafMesh& mesh,
                                                         const lattice::Embedding& skin, int num_coarse) {
  return Eigen::SparseMatrix<double, Eigen::RowMajor>(skin.weights * mesh.values_from_coefficients)
      .leftCols(num_coarse);
}

/// Coarse weights, num_coarse x num_frames, dense: a few hundred rows.
Eigen::MatrixXd solve_coarse(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                             const lattice::Embedding& skin, const lattice::Surface& surface,
                             const FrameTree& tree, const BoneConstraints& bones, int num_coarse) {
  const int num_frames = tree.num_frames();
  // D and D sbar
  const auto hats = coarse_hats(mesh, skin, num_coarse);
  Eigen::VectorXd d = Eigen::VectorXd::Zero(num_coarse);
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(num_coarse, num_frames);
  for (int k = 0; k < hats.outerSize(); ++k) {
    const auto& influences = surface.weights[static_cast<std::size_t>(k)];
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(hats, k); it; ++it) {
      const double phi =
          std::max(0.0, it.value());  // a vertex outside the lattice is extrapolated: keep the M-matrix
      for (const auto& influence : influences) {
        const int f = tree.frame_of_joint[static_cast<std::size_t>(influence.frame)];
        if (f < 0) continue;
        d[it.col()] += phi * influence.weight;
        rhs(it.col(), f) += phi * influence.weight;
      }
    }
  }
  // A component that neither a bone nor a skin vertex touches would be singular: a whisper of the nearest
  // frame.
  constexpr double kWhisper = 1e-9;
  for (int a = 0; a < num_coarse; ++a) {
    d[a] += kWhisper;
    rhs(a, nearest_frame(tree, mesh.points.row(a).transpose())) += kWhisper;
  }
  Eigen::MatrixXd fixed = Eigen::MatrixXd::Zero(num_coarse, num_frames);
  std::vector<std::uint8_t> is_fixed(static_cast<std::size_t>(num_coarse), 0);
  for (const BoneVertex& bone : bones.vertices) {
    if (bone.vertex >= num_coarse) continue;
    is_fixed[static_cast<std::size_t>(bone.vertex)] = 1;
    fixed(bone.vertex, bone.frame) += bone.second_frame >= 0 ? 0.5 : 1.0;
    if (bone.second_frame >= 0) fixed(bone.vertex, bone.second_frame) += 0.5;
  }
  return solve_laplacian(coarse_edges(hierarchy, mesh), d, rhs, is_fixed, fixed);
}

int num_coarse_vertices(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh) {
  return static_cast<int>(
      std::lower_bound(mesh.vertices.begin(), mesh.vertices.end(), hierarchy.num_vertices(0)) -
      mesh.vertices.begin());
}

/// Weights of all leaf vertices from those of level 0: small ones dropped, rows normalised, and means of
/// parents all the way down, the level-0 columns of the value rows with every detail at zero.
FrameWeights prolonged(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                       const Eigen::MatrixXd& coarse) {
  constexpr double kSmallest = 1e-3;
  const auto num_coarse = static_cast<int>(coarse.rows());
  FrameWeights coarse_sparse(num_coarse, coarse.cols());
  std::vector<Eigen::Triplet<double>> triplets;
  for (int a = 0; a < num_coarse; ++a) {
    const Eigen::RowVectorXd row = coarse.row(a).cwiseMax(0.0);
    const Eigen::RowVectorXd kept = (row.array() < kSmallest * row.sum()).select(0.0, row);
    for (int f = 0; f < coarse.cols(); ++f) {
      if (kept[f] > 0.0) triplets.emplace_back(a, f, kept[f] / kept.sum());
    }
  }
  coarse_sparse.setFromTriplets(triplets.begin(), triplets.end());
  std::vector<std::vector<std::pair<int, double>>> rows(static_cast<std::size_t>(mesh.num_vertices()));
  for (int a = 0; a < num_coarse; ++a) rows[static_cast<std::size_t>(a)] = {{a, 1.0}};
  std::vector<Eigen::Triplet<double>> prolongation;
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    auto& row = rows[static_cast<std::size_t>(a)];
    const auto parents = hierarchy.parents(mesh.vertices[static_cast<std::size_t>(a)]);
    for (int p : parents) {
      for (const auto& [c, w] :
           rows[static_cast<std::size_t>(mesh.leaf_of_vertex[static_cast<std::size_t>(p)])]) {
        row.emplace_back(c, w / static_cast<double>(parents.size()));
      }
    }
    std::sort(row.begin(), row.end());
    std::size_t kept = 0;
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (kept > 0 && row[kept - 1].first == row[k].first)
        row[kept - 1].second += row[k].second;
      else
        row[kept++] = row[k];
    }
    row.resize(kept);
    for (const auto& [c, w] : row) prolongation.emplace_back(a, c, w);
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> from_coarse(mesh.num_vertices(), num_coarse);
  from_coarse.setFromTriplets(prolongation.begin(), prolongation.end());
  return from_coarse * coarse_sparse;
}

}  // namespace

FrameWeights frame_weights(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                           const lattice::Embedding& skin, const lattice::Surface& surface,
                           const FrameTree& tree, const BoneConstraints& bones) {
  return prolonged(
      hierarchy, mesh,
      solve_coarse(hierarchy, mesh, skin, surface, tree, bones, num_coarse_vertices(hierarchy, mesh)));
}

FrameWeights bone_extension(const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                            const lattice::Embedding& skin, const BoneConstraints& bones) {
  const int num_coarse = num_coarse_vertices(hierarchy, mesh);
  const auto num_bones = static_cast<Eigen::Index>(bones.vertices.size());
  // Where neither a bone nor the skin reaches, the weights are zero: a whisper keeps the matrix regular.
  Eigen::VectorXd d = Eigen::VectorXd::Constant(num_coarse, 1e-9);
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(num_coarse, num_bones + 1);
  const auto hats = coarse_hats(mesh, skin, num_coarse);
  for (int k = 0; k < hats.outerSize(); ++k) {
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(hats, k); it; ++it) {
      const double phi = std::max(0.0, it.value());  // as in solve_coarse
      d[it.col()] += phi;
      rhs(it.col(), num_bones) += phi;
    }
  }
  Eigen::MatrixXd fixed = Eigen::MatrixXd::Zero(num_coarse, num_bones + 1);
  std::vector<std::uint8_t> is_fixed(static_cast<std::size_t>(num_coarse), 0);
  for (Eigen::Index k = 0; k < num_bones; ++k) {
    const int vertex = bones.vertices[static_cast<std::size_t>(k)].vertex;
    if (vertex >= num_coarse) continue;
    is_fixed[static_cast<std::size_t>(vertex)] = 1;
    fixed(vertex, k) = 1.0;
  }
  return prolonged(hierarchy, mesh, solve_laplacian(coarse_edges(hierarchy, mesh), d, rhs, is_fixed, fixed))
      .leftCols(num_bones);
}

std::vector<int> dominant_frames(const FrameWeights& weights) {
  std::vector<int> dominant(static_cast<std::size_t>(weights.rows()), 0);
  for (int a = 0; a < weights.outerSize(); ++a) {
    double largest = -1.0;
    for (FrameWeights::InnerIterator it(weights, a); it; ++it) {
      if (it.value() > largest) {
        largest = it.value();
        dominant[static_cast<std::size_t>(a)] = static_cast<int>(it.col());
      }
    }
  }
  return dominant;
}

}  // namespace sinew::fem
