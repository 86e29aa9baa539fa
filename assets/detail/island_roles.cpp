#include "assets/detail/island_roles.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "assets/detail/rest_points.h"
#include "assets/riding.h"
#include "lattice/surface_query.h"

namespace sinew::assets::detail {

namespace {

using Eigen::Vector3d;
using lattice::Points;

/// Volume over area and length of a piece below which it holds no flesh [-]: a rod 25 times as long as it is
/// thick, a sheet 25 times as wide. Limbs made of one piece have 0.05 and more.
constexpr double kSlender = 0.02;
/// Share of the character's area up to which a piece may be a prop [-]: the head of a doll has 0.2 and more.
/// Slender ones may have any.
constexpr double kLargestProp = 0.15;
/// Share of a bone that a piece holds alone to be the limb [-].
constexpr double kHeld = 0.5;
/// A character of which less than this is left as flesh is built of rigid pieces [-].
constexpr double kLeastFlesh = 0.3;
/// How far a prop may reach that rides, in mean radii of the flesh that carries it [-]: an error of the
/// flesh's turn grows by so much on the way to its end.
constexpr double kLongestLever = 4.0;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Volume of a closed piece, or of what its triangles span with its middle [m^3].
double volume_of(const Points& points, const lattice::Triangles& triangles, const Vector3d& middle) {
  double volume = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = points.row(triangles(t, 0)).transpose() - middle,
                   b = points.row(triangles(t, 1)).transpose() - middle,
                   c = points.row(triangles(t, 2)).transpose() - middle;
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return std::abs(volume);
}

/// Vertices that an island uses, by themselves.
struct Piece {
  Piece(const Points& all, const Island& island)
      : points(static_cast<Eigen::Index>(island.vertices.size()), 3) {
    triangles = island.triangles;
    std::vector<int>::const_iterator found;
    for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
      for (int c = 0; c < 3; ++c) {
        found = std::lower_bound(island.vertices.begin(), island.vertices.end(), triangles(t, c));
        triangles(t, c) = static_cast<int>(found - island.vertices.begin());
      }
    }
    for (std::size_t i = 0; i < island.vertices.size(); ++i)
      points.row(static_cast<Eigen::Index>(i)) = all.row(island.vertices[i]);
    middle = points.colwise().mean().transpose();
    length = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
    bulk = island.area > 0.0 ? volume_of(points, triangles, middle) / island.area : 0.0;
  }
  Points points;
  lattice::Triangles triangles;
  Vector3d middle;
  double length = 0.0;  ///< of the diagonal of its box [m].
  double bulk = 0.0;    ///< volume over area [m]: a third of a ball's radius, half of a rod's.
};

class Chooser {
 public:
  Chooser(const Rig& rig, std::vector<Island>& islands)
      : rig_(rig), islands_(islands), points_(rest_points(rig)) {
    Eigen::Index count = 0;
    for (const Island& island : islands)
      if (island.is_skinned) count += island.triangles.rows();
    lattice::Triangles all(count, 3);
    Eigen::Index next = 0;
    for (const Island& island : islands) {
      if (!island.is_skinned) continue;
      all.middleRows(next, island.triangles.rows()) = island.triangles;
      next += island.triangles.rows();
      area_ += island.area;
    }
    if (count > 0) all_ = std::make_unique<lattice::SurfaceQuery>(points_, all);
    has_weight_.assign(at(rig.skeleton.num_joints()), false);
    for (const Part& part : rig.parts)
      for (const auto& influences : part.weights)
        for (const lattice::Influence& i : influences)
          if (i.weight > 0.0) has_weight_[at(i.frame)] = true;
    for (int j = rig.skeleton.num_joints() - 1; j > 0; --j)
      if (has_weight_[at(j)] && rig.skeleton.joint(j).parent >= 0)
        has_weight_[at(rig.skeleton.joint(j).parent)] = true;
  }

  void choose() {
    double flesh = 0.0;
    for (Island& island : islands_) {
      if (!island.is_skinned || (island.joint >= 0 && is_prop(island))) {
        island.role = PartRole::Skinned;
      } else {
        flesh += island.area;
      }
    }
    if (flesh < kLeastFlesh * area_)
      for (Island& island : islands_)
        if (island.is_skinned) island.role = PartRole::Simulated;
    choose_riders();
  }

