#include "lattice/fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

constexpr int kAcross = 4;  ///< samples along each axis of a cell.
/// Near the edges of a body it is not a plane that cuts, so parts are halved once: a bar in cells as wide as
/// itself, turned and offset, weighs 0.5 % too much (tests/fem/immersed_bar_test.cpp), in cells half as wide
/// 0.15 %.
constexpr int kHalvings = 1;
/// The other side of the skin is looked at this far behind it, in reaches of a sample.
constexpr double kOtherSide = 0.02;
/// Behind the skin of a body the winding number is about 1, behind a sheet about 1/2.
constexpr double kBody = 0.75;

/// The samples of one cell: each stands for the part of the cell round it, which the skin may cut.
class CellSamples {
 public:
  CellSamples(const HexCorners& corners, const SurfaceQuery& skin, double shell)
      : corners_(corners), skin_(skin), shell_(shell) {}

  /// Share of material of the part round xi; `closest` is that of its middle.
  double share(const Vector3d& xi, SurfaceQuery::Closest& closest) {
    return share(xi, 1.0 / kAcross, kHalvings, closest);
  }

 private:
  static constexpr double kOnSkin = 1e-9;  ///< rounding of distances, in sides of the part.
  struct Known {
    Vector3d p;
    double distance;
    bool is_inside;
  };

  /// The same for a part of this side, in shares of the cell's. Parts that the skin cuts are halved first.
  double share(const Vector3d& xi, double side, int halvings, SurfaceQuery::Closest& closest) {
    const Vector3d p = corners_.transpose() * trilinear_weights(xi);
    closest = skin_.closest(p);
    const bool is_inside = inside(p, closest.distance);
    const Eigen::Matrix3d edges = side * trilinear_jacobian(corners_, xi);
    const Vector3d outward = p - closest.point;  // or inward
    const double reach = 0.5 * (edges.transpose() * outward.stableNormalized()).cwiseAbs().sum();
    if (closest.distance >= std::max(reach, shell_)) return is_inside ? 1.0 : 0.0;
    if (!(closest.distance > kOnSkin * edges.norm())) return 0.5;
    const double step = kOtherSide * std::max(reach, shell_) / closest.distance;
    const double here = skin_.winding_number(p);
    const double beyond = skin_.winding_number(closest.point - step * outward);
    if (std::min(here, beyond) > 0.5) return 1.0;  // skin within flesh
    if (std::max(here, beyond) < kBody) return is_inside || closest.distance <= shell_ ? 1.0 : 0.0;
    if (closest.distance >= reach) return is_inside ? 1.0 : 0.0;
    if (halvings > 0) return share_of_halves(xi, side, halvings);
    // Skin of a body cuts the part as a plane would: linear between the planes that just touch it, and right
    // in the mean over all places of the plane.
    const double depth = is_inside ? closest.distance : -closest.distance;
    return 0.5 + 0.5 * depth / reach;
  }

  double share_of_halves(const Vector3d& xi, double side, int halvings) {
    double sum = 0.0;
    SurfaceQuery::Closest unused;
    for (const std::array<int, 3>& corner : kCorners) {
      const Vector3d middle =
          xi + 0.5 * side * (Vector3d(corner[0], corner[1], corner[2]) - Vector3d::Constant(0.5));
      sum += 0.125 * share(middle, 0.5 * side, halvings - 1, unused);
    }
    return sum;
  }

  /// As any sample that has no skin between itself and p; else by winding number.
  bool inside(const Vector3d& p, double distance) {
    const auto reaches = [&](const Known& known) { return (known.p - p).norm() < known.distance; };
    const auto found = std::find_if(known_.rbegin(), known_.rend(), reaches);
    const bool is_inside = found != known_.rend() ? found->is_inside : skin_.winding_number(p) > 0.5;
    known_.push_back({p, distance, is_inside});
    return is_inside;
  }

  const HexCorners& corners_;
  const SurfaceQuery& skin_;
  double shell_;
  std::vector<Known> known_;
};

