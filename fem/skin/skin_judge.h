#pragma once

#include <memory>
#include <vector>

#include "fem/skin/skin_verdict.h"
#include "lattice/points.h"

namespace sinew::fem {

/// A skin to be judged. Lengths in any one unit.
struct SkinJudgeInput {
  const lattice::Points& rest;          ///< num_vertices x 3.
  const lattice::Triangles& triangles;  ///< of all vertices, those that are not flesh too.
  /// num_vertices: true where flesh moves the vertex. Triangles without such a corner are not judged.
  const std::vector<bool>& flesh;
  /// Plain skinning at some instants, each num_vertices x 3; vertices that coincide at rest and in all of
  /// them are one. May be empty.
  const std::vector<lattice::Points>& plain;
  double height = 1.0;  ///< of the character; > 0.
};

/// Measures frames of flesh against plain skinning. What does not change is made once; a frame of ten
/// thousand triangles takes about two milliseconds on two cores. Same frames, same bits, for any number of
/// threads.
///
/// The local turn of the skin: the rotation nearest to sum_w (x_w - x_v)(y_w - y_v)^T over the neighbours w
/// of a vertex, smoothed over three rings. It is taken out before a triangle counts as flipped and before
/// Laplacians are compared, so that a tail that lags by a right angle is neither.
class SkinJudge {
 public:
  /// Throws std::invalid_argument where sizes do not fit, an index is out of range or the height is not
  /// positive.
  explicit SkinJudge(const SkinJudgeInput& input);
  ~SkinJudge();
  SkinJudge(SkinJudge&&) noexcept;
  SkinJudge& operator=(SkinJudge&&) noexcept;

  /// flesh and plain: num_vertices x 3, one instant. Throws std::invalid_argument where sizes do not fit.
  /// `kind` decides what counts as the worst place. Not for several threads at once: it keeps its buffers.
  SkinFrame measure(const lattice::Points& flesh, const lattice::Points& plain, FrameKind kind);

  int num_triangles() const;  ///< that are judged; 0: nothing is, and every frame is fine.

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::fem
