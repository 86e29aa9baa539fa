#include "lattice/embedding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

namespace sinew::lattice {
namespace {

using Box = Eigen::AlignedBox<double, 3>;

/// Leaf cells in a uniform grid of bins over their bounding boxes.
class CellBins {
 public:
  explicit CellBins(const LeafMesh& mesh) {
    Eigen::Vector3d mean_extent = Eigen::Vector3d::Zero();
    boxes_.reserve(mesh.cells.size());
    for (const HexVertices& cell : mesh.cells) {
      const HexCorners corners = hex_corners(mesh.points, cell);
      boxes_.emplace_back(corners.colwise().minCoeff().transpose(), corners.colwise().maxCoeff().transpose());
      bounds_.extend(boxes_.back());
      mean_extent += boxes_.back().sizes();
    }
    size_ = std::max(mean_extent.maxCoeff() / static_cast<double>(std::max<std::size_t>(1, boxes_.size())),
                     1e-3 * bounds_.sizes().maxCoeff());
    for (int c = 0; c < 3; ++c)
      num_[c] = std::max(1, static_cast<int>(std::ceil(bounds_.sizes()[c] / size_)));
    bins_.resize(static_cast<std::size_t>(num_.prod()));
    for (int i = 0; i < static_cast<int>(boxes_.size()); ++i) {
      const Eigen::Vector3i low = bin_of(boxes_[static_cast<std::size_t>(i)].min());
      const Eigen::Vector3i high = bin_of(boxes_[static_cast<std::size_t>(i)].max());
      for_each_bin(low, high, [&](std::vector<int>& bin) { bin.push_back(i); });
    }
  }

  /// The cell that may hold p whose box is nearest; the smallest index where several are. MayHold: (int) ->
  /// bool; where it takes none, cell 0.
  template <class MayHold>
  int nearest(const Eigen::Vector3d& p, const MayHold& may_hold) const {
    int cell = 0;
    double smallest = std::numeric_limits<double>::infinity();
    for (int c = 0; c < static_cast<int>(boxes_.size()); ++c) {
      const double distance_squared = box(c).squaredExteriorDistance(p);
      if (distance_squared < smallest && may_hold(c)) smallest = distance_squared, cell = c;
    }
    return cell;
  }

  const Box& box(int cell) const { return boxes_[static_cast<std::size_t>(cell)]; }
  double size() const { return size_; }

  /// Cells whose box comes within `reach` of p, ascending, each once.
  std::vector<int> near(const Eigen::Vector3d& p, double reach) {
    std::vector<int> cells;
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(reach);
    for_each_bin(bin_of(p - margin), bin_of(p + margin), [&](const std::vector<int>& bin) {
      for (int c : bin) {
        if (box(c).squaredExteriorDistance(p) <= reach * reach) cells.push_back(c);
      }
    });
    std::sort(cells.begin(), cells.end());
    cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
    return cells;
  }

 private:
  Eigen::Vector3i bin_of(const Eigen::Vector3d& p) const {
    Eigen::Vector3i bin;
    for (int c = 0; c < 3; ++c) {
      const double at = std::floor((p[c] - bounds_.min()[c]) / size_);
      bin[c] = static_cast<int>(std::clamp(at, 0.0, static_cast<double>(num_[c] - 1)));
    }
    return bin;
  }
  template <class Visit>
  void for_each_bin(const Eigen::Vector3i& low, const Eigen::Vector3i& high, const Visit& visit) {
    for (int z = low[2]; z <= high[2]; ++z) {
      for (int y = low[1]; y <= high[1]; ++y) {
        for (int x = low[0]; x <= high[0]; ++x) {
          visit(bins_[static_cast<std::size_t>((z * num_[1] + y) * num_[0] + x)]);
        }
      }
    }
  }

  std::vector<Box> boxes_;
  Box bounds_;
  double size_ = 1.0;
  Eigen::Vector3i num_{1, 1, 1};
  std::vector<std::vector<int>> bins_;
};

struct Place {
  int cell = -1;
  LocalCoordinates local;
};

/// The cell among `candidates` that p leaves least, in local coordinates; stops at the first that holds it.
/// MayHold: (int cell) -> bool.
template <class MayHold>
Place best_place(const LeafMesh& mesh, const std::vector<int>& candidates, const Eigen::Vector3d& p,
                 const MayHold& may_hold) {
  constexpr double kInside =
      1e-9;  // local coordinates; far below any visible distance, above Newton's rounding
  Place best;
  for (int cell : candidates) {
    if (!may_hold(cell)) continue;
    const LocalCoordinates local =
        invert_trilinear(hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(cell)]), p);
    if (!local.converged) continue;
    if (best.cell < 0 || local.outside < best.local.outside) best = {cell, local};
    if (best.local.outside <= kInside) break;
  }
  return best;
}

