#include "lattice/detail/lattice_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lattice/detail/graded_points.h"
#include "lattice/detail/segments.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

constexpr double kBoneSpacing = 1.1;  ///< of bone samples, in units of h.
/// Grid points farther from the skin than this are in no cell that touches it: the longest edge of a cell of
/// the body-centred grid is 1.155 h.
constexpr double kGridReach = 1.2;
/// The same in the plane of a half, where cells have the diagonal of a cube's side for an edge, 1.633 h:
/// without a corner of it the skin there would be left to cells that reach far away.
constexpr double kPlaneReach = 1.68;
/// Half the length of a bone piece, and a little more for rounding.
constexpr double kMiddleBall = 0.51;
/// Bone pieces are looked for this far away, in units of h.
constexpr double kClearanceReach = 2.0;

/// Parameters of the samples on a bone from a to b: 1.1 h apart.
std::vector<double> bone_samples(const Vector3d& a, const Vector3d& b, double h,
                                 const PointOptions& options) {
  const double length = (b - a).norm();
  std::vector<double> samples;
  if (options.is_uniform(h)) {
    const int pieces = std::max(1, static_cast<int>(std::lround(length / (kBoneSpacing * h))));
    for (int i = 1; i < pieces; ++i) samples.push_back(static_cast<double>(i) / pieces);
    return samples;
  }
  constexpr int kSteps = 64;
  std::vector<double> pieces_until(kSteps + 1, 0.0);  // from the start, fractions of pieces included
  for (int i = 0; i < kSteps; ++i) {
    const double s = (i + 0.5) / kSteps, edge = options.edge_at((1.0 - s) * a + s * b, h);
    pieces_until[i + 1] = pieces_until[i] + length / kSteps / (kBoneSpacing * edge);
  }
  const int pieces = std::max(1, static_cast<int>(std::lround(pieces_until.back())));
  for (int i = 1, step = 0; i < pieces; ++i) {
    const double wanted = pieces_until.back() * i / pieces;
    while (pieces_until[step + 1] < wanted) ++step;
    const double share = (wanted - pieces_until[step]) / (pieces_until[step + 1] - pieces_until[step]);
    samples.push_back((step + share) / kSteps);
  }
  return samples;
}

void place_bones(const ReducedSkeleton& skeleton, double h, const PointOptions& options, LatticePoints& out) {
  const auto is_placed = [&](const ReducedBone& bone) {
    const bool other_half = out.half && (skeleton.nodes[bone.start].position.x() < 0.0 ||
                                         skeleton.nodes[bone.end].position.x() < 0.0);
    return !bone.soft && !other_half;
  };
  std::vector<int> vertex_of_node(skeleton.nodes.size(), -1);
  for (const ReducedBone& bone : skeleton.bones) {
    if (!is_placed(bone)) continue;
    for (int node : {bone.start, bone.end})
      if (vertex_of_node[node] < 0)
        vertex_of_node[node] = out.add(skeleton.nodes[node].position, {.bone = -1, .s = 0.0, .fixed = true});
  }
  out.chains.resize(skeleton.bones.size());
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const ReducedBone& bone = skeleton.bones[b];
    if (!is_placed(bone)) continue;
    const Vector3d start = skeleton.nodes[bone.start].position, end = skeleton.nodes[bone.end].position;
    out.chains[b].push_back(vertex_of_node[bone.start]);
    for (const double s : bone_samples(start, end, h, options))
      out.chains[b].push_back(out.add(point_on_bone(skeleton, b, s), {.bone = b, .s = s, .fixed = false}));
    out.chains[b].push_back(vertex_of_node[bone.end]);
  }
}

}  // namespace

Vector3d point_on_bone(const ReducedSkeleton& skeleton, int bone, double s) {
  const ReducedBone& b = skeleton.bones[bone];
  return (1.0 - s) * skeleton.nodes[b.start].position + s * skeleton.nodes[b.end].position;
}

