#include "lattice/detail/finish.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/inspection.h"
#include "lattice/limb_copies.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

constexpr double kInsideSlack = 1e-9;  ///< rounding of the containment test, a share of the cell.

/// Rest position of a node: bit for bit the joint's where it is one.
Vector3d rest_position(const RigInput& input, const SkeletonNode& node) {
  // Joints of a mirrored rig may have moved a little, and their bones with them.
  const Vector3d joint = input.joints.positions.row(node.joint).transpose();
  const bool at_joint = node.position == Vector3d(input.unit_joints.positions.row(node.joint).transpose()) &&
                        node.position == input.unit_skin.to_unit(joint);
  return at_joint ? Vector3d(input.joints.positions.row(node.joint).transpose())
                  : input.unit_skin.to_rest(node.position);
}

Vector3d cell_mean(const CellComplex& complex, const Cell& cell) {
  Vector3d mean = Vector3d::Zero();
  const int n = num_corners(cell.type);
  for (int k = 0; k < n; ++k) mean += complex.points.row(cell.vertices[k]).transpose() / n;
  return mean;
}

/// Per floating component: the weight of every joint in it, and the mean of its skin vertices.
struct FloatingSkin {
  std::vector<double> weight;
  Vector3d sum{0, 0, 0};
  double count = 0.0;
};

std::vector<FloatingSkin> skin_of_components(const RigInput& input, const ControlLattice& lattice,
                                             const CellLocator& locator, const std::vector<int>& component_of,
                                             std::size_t num_components) {
  const LimbCopies copies(lattice);
  std::vector<FloatingSkin> parts(num_components);
  for (FloatingSkin& part : parts) part.weight.assign(input.joints.parents.size(), 0.0);
  // The welded skin: its order, and so the order of the sums, does not depend on the input's.
  const UnitSkin& skin = input.unit_skin;
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const Vector3d p = skin.to_rest(skin.points.row(static_cast<Eigen::Index>(v)).transpose());
    int cell = locator.find(p, kInsideSlack);
    if (cell >= 0) cell = copies.own_copy(cell, skin_frame(skin.weights[v], lattice.frame_of_joint), p);
    if (cell < 0 || component_of[cell] < 0) continue;
    FloatingSkin& part = parts[component_of[cell]];
    for (const Influence& influence : skin.weights[v])
      part.weight[input.stand_in[influence.frame]] += influence.weight;
    part.sum += p;
    part.count += 1.0;
  }
  return parts;
}

std::vector<int> frames_of(const ControlLattice& lattice) {
  std::vector<int> frames;
  for (const LatticeBone& bone : lattice.bones) frames.push_back(bone.frame);
  for (const SoftFrame& frame : lattice.soft_frames) frames.push_back(frame.frame);
  return frames;
}

/// Ties every component without a bone to the joint that moves most of its skin; whether there was one.
bool tie_floating_components(const RigInput& input, ControlLattice& lattice) {
  const std::vector<std::vector<int>> floating = floating_components(lattice);
  if (floating.empty()) return false;
  std::vector<int> component_of(lattice.complex.cells.size(), -1);
  for (std::size_t i = 0; i < floating.size(); ++i)
    for (int c : floating[i]) component_of[c] = static_cast<int>(i);
  const CellLocator locator(lattice.complex);
  const std::vector<FloatingSkin> parts =
      skin_of_components(input, lattice, locator, component_of, floating.size());
  for (std::size_t i = 0; i < floating.size(); ++i) {
    const auto heaviest = std::max_element(parts[i].weight.begin(), parts[i].weight.end());
    if (!(*heaviest > 0.0)) continue;  // the gate reports it
    SoftFrame frame;
    frame.frame = static_cast<int>(heaviest - parts[i].weight.begin());
    // A place inside the component: the mean of its skin, else of its first cell.
    frame.position = parts[i].sum / parts[i].count;
    const int cell = locator.find(frame.position, kInsideSlack);
    if (cell < 0 || component_of[cell] != static_cast<int>(i))
      frame.position = cell_mean(lattice.complex, lattice.complex.cells[floating[i][0]]);
    lattice.soft_frames.push_back(frame);
    lattice.changes.push_back(
        {input.joints.names[frame.frame], "soft frame",
         fmt::format("holds a separate part of {} cells that no bone reaches", floating[i].size())});
  }
  return true;
}

}  // namespace

std::vector<LatticeBone> lattice_bones(const RigInput& input, const ReducedSkeleton& skeleton) {
  std::vector<LatticeBone> bones;
  for (const ReducedBone& reduced : skeleton.bones) {
    const SkeletonNode &from = skeleton.nodes[reduced.start], &to = skeleton.nodes[reduced.end];
    LatticeBone bone;
    bone.name = reduced.name;
    bone.frame = reduced.frame;
    bone.soft = reduced.soft;
    bone.tip = reduced.tip;
    bone.rest_start = rest_position(input, from);
    bone.rest_end = rest_position(input, to);
    bone.start = {from.joint, from.joint, bone.rest_start, bone.rest_start};
    bone.end = {to.joint, to.joint, bone.rest_end, bone.rest_end};
    bones.push_back(std::move(bone));
  }
  return bones;
}

void place_chains(ControlLattice& lattice, const std::vector<std::vector<double>>& parameters) {
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    const LatticeBone& bone = lattice.bones[b];
    for (std::size_t i = 0; i < bone.chain.size(); ++i) {
      const double s = parameters[b][i];
      const Vector3d p = i == 0 ? bone.rest_start
                         : i + 1 == bone.chain.size()
                             ? bone.rest_end
                             : Vector3d((1.0 - s) * bone.rest_start + s * bone.rest_end);
      lattice.complex.points.row(bone.chain[i]) = p.transpose();
    }
  }
}

void hang_joints(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice,
                 FloatingParts floating) {
  lattice.soft_frames = skeleton.soft_frames;
  for (SoftFrame& frame : lattice.soft_frames) frame.position = input.unit_skin.to_rest(frame.position);
  lattice.frame_of_joint = frame_of_joint(input.joints.parents, frames_of(lattice));
  if (floating == FloatingParts::Leave || !tie_floating_components(input, lattice)) return;
  const std::vector<int> before = lattice.frame_of_joint;
  lattice.frame_of_joint = frame_of_joint(input.joints.parents, frames_of(lattice));
  // A copy keeps the skin that counts for a new frame now.
  for (CellCopy& copy : lattice.copies) {
    std::set<int> frames(copy.frames.begin(), copy.frames.end());
    for (std::size_t j = 0; j < before.size(); ++j)
      if (std::binary_search(copy.frames.begin(), copy.frames.end(), before[j]))
        frames.insert(lattice.frame_of_joint[j]);
    copy.frames.assign(frames.begin(), frames.end());
  }
}

}  // namespace sinew::lattice::detail
