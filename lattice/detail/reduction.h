#pragma once

#include <string>
#include <utility>
#include <vector>

#include "lattice/detail/cell_sizes.h"
#include "lattice/detail/skeleton_reduction.h"

namespace sinew::lattice::detail {

/// reduce_skeleton at work: the joint tree, pruned, cut, welded, contracted, chained and softened
/// (skeleton_reduction.cpp), and what holds the skin that is left without a bone (reduction_tips.cpp).
class Reduction {
 public:
  Reduction(const UnitSkin& skin, const JointTree& joints, const JointWeights& weights, double h,
            const ReductionOptions& options, const std::vector<int>* mirror_joint)
      : skin_(skin),
        joints_(joints),
        weights_(weights),
        h_(h),
        options_(options),
        mirror_joint_(mirror_joint),
        n_(num_joints()) {
    for (double a : weights_.area) total_area_ += a;
  }

  ReducedSkeleton run();

 private:
  int num_joints() const { return static_cast<int>(joints_.parents.size()); }
  Eigen::Vector3d position(int joint) const { return joints_.positions.row(joint).transpose(); }
  Eigen::Vector3d start(const ReducedBone& b) const { return result_.nodes[b.start].position; }
  Eigen::Vector3d end(const ReducedBone& b) const { return result_.nodes[b.end].position; }
  double length(const ReducedBone& b) const { return (end(b) - start(b)).norm(); }
  Eigen::Vector3d direction(const ReducedBone& b) const { return (end(b) - start(b)).normalized(); }
  double h_at(const Eigen::Vector3d& p) const {
    return options_.sizes == nullptr ? h_ : options_.sizes->edge_at(p, h_);
  }
  double metres(double unit_length) const { return unit_length * skin_.scale; }
  void report(int joint, const char* what, std::string reason) {
    result_.changes.push_back({joints_.names[joint], what, std::move(reason)});
    changed_joints_.push_back(joint);
  }

  void prune();
  bool is_cut(int parent, int child, std::string& reason) const;
  void place_nodes();
  void chain_siblings();
  bool chain_one_pair();
  void chain(int shorter, int longer);
  bool lie_side_by_side(const ReducedBone& shorter, const ReducedBone& longer) const;
  void soften_close_bones();
  void soften_wanted_bones();
  void soften_bones_at_their_image();
  bool is_close_to_image(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const;
  void add_mirror_images();
  void soften(int bone, const std::string& reason);
  bool is_leaf(const ReducedBone& bone) const;
  void add_tips();
  bool add_tip(int joint, double smallest, const std::vector<double>& vertex_weight);
  Eigen::Vector3d soft_position(int joint, const std::vector<double>& vertex_weight) const;
  bool conflicts(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int node) const;
  void drop_unused_nodes();
  void name_bones();

  const UnitSkin& skin_;
  const JointTree& joints_;
  const JointWeights& weights_;
  double h_;
  ReductionOptions options_;
  const std::vector<int>* mirror_joint_;
  int n_;
  double total_area_ = 0.0;
  std::vector<bool> kept_;           ///< per joint.
  std::vector<int> node_of_;         ///< per joint; -1 where pruned.
  std::vector<int> changed_joints_;  ///< of result_.changes.
  ReducedSkeleton result_;
};

}  // namespace sinew::lattice::detail
