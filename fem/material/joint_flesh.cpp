#include "fem/material/joint_flesh.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "fem/material/weighted_quantile.h"

namespace sinew::fem {
namespace {

struct Segment {
  Eigen::Vector3d start, end;

  Eigen::Vector3d foot(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d span = end - start;
    const double squared = span.squaredNorm();
    return squared > 0.0
               ? Eigen::Vector3d(start + std::clamp((p - start).dot(span) / squared, 0.0, 1.0) * span)
               : start;
  }
};

/// A vertex of the skin: its share of the area and its outward normal.
struct Sample {
  Eigen::Vector3d point, normal;
  double area;
};

/// Samples of every joint, each with the one that it follows most.
std::vector<std::vector<Sample>> samples_of_joints(const lattice::Surface& skin, int num_joints) {
  std::vector<Eigen::Vector3d> normals(static_cast<std::size_t>(skin.points.rows()), Eigen::Vector3d::Zero());
  std::vector<double> areas(normals.size(), 0.0);
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const Eigen::Vector3d a = skin.points.row(skin.triangles(t, 0)),
                          b = skin.points.row(skin.triangles(t, 1)),
                          c = skin.points.row(skin.triangles(t, 2));
    const Eigen::Vector3d normal = (b - a).cross(c - a) / 6.0;
    for (int k = 0; k < 3; ++k) {
      normals[static_cast<std::size_t>(skin.triangles(t, k))] += normal;
      areas[static_cast<std::size_t>(skin.triangles(t, k))] += normal.norm();
    }
  }
  std::vector<std::vector<Sample>> of_joint(static_cast<std::size_t>(num_joints));
  for (std::size_t v = 0; v < areas.size(); ++v) {
    const std::vector<lattice::Influence>& influences = skin.weights[v];
    const auto most = std::max_element(influences.begin(), influences.end(),
                                       [](const auto& a, const auto& b) { return a.weight < b.weight; });
    if (most == influences.end() || !(areas[v] > 0.0)) continue;
    of_joint[static_cast<std::size_t>(most->frame)].push_back(
        {skin.points.row(static_cast<Eigen::Index>(v)).transpose(), normals[v].stableNormalized(), areas[v]});
  }
  return of_joint;
}

/// A bone at the end of a limb ends here, as a share of how far its skin reaches: where the lattice's tip
/// bones do.
constexpr double kTip = 0.8;

class Bones {
 public:
  Bones(const skeleton::Skeleton& skeleton, const std::vector<std::vector<Sample>>& samples)
      : of_joint_(samples.size()), ends_(samples.size()), beyond_(samples.size(), 0.0) {
    const int n = skeleton.num_joints();
    std::vector<char> carries(samples.size(), 0);
    for (int j = n - 1; j >= 0; --j) {
      carries[at(j)] = carries[at(j)] || !samples[at(j)].empty();
      if (carries[at(j)] && skeleton.joint(j).parent >= 0) carries[at(skeleton.joint(j).parent)] = 1;
    }
    const auto origin = [&](int j) -> Eigen::Vector3d {
      return skeleton.joint(j).rest_from_joint.translation();
    };
    for (int j = 0; j < n; ++j) ends_[at(j)].push_back(j);
    for (int j = 0; j < n; ++j) {
      const int parent = skeleton.joint(j).parent;
      if (parent < 0 || !carries[at(j)]) continue;
      of_joint_[at(parent)].push_back({origin(parent), origin(j)});
      ends_[at(parent)].push_back(j);
    }
    for (int j = 0; j < n; ++j) {
      if (!of_joint_[at(j)].empty()) continue;
      of_joint_[at(j)].push_back(tip(origin(j), samples[at(j)]));
      const Segment& bone = of_joint_[at(j)].back();
      beyond_[at(j)] = (1.0 / kTip - 1.0) * (bone.end - bone.start).norm();
    }
  }

  const std::vector<int>& ends(int joint) const { return ends_[at(joint)]; }
  /// How far flesh reaches beyond the end of the joint's last bone [m].
  double beyond(int joint) const { return beyond_[at(joint)]; }

  /// From the nearest of the joint's bones to p.
  Eigen::Vector3d arm(int joint, const Eigen::Vector3d& p) const {
    Eigen::Vector3d shortest = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    for (const Segment& bone : of_joint_[at(joint)]) {
      const Eigen::Vector3d arm = p - bone.foot(p);
      if (!(arm.squaredNorm() >= shortest.squaredNorm())) shortest = arm;
    }
    return shortest;
  }

 private:
  static std::size_t at(int joint) { return static_cast<std::size_t>(joint); }

  static Segment tip(const Eigen::Vector3d& origin, const std::vector<Sample>& samples) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    double area = 0.0, reach = 0.0;
    for (const Sample& s : samples) middle += s.area * s.point, area += s.area;
    if (!(area > 0.0)) return {origin, origin};
    const Eigen::Vector3d direction = (middle / area - origin).stableNormalized();
    for (const Sample& s : samples) reach = std::max(reach, direction.dot(s.point - origin));
    return {origin, origin + kTip * reach * direction};
  }

  std::vector<std::vector<Segment>> of_joint_;
  std::vector<std::vector<int>> ends_;
  std::vector<double> beyond_;
};

}  // namespace

std::vector<JointFlesh> joint_flesh(const lattice::Surface& skin, const skeleton::Skeleton& skeleton) {
  const std::vector<std::vector<Sample>> samples = samples_of_joints(skin, skeleton.num_joints());
  const Bones bones(skeleton, samples);
  std::vector<JointFlesh> flesh(samples.size());
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    JointFlesh& f = flesh[static_cast<std::size_t>(j)];
    f.ends = bones.ends(j);
    f.tip = bones.beyond(j);
    std::vector<WeightedValue> distances;
    double outwards = 0.0;
    for (const Sample& s : samples[static_cast<std::size_t>(j)]) {
      const Eigen::Vector3d arm = bones.arm(j, s.point);
      distances.push_back({arm.norm(), s.area});
      outwards += s.area * s.normal.dot(arm);
      f.area += s.area;
    }
    if (!(f.area > 0.0)) continue;
    f.radius = weighted_quantile(distances, 0.5);
    f.half_thickness = std::clamp(outwards / f.area, 0.0, f.radius);
    // A few percent of a joint's skin follow it where no bone is meant to be (a strap, a seam).
    f.overhang = std::max(0.0, weighted_quantile(std::move(distances), 0.95) - f.half_thickness);
  }
  return flesh;
}

double typical_radius(const lattice::Surface& skin, const skeleton::Skeleton& skeleton) {
  const std::vector<std::vector<Sample>> samples = samples_of_joints(skin, skeleton.num_joints());
  const Bones bones(skeleton, samples);
  std::vector<WeightedValue> distances;
  for (int j = 0; j < skeleton.num_joints(); ++j)
    for (const Sample& s : samples[static_cast<std::size_t>(j)])
      distances.push_back({bones.arm(j, s.point).norm(), s.area});
  return weighted_quantile(std::move(distances), 0.5);
}

}  // namespace sinew::fem