/// Local coordinates by the affine map at the cell's centre: for points so far away that the trilinear map
/// cannot be inverted there.
Place affine_place(const LeafMesh& mesh, int cell, const Eigen::Vector3d& p) {
  const HexCorners corners = hex_corners(mesh.points, mesh.cells[static_cast<std::size_t>(cell)]);
  const Eigen::Vector3d centre = Eigen::Vector3d::Constant(0.5);
  const Eigen::Vector3d from_centre = p - corners.colwise().mean().transpose();
  Place place;
  place.cell = cell;
  place.local.xi = centre + trilinear_jacobian(corners, centre).partialPivLu().solve(from_centre);
  place.local.outside = std::max(-place.local.xi.minCoeff(), place.local.xi.maxCoeff() - 1.0);
  return place;
}

void check_input(const LeafMesh& mesh, const Points& points) {
  if (mesh.cells.empty()) throw std::invalid_argument("embed: the lattice has no cells");
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (!points.row(i).allFinite())
      throw std::invalid_argument("embed: point " + std::to_string(i) + " is not finite");
  }
}

/// Eight weights a row from cells and local coordinates.
void set_weights(const LeafMesh& mesh, Embedding& embedding) {
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(8 * embedding.cell.size());
  for (std::size_t i = 0; i < embedding.cell.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const HexWeights weights = trilinear_weights(embedding.xi.row(row).transpose());
    const HexVertices& cell = mesh.cells[static_cast<std::size_t>(embedding.cell[i])];
    for (int k = 0; k < 8; ++k) triplets.emplace_back(row, cell[static_cast<std::size_t>(k)], weights[k]);
  }
  embedding.weights.resize(static_cast<Eigen::Index>(embedding.cell.size()), mesh.num_vertices());
  embedding.weights.setFromTriplets(triplets.begin(), triplets.end());
}

}  // namespace

Embedding embed(const LeafMesh& mesh, const Points& points, const CellFilter& may_hold) {
  check_input(mesh, points);
  Embedding embedding;
  const auto n = points.rows();
  embedding.cell.assign(static_cast<std::size_t>(n), -1);
  embedding.xi.resize(n, 3);
  CellBins bins(mesh);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d p = points.row(i).transpose();
    const auto accept = [&](int cell) { return !may_hold || may_hold(static_cast<int>(i), cell); };
    Place place = best_place(mesh, bins.near(p, 1e-9 * bins.size()), p, accept);
    if (place.cell < 0 || place.local.outside > 1e-9) {
      embedding.outside.push_back(static_cast<int>(i));
      // Widen until some cell is near enough; Newton's method does not reach farther than this.
      for (double reach = 0.25 * bins.size(); reach < 16.0 * bins.size(); reach *= 2.0) {
        const Place wider = best_place(mesh, bins.near(p, reach), p, accept);
        if (wider.cell >= 0 && (place.cell < 0 || wider.local.outside < place.local.outside)) place = wider;
        if (place.cell >= 0) break;
      }
      if (place.cell < 0) place = affine_place(mesh, bins.nearest(p, accept), p);
    }
    embedding.cell[static_cast<std::size_t>(i)] = place.cell;
    embedding.xi.row(i) = place.local.xi.transpose();
  }
  set_weights(mesh, embedding);
  return embedding;
}

Embedding carried_embedding(const LeafMesh& from, const Embedding& embedding, const LeafMesh& to,
                            const std::vector<int>& leaf_of) {
  Embedding carried;
  carried.outside = embedding.outside;
  carried.xi = embedding.xi;
  carried.cell.reserve(embedding.cell.size());
  for (std::size_t i = 0; i < embedding.cell.size(); ++i) {
    const auto cell = static_cast<std::size_t>(embedding.cell[i]);
    const int leaf = leaf_of[cell];
    carried.cell.push_back(leaf);
    int hex = from.hex[cell];
    for (int level = from.level[cell]; level > to.level[static_cast<std::size_t>(leaf)]; --level, hex /= 8) {
      const auto row = static_cast<Eigen::Index>(i);
      carried.xi.row(row) = in_parent(hex % 8, carried.xi.row(row).transpose()).transpose();
    }
  }
  set_weights(to, carried);
  return carried;
}

}  // namespace sinew::lattice