 private:
  Vector3d position(int joint) const { return rig_.skeleton.joint(joint).rest_from_joint.translation(); }

  bool is_prop(const Island& island) const {
    if (!(island.area > 0.0)) return false;
    const Piece piece(points_, island);
    const bool slender = piece.bulk < kSlender * piece.length;
    const bool leaf = !std::any_of(
        rig_.skeleton.joints().begin(), rig_.skeleton.joints().end(), [&](const skeleton::Joint& joint) {
          return joint.parent == island.joint && has_weight_[at(rig_.skeleton.find(joint.name))];
        });
    if (slender && leaf) return true;
    if (held_share(island, piece) >= kHeld) return false;
    return slender || island.area <= kLargestProp * area_;
  }

  /// Share of a bone of its joint that this piece holds and no other; the largest of all bones.
  double held_share(const Island& island, const Piece& piece) const {
    const lattice::SurfaceQuery query(piece.points, piece.triangles);
    const Vector3d start = position(island.joint);
    const auto share_to = [&](const Vector3d& end) {
      constexpr int kProbes = 8;
      int held = 0;
      for (int k = 0; k < kProbes; ++k) {
        const Vector3d p = start + (k + 0.5) / kProbes * (end - start);
        const double own = query.winding_number(p);
        if (std::abs(own) > 0.5 && std::abs(all_->winding_number(p) - own) < 0.5) ++held;
      }
      return static_cast<double>(held) / kProbes;
    };
    double largest = 0.0;
    bool leaf = true;
    for (int j = island.joint + 1; j < rig_.skeleton.num_joints(); ++j) {
      if (rig_.skeleton.joint(j).parent != island.joint || !has_weight_[at(j)]) continue;
      leaf = false;
      largest = std::max(largest, share_to(position(j)));
    }
    if (!leaf) return largest;
    // A limb's last piece goes on where the bone before it came from.
    const int parent = rig_.skeleton.joint(island.joint).parent;
    Vector3d axis = parent < 0 ? piece.middle - start : start - position(parent);
    if (!(axis.norm() > 1e-6 * piece.length)) axis = piece.middle - start;
    if (!(axis.norm() > 0.0)) return 1.0;  // the joint is the middle of its own piece
    return share_to(start + 3.0 * piece.bulk * axis.normalized());
  }

  /// Of the props, those that the flesh round them carries.
  void choose_riders() {
    std::vector<Prop> props;
    std::vector<Island*> of_prop;
    for (Island& island : islands_) {
      if (island.role == PartRole::Simulated) continue;
      props.push_back({island.name, PartRole::Riding, island.joint, island.vertices, {}, ""});
      of_prop.push_back(&island);
    }
    if (props.empty()) return;
    const std::vector<Hold> holds = hold_props(rig_, props);
    for (std::size_t i = 0; i < props.size(); ++i) {
      const Hold& hold = holds[i];
      const bool rides = !hold.anchors.empty() && hold.touches && hold.lever <= kLongestLever;
      of_prop[i]->role = rides ? PartRole::Riding : PartRole::Skinned;
      of_prop[i]->reason =
          rides ? "hangs on one joint and rides on the flesh round it"
          : hold.anchors.empty() || !hold.touches
              ? std::string("hangs on one joint and touches no flesh that moves with it")
              : fmt::format("hangs on one joint and reaches {:.1f} times as far as the flesh that holds it",
                            hold.lever);
    }
  }

  const Rig& rig_;
  std::vector<Island>& islands_;
  Points points_;
  double area_ = 0.0;                           ///< of the whole skin [m^2].
  std::unique_ptr<lattice::SurfaceQuery> all_;  ///< of the whole skin.
  std::vector<bool> has_weight_;                ///< per joint: skin hangs on it or below it.
};

}  // namespace

void choose_roles(const Rig& rig, std::vector<Island>& islands) {
  if (islands.empty()) return;
  Chooser(rig, islands).choose();
}

}  // namespace sinew::assets::detail
