#include "tools/session/offset_flesh.h"

#include <fmt/format.h>

#include "tools/support/errors.h"

namespace sinew::tools {

OffsetFlesh::OffsetFlesh(double share, const Character& character, const fem::Simulation& simulation,
                         const fem::SimulationOptions& options)
    : share_(share),
      character_(character),
      simulation_(simulation),
      rest_(simulation.body(), options,
            fem::pose_frames(simulation.body().tree, character.pose(simulation.flesh().time),
                             simulation.flesh().time),
            simulation.flesh().x),
      last_(simulation.flesh().time - options.step) {}

void OffsetFlesh::apply(double time, const std::vector<Eigen::Affine3d>& pose, const lattice::Points& skinned,
                        lattice::Points& simulated) {
  const fem::SolveReport report =
      rest_.follow(fem::pose_frames(simulation_.body().tree, pose, time), time - last_);
  if (!report.ok())
    throw NumericalError(fmt::format("{}: offset: the rest of the flesh at {:.6g} s: {}", character_.rig.file,
                                     time, report.message));
  last_ = time;
  const lattice::Points rest = simulation_.skin_of(rest_.positions());
  const std::vector<int>& map = character_.input.skin.surface_of_vertex;
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (map[i] < 0) continue;
    const auto row = static_cast<Eigen::Index>(i);
    simulated.row(row) = skinned.row(row) + share_ * (simulated.row(row) - rest.row(map[i]));
  }
}

}  // namespace sinew::tools
