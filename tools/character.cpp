#include "tools/character.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "assets/error.h"
#include "assets/lattice_cache.h"
#include "assets/lattice_files.h"
#include "fem/default_material.h"
#include "tools/failure.h"
#include "tools/plain_character.h"
#include "tools/plain_loads.h"

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
  if (result.lattice.is_grid && !result.refused.empty())
    talk("warning: lattice: a plain grid of cubes with soft bones, as with bones on edges " +
         result.refused.front().failures.front().what);
}

/// Poses of the whole clip, `spacing` apart; enough to see every bend of a clip keyed at 24 to 60 Hz.
constexpr double kPoseSpacing = 1.0 / 30.0;
std::vector<std::vector<Eigen::Affine3d>> sample_poses(const Character& c) {
  std::vector<std::vector<Eigen::Affine3d>> poses;
  const double duration = std::min(c.the_clip().duration(), 3600.0);  // an hour shows what a clip does
  for (int k = 0; k * kPoseSpacing < duration; ++k)
    poses.push_back(c.pose(c.the_clip().start + k * kPoseSpacing));
  poses.push_back(c.pose(c.the_clip().end));
  return poses;
}

fem::DefaultMaterials default_materials(const Scene& scene, const Character& c) {
  // The sag rule speaks of the gravity that the flesh is built for: the Earth's where the scene has none.
  constexpr double kEarth = 9.81;
  const std::vector<std::vector<Eigen::Affine3d>> poses = sample_poses(c);
  return fem::default_materials({c.lattice.lattice, c.input.skin.surface, c.rig.skeleton, poses, kPoseSpacing,
                                 scene.density, scene.poisson,
                                 scene.gravity.norm() > 0.0 ? scene.gravity.norm() : kEarth});
}

/// The scene's materials: E by the scene or by default, then what the scene says of single bones.
void settle_materials(const Scene& scene, Character& c) {
  fem::BodyOptions& body = c.body_options;
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  if (!scene.plain) {
    const fem::DefaultMaterials defaults = default_materials(scene, c);
    c.limb_thickness = defaults.thickness;
    body.material = defaults.base;
    body.materials = defaults.of_joints;
  }
  if (scene.young) {
    body.material.young = *scene.young;
    body.materials.clear();
  }
  std::vector<std::string> names;
  for (const auto& bone : lattice.bones) names.push_back(bone.name);
  const std::vector<int> chosen = material_of_bone(scene, c.rig.file, names);
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    if (chosen[b] < 0) continue;
    const int joint = lattice.bones[b].frame;
    fem::Material material = body.material;
    for (const auto& of_joint : body.materials) {
      if (of_joint.joint == joint) material = of_joint.material;  // the last one counts
    }
    const BoneMaterial& m = scene.materials[static_cast<std::size_t>(chosen[b])];
    if (m.young) material.young = *m.young;
    if (m.poisson) material.poisson = *m.poisson;
    if (m.density) material.density = *m.density;
    body.materials.push_back({joint, material});
  }
}

}  // namespace

assets::ReadLatticeOptions read_options(const Scene& scene, const assets::Rig& rig) {
  assets::ReadLatticeOptions options;
  options.bones.snap_tolerance = scene.snap_tolerance;
  options.bones.soft_bones = scene.soft_bones;
  if (scene.lattice_space == OutputSpace::File) options.rig_from_file = rig.rig_from_file;
  return options;
}

std::vector<Eigen::Affine3d> Character::pose(double time) const {
  return skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, the_clip(), time));
}

lattice::BuildOptions build_options(const Scene& scene, const std::vector<std::string>& joints) {
  lattice::BuildOptions options;
  options.cells = scene.cells;
  options.cell_size = scene.cell_size;
  options.include = joints_of(scene.bones_include, joints, "bones_include");
  options.exclude = joints_of(scene.bones_exclude, joints, "bones_exclude");
  options.tip_bones = scene.tip_bones == Switch::On ? lattice::TipBones::On : lattice::TipBones::Off;
  options.symmetry = scene.symmetry == Switch::On ? lattice::Symmetry::Auto : lattice::Symmetry::Off;
  options.coarsen_rigid =
      scene.coarsen_rigid == Switch::On ? lattice::CoarsenRigid::On : lattice::CoarsenRigid::Off;
  std::map<int, double> factors;
  for (std::size_t i = 0; i < scene.sizes.size(); ++i)
    for (const int joint : joints_of(scene.sizes[i].bones, joints, fmt::format("size {}", i + 1)))
      factors[joint] = scene.sizes[i].factor;
  for (const auto& [joint, factor] : factors) options.size_factors.push_back({joint, factor});
  return options;
}

