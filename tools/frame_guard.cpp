#include "tools/frame_guard.h"

namespace sinew::tools {

using lattice::Points;

namespace {

/// Action: (row of the rig's vertices, vertex of the welded skin).
template <class Action>
void each_flesh_vertex(const std::vector<int>& surface_of_vertex, const Action& action) {
  for (std::size_t i = 0; i < surface_of_vertex.size(); ++i)
    if (surface_of_vertex[i] >= 0) action(static_cast<Eigen::Index>(i), surface_of_vertex[i]);
}

}  // namespace

FrameGuard::FrameGuard(const Scene& scene, const Character& character) : skin_(&character.input.skin) {
  const lattice::Surface& surface = skin_->surface;
  if (scene.guard == Switch::On && !scene.plain) guard_.emplace(surface.points, surface.triangles);
}

fem::Mended FrameGuard::mend(const Points& skinned, Points& simulated) const {
  if (!guard_) return {};
  Points flesh(skin_->surface.points.rows(), 3), plain(flesh.rows(), 3);
  each_flesh_vertex(skin_->surface_of_vertex, [&](Eigen::Index row, int vertex) {
    flesh.row(vertex) = simulated.row(row);
    plain.row(vertex) = skinned.row(row);
  });
  const fem::Mended mended = guard_->mend(plain, flesh);
  if (mended.vertex >= 0) {
    each_flesh_vertex(skin_->surface_of_vertex,
                      [&](Eigen::Index row, int vertex) { simulated.row(row) = flesh.row(vertex); });
  }
  return mended;
}

}  // namespace sinew::tools
