#include "fem/body/regions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sinew::fem {

namespace {

/// Rounding of an angle between two rotations [rad]: partners in a mirrored motion must be judged alike, and
/// clips like round angles.
constexpr double kAngleRounding = 1e-9;
/// A vertex belongs to frame f by s_f^kSharpness over that of its dominant frame, less kSmallest. With 1 the
/// regions of a character overlap so much that its factors are up to 2.6 times as large; with 4 at most 1.3
/// times as with a single owner, and creases are up to a fifth shorter than with that.
constexpr double kSharpness = 4.0, kSmallest = 0.1;

}  // namespace

FrameBends judge_bends(const FrameTree& tree, const std::vector<PosedFrames>& poses,
                       const RegionOptions& options) {
  const auto largest_angle = [&](int a, int b) {
    double largest = 0.0;
    for (const PosedFrames& pose : poses) {
      const Eigen::Matrix3d relative = pose.frames[static_cast<std::size_t>(a)].rotation.transpose() *
                                       pose.frames[static_cast<std::size_t>(b)].rotation;
      largest = std::max(largest, Eigen::AngleAxisd(relative).angle());
    }
    return largest;
  };
  std::vector<int> group(static_cast<std::size_t>(tree.num_frames()), -1);
  for (std::size_t g = 0; g < options.groups.size(); ++g) {
    for (const int joint : options.groups[g]) {
      const int f = tree.frame_of_joint[static_cast<std::size_t>(joint)];
      if (f >= 0) group[static_cast<std::size_t>(f)] = static_cast<int>(g);
    }
  }
  FrameBends bends;
  for (int f = 0; f < tree.num_frames(); ++f) {
    const int parent = tree.frames[static_cast<std::size_t>(f)].parent;
    const int above = parent < 0 ? f : bends.leader[static_cast<std::size_t>(parent)];
    const double angle = parent < 0 ? 0.0 : largest_angle(above, f);
    const int own = group[static_cast<std::size_t>(f)];
    const bool merges = parent >= 0 && own == group[static_cast<std::size_t>(above)] &&
                        (own >= 0 || angle <= options.merge_angle + kAngleRounding);
    bends.leader.push_back(merges ? above : f);
    bends.bend.push_back(merges ? 0.0 : angle);
  }
  return bends;
}

