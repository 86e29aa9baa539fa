#include "fem/body/placement.h"

#include <algorithm>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace sinew::fem {

using lattice::Points;

Points skinned_frames(const Body& body, const PosedFrames& posed) {
  Points x = Points::Zero(body.mesh.num_vertices(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      sum += it.value() * (posed.frames[static_cast<std::size_t>(it.col())].from_rest *
                           body.mesh.points.row(a).transpose());
    }
    x.row(a) = sum.transpose();
  }
  return x;
}

Points carried(const Body& body, const Points& x, const PosedFrames& from, const PosedFrames& to) {
  std::vector<Eigen::Affine3d> map;
  for (std::size_t f = 0; f < body.tree.frames.size(); ++f)
    map.push_back(to.frames[f].from_rest * from.frames[f].to_rest);
  Points moved(x.rows(), 3);
  tbb::parallel_for(
      tbb::blocked_range<int>(0, body.mesh.num_vertices(), 128), [&](const tbb::blocked_range<int>& range) {
        for (int a = range.begin(); a != range.end(); ++a) {
          Eigen::Vector3d sum = Eigen::Vector3d::Zero();
          for (FrameWeights::InnerIterator it(body.weights, a); it; ++it)
            sum += it.value() * (map[static_cast<std::size_t>(it.col())] * x.row(a).transpose());
          moved.row(a) = sum.transpose();
        }
      });
  return moved;
}

Points turned(const Body& body, const Points& v, const PosedFrames& from, const PosedFrames& to) {
  Points result = Points::Zero(v.rows(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      result.row(a) += it.value() * v.row(a) * from.frames[f].rotation * to.frames[f].rotation.transpose();
    }
  }
  return result;
}

void place_bones(const Body& body, const PosedFrames& posed, Points& x) {
  for (const BoneVertex& bone : body.bones.vertices)
    x.row(bone.vertex) = bone_position(bone, posed.joints).transpose();
}

void fill_inactive_leaves(const Body& body, Points& x) {
  if (body.mesh.num_functions() == body.mesh.num_vertices()) return;
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const int vertex = body.mesh.vertices[static_cast<std::size_t>(a)];
    if (body.hierarchy.level(vertex) == 0 || body.bones.is_bone[static_cast<std::size_t>(a)]) continue;
    if (std::binary_search(body.mesh.functions.begin(), body.mesh.functions.end(), vertex)) continue;
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    const auto parents = body.hierarchy.parents(vertex);
    for (int p : parents) mean += x.row(body.mesh.leaf_of_vertex[static_cast<std::size_t>(p)]);
    x.row(a) = mean / static_cast<double>(parents.size());
  }
}

Points skinned_positions(const Body& body, const PosedFrames& posed) {
  Points x = skinned_frames(body, posed);
  place_bones(body, posed, x);
  fill_inactive_leaves(body, x);
  return x;
}

}  // namespace sinew::fem
