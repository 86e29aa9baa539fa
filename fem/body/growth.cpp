#include "fem/body/growth.h"

#include <algorithm>

namespace sinew::fem {
namespace {

Eigen::Matrix3d stretch_of(const FrameTransform& frame) {
  const Eigen::Matrix3d stretch = frame.rotation.transpose() * frame.from_rest.linear();
  return 0.5 * (stretch + stretch.transpose());
}

/// Y of bone vertices, one row each: the clip's place turned back with the bone's frame.
lattice::Points on_bones(const Body& body, const PosedFrames& posed, const Growth& g) {
  lattice::Points y(static_cast<Eigen::Index>(body.bones.vertices.size()), 3);
  for (Eigen::Index k = 0; k < y.rows(); ++k) {
    const BoneVertex& bone = body.bones.vertices[static_cast<std::size_t>(k)];
    const auto f = static_cast<std::size_t>(bone.frame);
    const Eigen::Vector3d origin = posed.frames[f].from_rest * body.tree.frames[f].origin_rest;
    const Eigen::Vector3d from_origin = bone_position(bone, posed.joints) - origin;
    y.row(k) = (g.origin[f] + posed.frames[f].rotation.transpose() * from_origin).transpose();
  }
  return y;
}

}  // namespace

bool scales_joints(const PosedFrames& posed) {
  constexpr double kRoundedOne = 1e-5;
  return std::any_of(posed.frames.begin(), posed.frames.end(), [](const FrameTransform& frame) {
    return (stretch_of(frame) - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > kRoundedOne;
  });
}

Growth growth(const Body& body, const PosedFrames& posed) {
  Growth g;
  std::vector<Eigen::Vector3d> place;  // c_f
  for (std::size_t f = 0; f < posed.frames.size(); ++f) {
    const Frame& frame = body.tree.frames[f];
    g.stretch.push_back(stretch_of(posed.frames[f]));
    place.push_back(posed.frames[f].from_rest * frame.origin_rest);
    const auto above = static_cast<std::size_t>(std::max(frame.parent, 0));  // the first frame is a root
    g.origin.push_back(f == 0 ? frame.origin_rest
                              : g.origin[above] +
                                    posed.frames[above].rotation.transpose() * (place[f] - place[above]));
  }
  g.shape = lattice::Points::Zero(body.mesh.num_vertices(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const Eigen::Vector3d point = body.mesh.points.row(a).transpose();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      const int f = static_cast<int>(it.col());
      sum += it.value() * g.of(f, body.tree.frames[static_cast<std::size_t>(f)], point);
    }
    g.shape.row(a) = sum.transpose();
  }
  const lattice::Points bones = on_bones(body, posed, g);
  lattice::Points missing = bones;
  for (Eigen::Index k = 0; k < bones.rows(); ++k)
    missing.row(k) -= g.shape.row(body.bones.vertices[static_cast<std::size_t>(k)].vertex);
  g.shape += body.bone_extension * missing;
  for (Eigen::Index k = 0; k < bones.rows(); ++k)  // exactly, and on finer levels too
    g.shape.row(body.bones.vertices[static_cast<std::size_t>(k)].vertex) = bones.row(k);
  return g;
}

lattice::Points grown_places(const Body& body, const PosedFrames& posed, const Growth& growth) {
  lattice::Points places = lattice::Points::Zero(body.mesh.num_vertices(), 3);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      const auto f = static_cast<std::size_t>(it.col());
      const Eigen::Vector3d origin = posed.frames[f].from_rest * body.tree.frames[f].origin_rest;
      const Eigen::Vector3d grown = growth.shape.row(a).transpose() - growth.origin[f];
      places.row(a) += it.value() * (origin + posed.frames[f].rotation * grown).transpose();
    }
  }
  return places;
}

namespace {

/// T_f moved to put the middle of the tie where the grown shape has it.
Eigen::Affine3d soft_frame_target(const Body& body, const Tie& tie, const PosedFrames& posed,
                                  const Growth& growth) {
  const auto f = static_cast<std::size_t>(tie.frame);
  Eigen::Vector3d rest = Eigen::Vector3d::Zero(), grown = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for (std::size_t k = 0; k < tie.vertices.size(); ++k) {
    rest += tie.zeroth[k] * body.mesh.points.row(tie.vertices[k]).transpose();
    grown += tie.zeroth[k] * growth.shape.row(tie.vertices[k]).transpose();
    weight += tie.zeroth[k];
  }
  Eigen::Affine3d target = posed.frames[f].from_rest;
  if (!(weight > 0.0)) return target;
  const Eigen::Vector3d origin = target * body.tree.frames[f].origin_rest;
  const Eigen::Vector3d middle = origin + posed.frames[f].rotation * (grown / weight - growth.origin[f]);
  target.pretranslate(middle - target * (rest / weight));
  return target;
}

}  // namespace

Eigen::Affine3d tie_target(const Body& body, const Tie& tie, const PosedFrames& posed, const Growth* growth) {
  Eigen::Affine3d target = posed.frames[static_cast<std::size_t>(tie.frame)].from_rest;
  if (growth == nullptr) return target;
  if (tie.bone < 0) return soft_frame_target(body, tie, posed, *growth);
  const auto& bone = body.lattice.bones[static_cast<std::size_t>(tie.bone)];
  const auto place = [&](const lattice::BoneAnchor& anchor, double s) -> Eigen::Vector3d {
    return (1.0 - s) * (posed.joints[static_cast<std::size_t>(anchor.joint_a)] * anchor.x_a) +
           s * (posed.joints[static_cast<std::size_t>(anchor.joint_b)] * anchor.x_b);
  };
  const Eigen::Vector3d span = bone.rest_end - bone.rest_start;
  if (!(span.squaredNorm() > 0.0)) return target;
  const Eigen::Vector3d start = place(bone.start, 0.0), end = place(bone.end, 1.0);
  const Eigen::Vector3d missing = end - start - target.linear() * span;
  target.linear() += missing * span.transpose() / span.squaredNorm();
  target.translation() = start - target.linear() * bone.rest_start;
  return target;
}

}  // namespace sinew::fem
