#include "tools/session/lattice_settings.h"

#include <map>

#include <fmt/format.h>

namespace sinew::tools {

assets::ReadLatticeOptions read_options(const Scene& scene, const assets::Rig& rig) {
  assets::ReadLatticeOptions options;
  options.bones.snap_tolerance = scene.snap_tolerance;
  options.bones.soft_bones = scene.soft_bones;
  if (scene.lattice_space == OutputSpace::File) options.rig_from_file = rig.rig_from_file;
  return options;
}

lattice::BuildOptions build_options(const Scene& scene, const std::vector<std::string>& joints,
                                    const Caller& caller) {
  lattice::BuildOptions options;
  options.cells = scene.cells;
  options.cell_size = scene.cell_size;
  options.include = joints_of(scene.bones_include, joints, "bones_include");
  options.exclude = joints_of(scene.bones_exclude, joints, "bones_exclude");
  options.tip_bones = scene.tip_bones == Switch::On ? lattice::TipBones::On : lattice::TipBones::Off;
  options.symmetry = scene.symmetry == Switch::On ? lattice::Symmetry::Auto : lattice::Symmetry::Off;
  // Who asks for an edge gets that edge.
  const bool graded = scene.grade == Switch::On && !scene.cell_size;
  options.grade = graded ? lattice::Grade::On : lattice::Grade::Off;
  options.coarsen_rigid =
      scene.coarsen_rigid == Switch::On ? lattice::CoarsenRigid::On : lattice::CoarsenRigid::Off;
  std::map<int, double> factors;
  for (std::size_t i = 0; i < scene.sizes.size(); ++i)
    for (const int joint : joints_of(scene.sizes[i].bones, joints, fmt::format("size {}", i + 1)))
      factors[joint] = scene.sizes[i].factor;
  for (const auto& [joint, factor] : factors) options.size_factors.push_back({joint, factor});
  options.poll.ask = [&caller] { caller.stop_if_asked("while building the lattice"); };
  return options;
}

void hang_idle_sizes(const assets::LatticeInput& input, const Talk& talk, lattice::BuildOptions& options) {
  const lattice::JointTree& tree = input.joints;
  std::vector<bool> has_skin(tree.names.size(), false), sized(tree.names.size(), false);
  for (const auto& influences : input.skin.surface.weights) {
    for (const lattice::Influence& influence : influences)
      if (influence.weight > 0.0) has_skin[static_cast<std::size_t>(influence.frame)] = true;
  }
  for (const lattice::SizeFactor& size : options.size_factors)
    sized[static_cast<std::size_t>(size.joint)] = true;
  for (lattice::SizeFactor& size : options.size_factors) {
    int above = size.joint;
    while (above >= 0 && !has_skin[static_cast<std::size_t>(above)])
      above = tree.parents[static_cast<std::size_t>(above)];
    // What is left without skin is idle, and said to be.
    if (above < 0 || sized[static_cast<std::size_t>(above)]) continue;
    talk(fmt::format("[[size]]: no skin hangs on '{}'; cells are sized at '{}', on which it hangs",
                     tree.names[static_cast<std::size_t>(size.joint)],
                     tree.names[static_cast<std::size_t>(above)]));
    sized[static_cast<std::size_t>(above)] = true;
    size.joint = above;
  }
}

void warn_of_idle_sizes(const lattice::BuildResult& result, const std::vector<std::string>& joints,
                        const Talk& talk) {
  constexpr std::size_t kMostShown = 8;
  if (result.idle_sizes.empty()) return;
  if (result.lattice.is_grid) {
    talk("warning: [[size]]: does nothing, as all cells of a grid of cubes are of one size");
    return;
  }
  std::vector<std::string> shown;
  for (const int joint : result.idle_sizes) {
    if (shown.size() == kMostShown) break;
    shown.push_back("'" + joints[static_cast<std::size_t>(joint)] + "'");
  }
  const std::size_t more = result.idle_sizes.size() - shown.size();
  talk(fmt::format("warning: [[size]]: no skin hangs on {}{}, so that nothing is sized there",
                   fmt::join(shown, ", "), more == 0 ? "" : fmt::format(" and {} more", more)));
}

}  // namespace sinew::tools
