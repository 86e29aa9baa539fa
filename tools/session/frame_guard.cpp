#include "tools/session/frame_guard.h"

#include <algorithm>
#include <cmath>

namespace sinew::tools {

using lattice::Points;

namespace {

/// Weights rise and fall over this time on either side of a frame [s]: three frames of 30 a second. At 240
/// frames a second guarded skin jerks at most 1.7 times as much as the flesh itself then; laid back frame by
/// frame ten times.
constexpr double kSteadyTime = 0.1;

/// At most so many frames: what is looked at at once is kept in memory.
constexpr int kMostFrames = 24;

/// Action: (row of the rig's vertices, vertex of the welded skin).
template <class Action>
void each_flesh_vertex(const assets::PhysicsSkin& skin, const Action& action) {
  for (std::size_t i = 0; i < skin.surface_of_vertex.size(); ++i)
    if (skin.surface_of_vertex[i] >= 0) action(static_cast<Eigen::Index>(i), skin.surface_of_vertex[i]);
}

Points welded(const assets::PhysicsSkin& skin, const Points& of_rig) {
  Points result(skin.surface.points.rows(), 3);
  each_flesh_vertex(skin, [&](Eigen::Index row, int vertex) { result.row(vertex) = of_rig.row(row); });
  return result;
}

void put_back(const assets::PhysicsSkin& skin, const Points& flesh, Points& of_rig) {
  each_flesh_vertex(skin, [&](Eigen::Index row, int vertex) { of_rig.row(row) = flesh.row(vertex); });
}

}  // namespace

FrameGuard::FrameGuard(const Scene& scene, const Character& character, double fps)
    : skin_(&character.input.skin) {
  if (scene.guard != Switch::On || scene.plain) return;
  guard_ = std::make_unique<const fem::SkinGuard>(skin_->surface.points, skin_->surface.triangles);
  const int reach = static_cast<int>(std::min<double>(std::round(kSteadyTime * fps), kMostFrames));
  steady_ = std::make_unique<fem::SteadyGuard>(*guard_, reach);
}

void FrameGuard::see(const Points& skinned, const Points& simulated) {
  if (steady_) steady_->see(welded(*skin_, skinned), welded(*skin_, simulated));
}

fem::Mended FrameGuard::mend_next(Points& simulated) {
  if (!steady_) return {};
  Points flesh;
  const fem::Mended mended = steady_->mend_next(flesh);
  if (mended.vertex >= 0) put_back(*skin_, flesh, simulated);
  return mended;
}

fem::Mended FrameGuard::mend(const Points& skinned, Points& simulated) const {
  if (!guard_) return {};
  Points flesh = welded(*skin_, simulated);
  const fem::Mended mended = guard_->mend(welded(*skin_, skinned), flesh);
  if (mended.vertex >= 0) put_back(*skin_, flesh, simulated);
  return mended;
}

}  // namespace sinew::tools