namespace {

void load_rig(const Scene& scene, const Talk& talk, Character& c) {
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
    const lattice::BuildOptions options = build_options(scene, c.input.joints.names);
    if (scene.lattice.empty()) {
      const std::string folder =
          scene.cache == Switch::Off || scene.output.empty() ? "" : assets::cache_folder(scene.output);
      assets::CachedBuild built =
          assets::build_lattice(folder, c.input.skin.surface, c.input.joints, options);
      if (built.use == assets::CacheUse::Hit) talk("lattice: nothing changed, taken from " + folder);
      if (built.use == assets::CacheUse::Built) c.new_lattice_key = built.key;
      c.lattice = std::move(built.result);
    } else {
      c.lattice.lattice = assets::read_lattice(scene.lattice, c.input, read_options(scene, c.rig));
      c.lattice.failures = lattice::check_gate(c.lattice.lattice, c.input.skin.surface, options);
    }
  }
  report_lattice(scene, c.lattice, talk);
}

/// What a model or a scene cannot do with what drives the flesh.
void warn_of_drive(const Scene& scene, const Talk& talk) {
  const PlainScene& plain = *scene.plain;
  const bool is_skin = !fem::find_model(scene.model)->dynamic;
  if (is_skin && (plain.is_loaded() || plain.velocity))
    talk("warning: model '" + scene.model + "' has no dynamics: loads and velocity do nothing");
  if (!plain.is_held() && scene.settle > 0.0) talk("nothing holds the flesh: it starts without settling");
  const bool turns = plain.velocity && !plain.velocity->spin.isZero(0.0);
  if (!plain.is_held() && turns && (scene.model == "blended" || scene.model == "blended-stiffness"))
    talk("warning: model '" + scene.model +
         "' is linear in the bones' frames and nothing turns with this flesh; hint: --model corotational");
}

void load_plain(const Scene& scene, const Talk& talk, Character& c) {
  warn_of_drive(scene, talk);
  const Phase phase(c.times, "lattice");
  PlainCharacter plain = make_plain_character(scene);
  c.rig = std::move(plain.rig);
  c.clip = 0;
  c.input = std::move(plain.input);
  c.lattice.lattice = std::move(plain.lattice);
  c.held = std::move(plain.held);
  c.bare_frames = std::move(plain.bare_frames);
}

}  // namespace

Character make_character(const Scene& scene, const Talk& talk) {
  Character c;
  if (scene.plain) {
    load_plain(scene, talk, c);
  } else {
    load_rig(scene, talk, c);
  }
  fem::BodyOptions& body = c.body_options;
  body.levels = scene.levels;
  body.material.poisson = scene.poisson;
  body.material.density = scene.density;
  body.damping = {scene.damping, scene.damping_frequency};
  settle_materials(scene, c);
  return c;
}

fem::Body make_body(const Character& character) {
  const std::vector<std::vector<Eigen::Affine3d>> poses = sample_poses(character);
  try {
    return fem::make_body({character.lattice.lattice, character.input.skin.surface, character.rig.skeleton,
                           poses, character.held, character.bare_frames},
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
  options.model = scene.model;
  options.solver.precision =
      scene.precision == Precision::Double ? fem::Precision::Double : fem::Precision::Float;
  // On uniform levels the hats of the finest level span the same space as the hierarchical basis with fewer
  // couplings: a step takes a sixth less. Local refinement will need the hierarchical one.
  options.solver.basis = fem::Basis::Nodal;
  options.gravity = scene.gravity;
  options.settle_limit = scene.settle;
  if (scene.plain) {
    options.loads = loads_of(*scene.plain);
    // Flesh that nothing holds would fall for as long as it may settle.
    if (!scene.plain->is_held()) options.settle_limit = 0.0;
  }
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