namespace {

/// A joint between a parent and a child frame, as the region weights see it.
struct Joint {
  int parent = -1, child = -1;
  Eigen::Vector3d position{0, 0, 0};  ///< X_J [m].
  Eigen::Vector3d normal{0, 0, 1};    ///< n, from parent to child.
  double half_width = 0.0;            ///< L [m].
  double reach = 0.0;                 ///< radial distance [m] beyond which the joint no longer counts.
  int first_region = -1;
  int num_regions = 1;
};

/// Index of the frame's bone whose end is nearest to p, or -1.
int bone_towards(const lattice::ControlLattice& lattice, int joint, const Eigen::Vector3d& p, bool by_start) {
  int best = -1;
  double best_distance = 0.0;
  for (int b = 0; b < static_cast<int>(lattice.bones.size()); ++b) {
    const auto& bone = lattice.bones[static_cast<std::size_t>(b)];
    if (bone.frame != joint) continue;
    const double distance = ((by_start ? bone.rest_start : bone.rest_end) - p).norm();
    if (best < 0 || distance < best_distance) {
      best = b;
      best_distance = distance;
    }
  }
  return best;
}

Joint make_joint(const lattice::ControlLattice& lattice, const FrameTree& tree, const LimbRadii& radii,
                 int child) {
  Joint joint;
  const Frame& c = tree.frames[static_cast<std::size_t>(child)];
  const Frame& p = tree.frames[static_cast<std::size_t>(c.parent)];
  joint.child = child;
  joint.parent = c.parent;
  joint.position = c.origin_rest;
  const int child_bone = bone_towards(lattice, c.joint, joint.position, true);
  const int parent_bone = bone_towards(lattice, p.joint, joint.position, false);
  const auto direction = [&](int bone) -> Eigen::Vector3d {
    if (bone < 0) return Eigen::Vector3d::Zero();
    const auto& b = lattice.bones[static_cast<std::size_t>(bone)];
    return (b.rest_end - b.rest_start).normalized();
  };
  const auto length = [&](int bone) {
    const auto& b = lattice.bones[static_cast<std::size_t>(bone)];
    return (b.rest_end - b.rest_start).norm();
  };
  Eigen::Vector3d d_c = direction(child_bone);
  const Eigen::Vector3d d_p = direction(parent_bone);
  if (d_c.isZero()) d_c = (joint.position - p.origin_rest).normalized();
  const Eigen::Vector3d sum = d_p + d_c;
  joint.normal = sum.norm() < 0.2 ? d_c : sum.normalized();
  if (!joint.normal.allFinite() || joint.normal.isZero()) joint.normal = Eigen::Vector3d::UnitY();
  double radius = lattice.edge_length;
  if (child_bone >= 0) radius = radii.near(child_bone, 0.0);
  if (child_bone < 0 && parent_bone >= 0) radius = radii.near(parent_bone, length(parent_bone));
  joint.half_width = radius;
  if (parent_bone >= 0) joint.half_width = std::min(joint.half_width, 0.5 * length(parent_bone));
  if (child_bone >= 0) joint.half_width = std::min(joint.half_width, 0.5 * length(child_bone));
  joint.reach = 2.0 * radius;
  return joint;
}

/// Shares of one joint for a vertex owned by one of its frames: parent, joint regions, child.
struct Shares {
  double parent = 0.0, child = 0.0;
  std::array<double, 2> joints{0.0, 0.0};
};

Shares shares_of(const Joint& joint, const Eigen::Vector3d& x, bool owned_by_parent) {
  Shares shares;
  const Eigen::Vector3d from_joint = x - joint.position;
  const double z = from_joint.dot(joint.normal);
  const double theta =
      joint.half_width > 0.0 ? std::clamp(z / joint.half_width, -1.0, 1.0) : (z < 0.0 ? -1.0 : 1.0);
  if (joint.num_regions == 1) {
    shares.joints[0] = 1.0 - std::abs(theta);
    shares.parent = std::max(-theta, 0.0);
    shares.child = std::max(theta, 0.0);
  } else {  // hats with peaks at -1, -1/3, 1/3, 1
    const auto hat = [&](double peak) { return std::max(0.0, 1.0 - 1.5 * std::abs(theta - peak)); };
    shares.parent = hat(-1.0);
    shares.joints = {hat(-1.0 / 3.0), hat(1.0 / 3.0)};
    shares.child = hat(1.0);
  }
  // The joint's plane is unbounded, but the joint is not: a torso meets two hips, and the right half of the
  // pelvis has nothing to turn with the left thigh. Beyond the joint's reach the owner keeps all (a departure
  // from the plain rule).
  const double radial = (from_joint - z * joint.normal).norm();
  const double local = joint.reach > 0.0 ? std::clamp(2.0 - radial / joint.reach, 0.0, 1.0) : 1.0;
  double& owner = owned_by_parent ? shares.parent : shares.child;
  double& other = owned_by_parent ? shares.child : shares.parent;
  other *= local;
  shares.joints[0] *= local;
  shares.joints[1] *= local;
  owner = 1.0 - other - shares.joints[0] - shares.joints[1];
  return shares;
}

}  // namespace

