#include "lattice/detail/rig_input.h"

#include <stdexcept>

#include <fmt/format.h>

namespace sinew::lattice::detail {
namespace {

void check_joints(const JointTree& joints) {
  const int n = static_cast<int>(joints.parents.size());
  if (n == 0) throw std::invalid_argument("lattice: there is no joint");
  if (joints.positions.rows() != n || static_cast<int>(joints.names.size()) != n) {
    throw std::invalid_argument(fmt::format("lattice: {} joint positions and {} names for {} joints",
                                            joints.positions.rows(), joints.names.size(), n));
  }
  for (int j = 0; j < n; ++j) {
    if (!joints.positions.row(j).allFinite()) {
      throw std::invalid_argument(
          fmt::format("lattice: joint '{}' has a position that is not finite", joints.names[j]));
    }
    if (joints.parents[j] >= j || joints.parents[j] < -1) {
      throw std::invalid_argument(
          fmt::format("lattice: joint '{}' does not come after its parent", joints.names[j]));
    }
  }
}

void check_weights(const Surface& skin, int num_joints) {
  double total = 0.0;
  for (std::size_t v = 0; v < skin.weights.size(); ++v)
    for (const Influence& influence : skin.weights[v]) {
      if (influence.frame < 0 || influence.frame >= num_joints) {
        throw std::invalid_argument(fmt::format(
            "lattice: skin vertex {} hangs on joint {}, which does not exist", v, influence.frame));
      }
      total += influence.weight;
    }
  if (!(total > 0.0)) throw std::invalid_argument("lattice: no skin vertex has a weight");
}

/// Takes the excluded joints out of the tree.
void bypass(const std::vector<bool>& excluded, std::vector<int>& parents) {
  for (int j = 0; j < static_cast<int>(parents.size()); ++j) {
    int& parent = parents[j];
    while (parent >= 0 && excluded[parent]) parent = parents[parent];
  }
  for (int j = 0; j < static_cast<int>(parents.size()); ++j)
    if (excluded[j]) parents[j] = -1;
}

std::vector<int> stand_ins(const std::vector<bool>& excluded, const std::vector<int>& parents) {
  std::vector<int> taking_part;
  for (int j = 0; j < static_cast<int>(parents.size()); ++j)
    if (!excluded[j]) taking_part.push_back(j);
  return frame_of_joint(parents, taking_part);
}

/// Cells that differ in size between the sides are not mirror images.
void refuse_lopsided(const std::vector<SizeFactor>& factors, const JointTree& joints, MirrorSearch& search) {
  std::vector<double> factor(joints.parents.size(), 1.0);
  for (const SizeFactor& size : factors) factor[size.joint] = size.factor;
  for (const SizeFactor& size : factors) {
    const int partner = search.mirror.joint[size.joint];
    if (partner < 0 || factor[partner] == size.factor) continue;  // without skin it has no size
    search.found = false;
    search.why_not =
        fmt::format("cells are sized by {} at '{}' and by {} at its mirror image '{}'", size.factor,
                    joints.names[size.joint], factor[partner], joints.names[partner]);
  }
}

}  // namespace

RigInput make_rig_input(const Surface& skin, const JointTree& joints, const BuildOptions& options) {
  check_joints(joints);
  check_weights(skin, static_cast<int>(joints.parents.size()));
  UnitSkin unit = make_unit_skin(skin);
  JointTree unit_joints = joints;
  const auto to_unit = [&] {
    for (Eigen::Index j = 0; j < joints.positions.rows(); ++j)
      unit_joints.positions.row(j) = unit.to_unit(joints.positions.row(j).transpose()).transpose();
  };
  to_unit();
  const std::vector<bool> excluded = excluded_joints(options, static_cast<int>(joints.parents.size()));
  std::vector<int> stand_in = stand_ins(excluded, joints.parents);
  bypass(excluded, unit_joints.parents);
  JointWeights weights = joint_weights(unit, unit_joints, stand_in);
  MirrorSearch search;
  search.why_not = "symmetry is off";
  if (options.symmetry == Symmetry::Auto) search = find_mirror(unit, unit_joints, weights);
  if (search.found) refuse_lopsided(options.size_factors, joints, search);
  if (search.found) {
    const MirrorFrame frame = mirror_frame(unit, search.mirror);
    unit = make_unit_skin(skin, &frame);
    to_unit();
    symmetrise(search.mirror, unit_joints);
    weights = joint_weights(unit, unit_joints, stand_in);
  }
  weights.excluded = excluded;
  CellSizes sizes = sizes_of_joints(unit, unit_joints, weights, stand_in, options,
                                    search.found ? &search.mirror.joint : nullptr);
  std::vector<int> idle = idle_sizes(weights, options);
  RigInput input{skin,
                 joints,
                 std::move(unit),
                 std::move(unit_joints),
                 std::move(weights),
                 std::move(stand_in),
                 std::move(sizes),
                 std::move(idle),
                 options.poll,
                 {},
                 std::move(search.why_not)};
  if (search.found) input.mirror = std::move(search.mirror);
  return input;
}

}  // namespace sinew::lattice::detail
