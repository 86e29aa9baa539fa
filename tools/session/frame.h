#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fem/report/measures.h"
#include "fem/skin/skin_guard.h"
#include "fem/skin/skin_judge.h"
#include "lattice/points.h"

/// One output frame of a run, and those who take frames.
namespace sinew::tools {

/// What is known of one output frame.
struct FrameReport {
  int frame = 0;
  double time = 0.0;  ///< of the clip [s].
  int steps = 0;      ///< taken since the frame before.
  fem::Measures measures;
  fem::Mended mended;                  ///< of the skin; lengths [m].
  std::optional<fem::SkinFrame> skin;  ///< empty for a plain scene, which nobody skins.
};

/// A finished frame. Positions are those of all vertices of the rig, part by part
/// (tools/session/whole_skin.h), num_vertices x 3 in the rig's space (SI, Y up).
struct Frame {
  FrameReport report;
  lattice::Points positions;          ///< flesh, mended; props where they ride; all else skinned [m].
  lattice::Points skinned;            ///< plain skinning of the same pose [m].
  std::vector<Eigen::Affine3d> pose;  ///< pose_from_rest of every joint.
};

/// Is given every frame of a run, in order and once.
class FrameSink {
 public:
  virtual ~FrameSink() = default;

  /// `frame` lives as long as the call.
  virtual void take(const Frame& frame) = 0;
  /// After the last frame of a run that went well.
  virtual void finish() {}
};

}  // namespace sinew::tools