std::vector<Region> make_regions(const lattice::ControlLattice& lattice, const FrameTree& tree,
                                 const LimbRadii& radii, const lattice::LeafMesh& mesh,
                                 const FrameWeights& weights, const FrameBends& bends,
                                 const RegionOptions& options) {
  const auto leader = [&](int f) { return bends.leader[static_cast<std::size_t>(f)]; };
  std::vector<Region> regions;
  for (int f = 0; f < tree.num_frames(); ++f) {
    regions.push_back({f, f, 0.0, tree.frames[static_cast<std::size_t>(f)].origin_rest, {}, {}});
  }
  std::vector<Joint> joints;
  std::vector<std::vector<int>> joints_of_frame(tree.frames.size());
  for (int f = 0; options.joints && f < tree.num_frames(); ++f) {
    if (tree.frames[static_cast<std::size_t>(f)].parent < 0) continue;
    if (bends.bend[static_cast<std::size_t>(f)] <= options.joint_angle + kAngleRounding) continue;
    Joint joint = make_joint(lattice, tree, radii, f);
    // The region count is a property of the run, not of the instant, so that weights never jump.
    joint.num_regions =
        bends.bend[static_cast<std::size_t>(f)] > 0.5 * std::numbers::pi + kAngleRounding ? 2 : 1;
    joint.first_region = static_cast<int>(regions.size());
    for (int k = 0; k < joint.num_regions; ++k) {
      const double t = joint.num_regions == 1 ? 0.5 : (k + 1) / 3.0;
      regions.push_back({leader(joint.parent), leader(joint.child), t, joint.position, {}, {}});
    }
    joints_of_frame[static_cast<std::size_t>(joint.parent)].push_back(static_cast<int>(joints.size()));
    joints_of_frame[static_cast<std::size_t>(joint.child)].push_back(static_cast<int>(joints.size()));
    joints.push_back(joint);
  }

  // w of a vertex at x that frame `owner` has alone, times `share`.
  const auto add_owned = [&](std::vector<double>& w, int owner, const Eigen::Vector3d& x, double share) {
    std::vector<std::pair<int, double>> parts;
    double own = 1.0;  // product of the owner's shares over its joints
    for (const int j : joints_of_frame[static_cast<std::size_t>(owner)]) {
      const Joint& joint = joints[static_cast<std::size_t>(j)];
      const bool parent = joint.parent == owner;
      const Shares shares = shares_of(joint, x, parent);
      own *= parent ? shares.parent : shares.child;
      parts.emplace_back(leader(parent ? joint.child : joint.parent), parent ? shares.child : shares.parent);
      for (int k = 0; k < joint.num_regions; ++k)
        parts.emplace_back(joint.first_region + k, shares.joints[static_cast<std::size_t>(k)]);
    }
    parts.emplace_back(leader(owner), own);
    double sum = 0.0;
    for (const auto& part : parts) sum += part.second;
    for (const auto& [region, part] : parts) w[static_cast<std::size_t>(region)] += share * part / sum;
  };
  std::vector<double> w(regions.size());
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    std::fill(w.begin(), w.end(), 0.0);
    // Off the joints, too, weights go over from one owner to the next without a jump.
    double dominant = 0.0;
    for (FrameWeights::InnerIterator s(weights, a); s; ++s) dominant = std::max(dominant, s.value());
    for (FrameWeights::InnerIterator s(weights, a); s; ++s) {
      const double share = std::pow(s.value() / dominant, kSharpness) - kSmallest;
      if (share > 0.0) add_owned(w, static_cast<int>(s.col()), mesh.points.row(a).transpose(), share);
    }
    double sum = 0.0;
    for (double& x : w) {
      if (x < 1e-9) x = 0.0;
      sum += x;
    }
    for (std::size_t i = 0; i < regions.size(); ++i) {
      if (w[i] == 0.0) continue;
      regions[i].vertices.push_back(a);
      regions[i].weights.push_back(w[i] / sum);
    }
  }
  std::erase_if(regions, [](const Region& region) { return region.vertices.empty(); });
  return regions;
}

RegionTransform transform_of(const Region& region, const PosedFrames& posed) {
  const FrameTransform& first = posed.frames[static_cast<std::size_t>(region.first)];
  const FrameTransform& second = posed.frames[static_cast<std::size_t>(region.second)];
  RegionTransform transform;
  transform.origin = second.from_rest * region.origin_rest;
  if (region.first == region.second) {
    transform.rotation = first.rotation;
    transform.from_rest = first.from_rest;
    return transform;
  }
  const Eigen::Quaterniond between =
      Eigen::Quaterniond(first.rotation).slerp(region.t, Eigen::Quaterniond(second.rotation));
  transform.rotation = between.normalized().toRotationMatrix();
  // Scale of the two frames blended in the region's axes, so that a growing bone carries its joint along.
  const Eigen::Matrix3d stretch = (1.0 - region.t) * first.rotation.transpose() * first.from_rest.linear() +
                                  region.t * second.rotation.transpose() * second.from_rest.linear();
  transform.from_rest.linear() = transform.rotation * stretch;
  transform.from_rest.translation() = transform.origin - transform.from_rest.linear() * region.origin_rest;
  return transform;
}

}  // namespace sinew::fem
