#include "tools/character.h"

#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "assets/error.h"
#include "assets/lattice_files.h"
#include "tools/failure.h"

namespace sinew::tools {
namespace {

/// Adds the time since its construction to a list when it ends.
class Phase {
 public:
  Phase(PhaseTimes& times, std::string name) : times_(times), name_(std::move(name)), start_(Clock::now()) {}
  ~Phase() { times_.emplace_back(name_, std::chrono::duration<double>(Clock::now() - start_).count()); }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  PhaseTimes& times_;
  std::string name_;
  Clock::time_point start_;
};

void report_lattice(const Scene& scene, const lattice::BuildResult& result, const Talk& talk) {
  for (const lattice::GateFailure& failure : result.failures) {
    if (!failure.tolerable) {
      throw NumericalError(
          fmt::format("{}: the lattice cannot carry this character: {}; hint: other --cells, or a lattice of "
                      "your own with --lattice",
                      scene.rig, failure.what));
    }
    talk("warning: lattice: " + failure.what);
  }
}

/// The scene's materials per bone as materials per joint.
std::vector<fem::JointMaterial> joint_materials(const Scene& scene, const lattice::ControlLattice& lattice,
                                                const fem::Material& base) {
  std::vector<std::string> names;
  for (const auto& bone : lattice.bones) names.push_back(bone.name);
  const std::vector<int> chosen = material_of_bone(scene, scene.rig, names);
  std::vector<fem::JointMaterial> materials;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    if (chosen[b] < 0) continue;
    const BoneMaterial& m = scene.materials[static_cast<std::size_t>(chosen[b])];
    fem::Material material = base;
    // A material that names another nu keeps the base's shear modulus only if it names no E; E is what the
    // user sees.
    if (m.young) material.young = *m.young;
    if (m.poisson) material.poisson = *m.poisson;
    if (m.density) material.density = *m.density;
    materials.push_back({lattice.bones[b].frame, material});
  }
  return materials;
}

}  // namespace

std::vector<Eigen::Affine3d> Character::pose(double time) const {
  return skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, the_clip(), time));
}

Character make_character(const Scene& scene, const Talk& talk) {
  Character c;
  {
    const Phase phase(c.times, "load");
    assets::LoadOptions options;
    options.height = scene.height.value_or(0.0);
    c.rig = assets::load_rig(scene.rig, options);
    c.clip = assets::choose_clip(c.rig, scene.clip);
    c.input = assets::lattice_input(c.rig);
  }
  for (const assets::Finding& finding : c.rig.findings) {
    if (finding.severity == assets::Finding::Severity::Warning)
      talk(fmt::format("warning: {}{}{}", finding.where, finding.where.empty() ? "" : ": ", finding.message));
  }
  {
    const Phase phase(c.times, "lattice");
    lattice::BuildOptions options;
    options.cells = scene.cells;
    if (scene.lattice.empty()) {
      c.lattice = lattice::build(c.input.skin.surface, c.input.joints, options);
    } else {
      c.lattice.lattice = assets::read_lattice(scene.lattice, c.input);
      c.lattice.failures = lattice::check_gate(c.lattice.lattice, c.input.skin.surface, options);
    }
  }
  report_lattice(scene, c.lattice, talk);

  fem::BodyOptions& body = c.body_options;
  body.levels = scene.levels;
  body.material.poisson = scene.poisson;
  body.material.density = scene.density;
  body.damping = {scene.damping, scene.damping_frequency};
  c.limb_thickness = fem::limb_thickness(c.lattice.lattice, c.input.skin.surface, c.rig.skeleton);
  // The sag rule speaks of the gravity that the flesh is built for: the Earth's where the scene has none.
  constexpr double kEarth = 9.81;
  const double gravity = scene.gravity.norm() > 0.0 ? scene.gravity.norm() : kEarth;
  body.material.young = scene.young
                            ? *scene.young
                            : fem::default_young(c.limb_thickness, scene.density, scene.poisson, gravity);
  body.materials = joint_materials(scene, c.lattice.lattice, body.material);
  return c;
}

fem::Body make_body(const Character& character) {
  const skeleton::Clip& clip = character.the_clip();
  std::vector<std::vector<Eigen::Affine3d>> poses;
  constexpr double kEvery = 1.0 / 30.0;  // fine enough to see every bend of a clip keyed at 24 to 60 Hz
  const int count = static_cast<int>(std::min(clip.duration() / kEvery, 1e5)) + 1;
  for (int k = 0; k <= count; ++k) poses.push_back(character.pose(clip.start + clip.duration() * k / count));
  try {
    return fem::make_body(
        {character.lattice.lattice, character.input.skin.surface, character.rig.skeleton, poses},
        character.body_options);
  } catch (const std::invalid_argument& error) {
    throw assets::InputError(character.rig.file, error.what());
  }
}

fem::SimulationOptions simulation_options(const Scene& scene) {
  fem::SimulationOptions options;
  options.step = scene.step;
  options.integrator =
      scene.integrator == Integrator::Bdf2 ? fem::Integrator::Bdf2 : fem::Integrator::BackwardEuler;
  options.gravity = scene.gravity;
  options.settle_limit = scene.settle;
  return options;
}

FrameRange frame_range(const Scene& scene, const skeleton::Clip& clip) {
  if (scene.frames) return *scene.frames;
  constexpr double kMostFrames = 1e6;
  const double frames = std::floor(clip.duration() * scene.fps + 1e-6);  // rounding of keys stored as floats
  if (frames > kMostFrames) {
    throw assets::LimitError(
        fmt::format("clip '{}' has {} frames at {} fps, limit {}; hint: --frames A-B or a lower --fps",
                    clip.name, frames, scene.fps, kMostFrames));
  }
  return {0, static_cast<int>(frames)};
}

}  // namespace sinew::tools
