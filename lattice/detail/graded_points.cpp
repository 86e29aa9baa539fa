#include "lattice/detail/graded_points.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "lattice/detail/symmetry.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Points farther from the skin than this, in target edges there, are in no cell that touches it: more than
/// on the regular grid, as edges are longer where the crystal is dislocated.
constexpr double kReach = 1.5;
/// A point keeps this distance from all others, in target edges there.
constexpr double kRoom = 0.8;
/// Of a half: points nearer to the plane than this move into it, in target edges there.
constexpr double kSnap = 0.4;
/// Skin farther than this from all points has a crystal of its own, in target edges there.
constexpr double kAlone = 1.1;

/// Points taken so far, in cubes.
class TakenPoints {
 public:
  explicit TakenPoints(double side) : side_(side) {}

  void add(const Vector3d& p) { cubes_[key(cube_of(p))].push_back(p); }
  bool has_within(const Vector3d& p, double radius) const {
    const Eigen::Array3i first = cube_of((p.array() - radius).matrix()),
                         last = cube_of((p.array() + radius).matrix());
    for (int i = first.x(); i <= last.x(); ++i)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int k = first.z(); k <= last.z(); ++k) {
          const auto found = cubes_.find(key({i, j, k}));
          if (found == cubes_.end()) continue;
          for (const Vector3d& q : found->second)
            if ((p - q).squaredNorm() < radius * radius) return true;
        }
    return false;
  }

 private:
  Eigen::Array3i cube_of(const Vector3d& p) const { return (p / side_).array().floor().cast<int>(); }
  static std::int64_t key(const Eigen::Array3i& cube) {
    constexpr std::int64_t kHalf = 1 << 20;  // unit coordinates are within 2
    return ((cube.x() + kHalf) << 42) + ((cube.y() + kHalf) << 21) + (cube.z() + kHalf);
  }
  double side_;
  std::unordered_map<std::int64_t, std::vector<Vector3d>> cubes_;
};

class Crystal {
 public:
  Crystal(const UnitSkin& skin, const BoneClearance& clearance, double h, const PointOptions& options,
          LatticePoints& out)
      : skin_(skin),
        clearance_(clearance),
        options_(options),
        h_(h),
        out_(out),
        far_(skin.points.cwiseAbs().colwise().maxCoeff().transpose().array() +
             kReach * options.sizes->largest(h)),
        taken_(std::sqrt(options.sizes->smallest(h) * options.sizes->largest(h))) {}

  /// Takes p where there is room, and all that grows from it.
  void grow_from(const Vector3d& p, double room) {
    std::vector<Vector3d> open;
    take(p, room, open);
    for (std::size_t i = 0; i < open.size(); ++i) {
      options_.poll();
      const Vector3d from = open[i];
      const double edge = edge_at(from);
      for (int n = 0; n < 8; ++n) {
        const Vector3d direction = Vector3d(n & 1 ? 1 : -1, n & 2 ? 1 : -1, n & 4 ? 1 : -1) / std::sqrt(3.0);
        const double next = edge_at(from + edge * direction);
        take(from + 0.5 * (edge + next) * direction, kRoom, open);
      }
    }
  }

 private:
  double edge_at(const Vector3d& p) const { return options_.edge_at(p, h_); }

  void take(Vector3d p, double room, std::vector<Vector3d>& open) {
    if ((p.cwiseAbs().array() > far_.array()).any()) return;
    const double edge = edge_at(p);
    if (out_.half) {
      if (p.x() < -kSnap * edge) return;
      if (p.x() < kSnap * edge) p.x() = 0.0;
    }
    if (taken_.has_within(p, room * edge)) return;
    if (!skin_.query.is_within(p, kReach * edge) && !skin_.is_inside(p)) return;
    taken_.add(p);
    open.push_back(p);
    if (!clearance_.is_too_close(p)) out_.add(p, {});
  }

  const UnitSkin& skin_;
  const BoneClearance& clearance_;
  const PointOptions& options_;
  double h_;
  LatticePoints& out_;
  Vector3d far_;
  TakenPoints taken_;
};

}  // namespace

void place_graded_points(const UnitSkin& skin, const BoneClearance& clearance, double h,
                         const PointOptions& options, LatticePoints& out) {
  Crystal crystal(skin, clearance, h, options, out);
  // One crystal for all that hangs together, from the middle of the skin's box; others for what is left.
  Vector3d middle = Vector3d::Constant(options.shift * 2.0 * options.sizes->largest(h) / std::sqrt(3.0));
  if (out.half) middle.x() = 0.0;
  Eigen::Index nearest = 0;
  (skin.points.rowwise() - middle.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  const auto at_skin = [&](Eigen::Index v) -> Vector3d {
    const Vector3d p = skin.points.row(v).transpose();
    return out.half && p.x() < 0.0 ? reflected(p) : p;
  };
  crystal.grow_from(skin.is_inside(middle) ? middle : at_skin(nearest), kRoom);
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v) crystal.grow_from(at_skin(v), kAlone);
}

}  // namespace sinew::lattice::detail