BoneClearance::BoneClearance(const LatticePoints& points, double h, const PointOptions& options) {
  for (const std::vector<int>& chain : points.chains)
    for (std::size_t i = 1; i < chain.size(); ++i) {
      const Vector3d a = points.points[chain[i - 1]], b = points.points[chain[i]];
      const double length = (b - a).norm(), edge = options.edge_at(0.5 * (a + b), h);
      pieces_.push_back(
          {a, b, options.exclusion * std::min(edge, std::max(length, 0.5 * edge)), kMiddleBall * length});
    }
  if (pieces_.empty()) return;
  side_ = kClearanceReach * h;
  Vector3d high = pieces_[0].a;
  low_ = high;
  for (const Piece& piece : pieces_) {
    side_ = std::max({side_, piece.radius, 2.0 * piece.middle_radius});
    low_ = low_.cwiseMin(piece.a).cwiseMin(piece.b);
    high = high.cwiseMax(piece.a).cwiseMax(piece.b);
  }
  const Vector3d margin = Vector3d::Constant(side_);
  low_ -= margin;
  count_ = ((high + margin - low_) / side_).array().floor().cast<int>() + 1;
  bins_.resize(static_cast<std::size_t>(count_.prod()));
  for (int i = 0; i < static_cast<int>(pieces_.size()); ++i) {
    const Vector3d from = pieces_[i].a.cwiseMin(pieces_[i].b) - margin;
    const Vector3d to = pieces_[i].a.cwiseMax(pieces_[i].b) + margin;
    const Eigen::Vector3i first = ((from - low_) / side_).array().floor().cast<int>().max(0);
    const Eigen::Vector3i last = ((to - low_) / side_).array().floor().cast<int>().min((count_.array() - 1));
    for (int x = first.x(); x <= last.x(); ++x)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int z = first.z(); z <= last.z(); ++z) bins_[(x * count_.y() + y) * count_.z() + z].push_back(i);
  }
}

const std::vector<int>& BoneClearance::pieces_near(const Vector3d& p) const {
  const Eigen::Array3d at = ((p - low_) / side_).array().floor();
  if ((at < 0.0).any() || (at >= count_.cast<double>().array()).any()) return none_;
  const Eigen::Vector3i bin = at.cast<int>();
  return bins_[(bin.x() * count_.y() + bin.y()) * count_.z() + bin.z()];
}

bool BoneClearance::is_too_close(const Vector3d& p) const {
  const std::vector<int>& near = pieces_near(p);
  return std::any_of(near.begin(), near.end(), [&](int i) {
    const Piece& piece = pieces_[i];
    return (p - 0.5 * (piece.a + piece.b)).squaredNorm() < piece.middle_radius * piece.middle_radius ||
           point_segment_distance(p, piece.a, piece.b) < piece.radius;
  });
}

double BoneClearance::distance(const Vector3d& p) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i : pieces_near(p))
    nearest = std::min(nearest, point_segment_distance(p, pieces_[i].a, pieces_[i].b));
  return nearest <= side_ ? nearest : std::numeric_limits<double>::infinity();
}

LatticePoints place_points(const UnitSkin& skin, const ReducedSkeleton& skeleton, double h,
                           const PointOptions& options) {
  LatticePoints out;
  out.half = !skeleton.mirror_bone.empty();
  place_bones(skeleton, h, options, out);
  const BoneClearance clearance(out, h, options);
  if (!options.is_uniform(h)) {
    place_graded_points(skin, clearance, h, options, out);
    return out;
  }
  // Cubes of side 2h/sqrt(3) with a point in the middle: neighbours along a diagonal are h apart.
  const double side = 2.0 * h / std::sqrt(3.0);
  const Vector3d reach = skin.points.cwiseAbs().colwise().maxCoeff().transpose().array() +
                         (out.half ? kPlaneReach : kGridReach) * h;
  Vector3d shift = Vector3d::Constant(options.shift * side);
  if (out.half) shift.x() = 0.0;
  const Eigen::Vector3i count = (2.0 * reach / side).array().ceil().cast<int>() + 1;
  for (int i = out.half ? 0 : -count.x(); i <= count.x(); ++i)
    for (int j = -count.y(); j <= count.y(); ++j) {
      options.poll();
      for (int k = -count.z(); k <= count.z(); ++k) {
        if ((i - j) % 2 != 0 || (j - k) % 2 != 0) continue;  // all even or all odd
        const Vector3d p = 0.5 * side * Vector3d(i, j, k) + shift;
        if ((p.cwiseAbs().array() > reach.array()).any()) continue;
        const double near = (out.half && i == 0 ? kPlaneReach : kGridReach) * h;
        if (!skin.query.is_within(p, near) && !skin.is_inside(p)) continue;
        if (!clearance.is_too_close(p)) out.add(p, {});
      }
    }
  return out;
}

}  // namespace sinew::lattice::detail