/// `limbs`: nullptr where no other cell lies in this place.
FillFractions sample_cell(const HexCorners& corners, const SurfaceQuery& skin, double shell, int cell,
                          const LeafLimbs* limbs) {
  CellSamples samples(corners, skin, shell);
  FillFractions fill{};
  for (int k = 0; k < 8; ++k) {
    double filled = 0.0;
    for (int s = 0; s < 8; ++s) {
      Vector3d xi;
      for (int c = 0; c < 3; ++c) xi[c] = 0.5 * kCorners[k][c] + 0.125 + 0.25 * kCorners[s][c];
      SurfaceQuery::Closest closest;
      const double share = samples.share(xi, closest);
      if (share > 0.0 && (!limbs || limbs->owns_flesh(cell, closest))) filled += share;
    }
    fill[static_cast<std::size_t>(k)] = filled / 8.0;
  }
  return fill;
}

}  // namespace

std::vector<FillFractions> fill_fractions(const LeafMesh& mesh, const SurfaceQuery& skin, double shell,
                                          const LeafLimbs* limbs) {
  // A sample reaches a quarter of its cell's radius from its middle, a little more in cells that are no
  // boxes.
  constexpr double kReach = 0.4;
  std::vector<FillFractions> fill(mesh.cells.size());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const HexCorners corners = hex_corners(mesh.points, mesh.cells[c]);
    const Vector3d centre = corners.colwise().mean().transpose();
    const double radius = (corners.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
    const bool is_shared = limbs && limbs->is_copy(static_cast<int>(c));
    // The winding number changes only across the surface: a cell that the surface does not reach is all one
    // thing.
    if (!is_shared && skin.closest(centre).distance > radius + std::max(shell, kReach * radius)) {
      fill[c].fill(skin.winding_number(centre) > 0.5 ? 1.0 : 0.0);
    } else {
      fill[c] = sample_cell(corners, skin, shell, static_cast<int>(c), is_shared ? limbs : nullptr);
    }
  }
  return fill;
}

TriangleSamples sample_triangles(const Points& points, const Triangles& triangles, double spacing) {
  std::vector<double> samples;
  std::vector<int> vertices;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::RowVector3d a = points.row(triangles(t, 0));
    const Eigen::RowVector3d ab = points.row(triangles(t, 1)) - a, ac = points.row(triangles(t, 2)) - a;
    const double longest = std::max({ab.norm(), ac.norm(), (ab - ac).norm()});
    const int n = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const Eigen::RowVector3d p = a + (ab * i + ac * j) / n;
        samples.insert(samples.end(), p.data(), p.data() + 3);
        int nearest = 0;
        const auto distance_squared = [&](int k) { return (points.row(triangles(t, k)) - p).squaredNorm(); };
        for (int k = 1; k < 3; ++k)
          if (distance_squared(k) < distance_squared(nearest)) nearest = k;
        vertices.push_back(triangles(t, nearest));
      }
    }
  }
  return {Eigen::Map<const Points>(samples.data(), static_cast<Eigen::Index>(samples.size() / 3), 3),
          std::move(vertices)};
}

void fill_grazed_octants(const LeafMesh& mesh, const Points& samples, std::vector<FillFractions>& fill,
                         const CellFilter& may_hold) {
  const Embedding embedding = embed(mesh, samples, may_hold);
  for (std::size_t i = 0; i < embedding.cell.size(); ++i) {
    const Eigen::RowVector3d xi = embedding.xi.row(static_cast<Eigen::Index>(i));
    for (std::size_t k = 0; k < 8; ++k) {
      bool here = true;
      for (int c = 0; c < 3; ++c)
        here = here && (xi[c] > 0.5) == (kCorners[k][static_cast<std::size_t>(c)] == 1);
      double& share = fill[static_cast<std::size_t>(embedding.cell[i])][k];
      if (here) share = std::max(share, kGrazedFill);
    }
  }
}

std::vector<std::uint8_t> filled_cells(const std::vector<FillFractions>& fill,
                                       const std::vector<int>& embedded_cells) {
  std::vector<std::uint8_t> keep(fill.size(), 0);
  for (std::size_t c = 0; c < fill.size(); ++c) {
    keep[c] = std::any_of(fill[c].begin(), fill[c].end(), [](double f) { return f > 0.0; });
  }
  for (int c : embedded_cells) {
    if (c >= 0) keep[static_cast<std::size_t>(c)] = 1;
  }
  return keep;
}

}  // namespace sinew::lattice
