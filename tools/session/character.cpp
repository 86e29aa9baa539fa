#include "tools/session/character.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>

#include "assets/collapse.h"
#include "assets/error.h"
#include "assets/lattice_cache.h"
#include "assets/lattice_files.h"
#include "fem/material/default_material.h"
#include "lattice/mirror_map.h"
#include "tools/session/lattice_memory.h"
#include "tools/session/plain_character.h"
#include "tools/session/plain_loads.h"
#include "tools/session/roles.h"
#include "tools/session/thin_limbs.h"
#include "tools/support/failure.h"
#include "tools/support/interrupt.h"
#include "tools/support/suggest.h"

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

void report_lattice(const Scene& scene, const lattice::BuildResult& result, const assets::LatticeInput& input,
                    const Talk& talk) {
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
  if (const auto thin = find_thin_limb(result.lattice, input.skin.surface, input.joints.names))
    talk(fmt::format("warning: lattice: {}; hint: {}", thin->message(),
                     scene.lattice.empty() ? thin->remedy() : "a lattice with smaller cells there"));
}

/// Poses of the whole clip, `spacing` apart; enough to see every bend of a clip keyed at 24 to 60 Hz.
constexpr double kPoseSpacing = 1.0 / 30.0;
std::vector<std::vector<Eigen::Affine3d>> sample_poses(const Character& c) {
  std::vector<std::vector<Eigen::Affine3d>> poses;
  if (c.clip < 0) {
    poses.emplace_back(static_cast<std::size_t>(c.rig.skeleton.num_joints()), Eigen::Affine3d::Identity());
    return poses;
  }
  const double duration = std::min(c.the_clip().duration(), 3600.0);  // an hour shows what a clip does
  // What is scaled to nothing tells nothing about how the flesh bends; the frames before and after it do.
  const double start = c.the_clip().start;
  const bool whole = !assets::first_collapse(c.rig, c.the_clip(), start, c.the_clip().end);
  const auto add = [&](double time) {
    if (whole || !assets::first_collapse(c.rig, c.the_clip(), time, time)) poses.push_back(c.pose(time));
  };
  for (int k = 0; k * kPoseSpacing < duration; ++k) add(start + k * kPoseSpacing);
  add(c.the_clip().end);
  if (poses.empty())
    poses.emplace_back(static_cast<std::size_t>(c.rig.skeleton.num_joints()), Eigen::Affine3d::Identity());
  return poses;
}

fem::DefaultMaterials default_materials(const Scene& scene, const Character& c) {
  // The sag rule speaks of the gravity that the flesh is built for: the Earth's where the scene has none.
  constexpr double kEarth = 9.81;
  const std::vector<std::vector<Eigen::Affine3d>> poses = sample_poses(c);
  const lattice::Points& skin = c.input.skin.surface.points;
  fem::DefaultMaterialInput input{c.input.skin.surface, c.rig.skeleton, poses};
  input.spacing = kPoseSpacing;
  if (const auto mirror = lattice::find_mirror_map(c.lattice.lattice, c.input.skin.surface))
    input.partners = mirror->frames;
  input.size = (skin.colwise().maxCoeff() - skin.colwise().minCoeff()).maxCoeff();
  input.density = scene.density;
  input.poisson = scene.poisson;
  input.gravity = scene.gravity.norm() > 0.0 ? scene.gravity.norm() : kEarth;
  return fem::default_materials(input);
}

/// The material of a joint's flesh so far.
fem::Material material_of(const fem::BodyOptions& body, int joint) {
  fem::Material material = body.material;
  for (const fem::JointMaterial& of_joint : body.materials)
    if (of_joint.joint == joint) material = of_joint.material;  // the last one counts
  return material;
}

/// A pull must reach some flesh, and soft bones are held by nothing else.
void check_pull(const Character& c, const lattice::LatticeBone& bone, const BoneMaterial& material,
                const std::string& where) {
  const double least = fem::smallest_radius(bone, c.lattice.lattice.edge_length);
  if (material.radius && *material.radius < least) {
    throw assets::ConfigError(
        fmt::format("{}: radius: got {}, expected at least {:.3g} m, a quarter of the lattice's edge, at "
                    "bone '{}'; hint: more cells",
                    where, *material.radius, least, bone.name));
  }
  if (bone.soft && material.stiffness && !(*material.stiffness > 0.0)) {
    throw assets::ConfigError(fmt::format(
        "{}: stiffness: got 0, expected more as bone '{}' is soft and held by it alone", where, bone.name));
  }
}

/// The joints of one named region: every bone but the topmost hangs on another one of it.
void add_group(const Character& c, const std::vector<int>& bones, const std::string& where,
               std::vector<std::vector<int>>& groups) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  const fem::FrameTree tree = fem::frame_tree(lattice, c.rig.skeleton);
  std::set<int> frames;
  for (const int b : bones)
    frames.insert(
        tree.frame_of_joint[static_cast<std::size_t>(lattice.bones[static_cast<std::size_t>(b)].frame)]);
  std::vector<int> joints;
  for (const int f : frames) {
    const fem::Frame& frame = tree.frames[static_cast<std::size_t>(f)];
    joints.push_back(frame.joint);
    if (f != *frames.begin() && !frames.contains(frame.parent)) {
      throw assets::ConfigError(fmt::format(
          "{}: region: bone '{}' hangs on none of the others, expected bones that hang together; hint: "
          "regions of their own",
          where, frame.name));
    }
  }
  for (std::vector<int>& group : groups)
    std::erase_if(group,
                  [&](int joint) { return std::find(joints.begin(), joints.end(), joint) != joints.end(); });
  groups.push_back(joints);
}

/// Joints that own no bone, with the bones of the frame that their flesh follows.
std::vector<MergedJoint> merged_joints(const Character& c) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::map<int, std::vector<int>> bones_of_frame;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b)
    bones_of_frame[lattice.bones[b].frame].push_back(static_cast<int>(b));
  std::vector<MergedJoint> merged;
  for (std::size_t j = 0; j < lattice.frame_of_joint.size(); ++j) {
    const int frame = lattice.frame_of_joint[j];
    if (frame == static_cast<int>(j) || !bones_of_frame.contains(frame)) continue;
    merged.push_back({c.rig.skeleton.joint(static_cast<int>(j)).name, c.rig.skeleton.joint(frame).name,
                      bones_of_frame[frame]});
  }
  return merged;
}

/// What the scene says of single bones, one material after the other.
void paint_bones(const Scene& scene, const Talk& talk, Character& c) {
  fem::BodyOptions& body = c.body_options;
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::vector<std::string> names;
  for (const auto& bone : lattice.bones) names.push_back(bone.name);
  const std::vector<std::vector<int>> bones =
      bones_of_materials(scene, c.rig.file, names, merged_joints(c), talk);
  std::map<std::string, std::vector<int>> of_region;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const BoneMaterial& m = scene.materials[i];
    const std::string where = fmt::format("material {}", i + 1);
    for (const int b : bones[i]) {
      const lattice::LatticeBone& bone = lattice.bones[static_cast<std::size_t>(b)];
      check_pull(c, bone, m, where);
      const fem::RegionMaterial own{0, m.young, m.poisson, m.density};
      body.materials.push_back({bone.frame, own.applied_to(material_of(body, bone.frame))});
      if (!m.radius && !m.stiffness) continue;
      fem::JointTie tie;
      for (const fem::JointTie& earlier : body.ties.joints)
        if (earlier.joint == bone.frame) tie = earlier;
      tie.joint = bone.frame;
      if (m.radius) tie.radius = m.radius;
      if (m.stiffness) tie.stiffness = m.stiffness;
      body.ties.joints.push_back(tie);
    }
    if (m.region.empty()) continue;
    // Bones that several materials put into one region belong together.
    std::vector<int>& all = of_region[m.region];
    all.insert(all.end(), bones[i].begin(), bones[i].end());
    add_group(c, all, where, body.regions.groups);
  }
}

/// What the scene says of regions of the user's lattice.
void paint_regions(const Scene& scene, Character& c) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::map<std::string, int> numbers;
  for (const int region : lattice.regions) numbers[std::to_string(region)] = region;
  for (const lattice::RegionName& region : lattice.region_names) numbers[region.name] = region.number;
  std::vector<std::string> names;
  for (const auto& [name, number] : numbers) names.push_back(name);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const BoneMaterial& m = scene.materials[i];
    for (const std::string& region : m.regions) {
      const auto found = numbers.find(region);
      if (found == numbers.end()) {
        const std::string guess = nearest(region, names);
        throw assets::InputError(
            scene.lattice,
            fmt::format("material {}: no region is named '{}', expected one of {}{}", i + 1, region,
                        names.empty() ? "none, as the file has no regions"
                                      : fmt::format("{}", fmt::join(names, ", ")),
                        guess.empty() ? "" : fmt::format("; hint: did you mean {}?", guess)));
      }
      c.body_options.region_materials.push_back({found->second, m.young, m.poisson, m.density});
    }
  }
}

/// The scene's materials: E by the scene or by default, then what the scene says of single bones.
void settle_materials(const Scene& scene, const Talk& talk, Character& c) {
  fem::BodyOptions& body = c.body_options;
  if (!scene.plain) {
    const fem::DefaultMaterials defaults = default_materials(scene, c);
    c.limb_thickness = defaults.thickness;
    body.material = defaults.base;
    c.swing = defaults.frequency;
    // Of joints that the lattice made one the stiffest counts.
    std::map<int, double> of_frames;
    for (const fem::JointYoung& joint : defaults.of_joints) {
      const int merged = c.lattice.lattice.frame_of_joint[static_cast<std::size_t>(joint.joint)];
      double& young = of_frames[merged >= 0 ? merged : joint.joint];
      young = std::max(young, joint.young);
    }
    for (const auto& [joint, young] : of_frames)
      body.materials.push_back({joint, {young, body.material.poisson, body.material.density}});
  }
  if (scene.young) {
    body.material.young = *scene.young;
    body.materials.clear();
  }
  paint_bones(scene, talk, c);
  paint_regions(scene, c);
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
  options.poll.ask = [] { stop_if_interrupted("while building the lattice"); };
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

namespace {

void load_rig(const Scene& scene, const Talk& talk, Character& c) {
  {
    const Phase phase(c.times, "load");
    assets::LoadOptions options;
    options.height = scene.height.value_or(0.0);
    c.rig = assets::load_rig(scene.rig, options);
    c.clip = assets::choose_clip(c.rig, scene.clip);
    settle_roles(scene, c.rig, talk);
    c.input = assets::lattice_input(c.rig);
  }
  for (const assets::Finding& finding : c.rig.findings) {
    if (finding.severity == assets::Finding::Severity::Warning)
      talk(fmt::format("warning: {}{}{}", finding.where, finding.where.empty() ? "" : ": ", finding.message));
  }
  {
    const Phase phase(c.times, "lattice");
    lattice::BuildOptions options = build_options(scene, c.input.joints.names);
    hang_idle_sizes(c.input, talk, options);
    if (scene.lattice.empty()) {
      check_lattice_memory(scene, c.input.skin.surface);
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
  report_lattice(scene, c.lattice, c.input, talk);
  warn_of_idle_sizes(c.lattice, c.input.joints.names, talk);
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

void warn_of_precision(const Scene& scene, const Talk& talk) {
  if (scene.precision && !fem::find_model(scene.model)->keeps_factors)
    talk("warning: precision: does nothing, as model '" + scene.model + "' keeps no factors");
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
  warn_of_precision(scene, talk);
  if (scene.plain) {
    load_plain(scene, talk, c);
  } else {
    load_rig(scene, talk, c);
  }
  settle_flesh(scene, c, talk);
  return c;
}

void settle_flesh(const Scene& scene, Character& c, const Talk& talk) {
  fem::BodyOptions& body = c.body_options;
  body.levels = scene.levels;
  body.material.poisson = scene.poisson;
  body.material.density = scene.density;
  body.damping = {scene.damping, scene.damping_frequency};
  settle_materials(scene, talk, c);
}

namespace {

template <class Make>
fem::Body body_by(const Make& make, const Character& character, const fem::BodyOptions& options) {
  const std::vector<std::vector<Eigen::Affine3d>> poses = sample_poses(character);
  try {
    return make({character.lattice.lattice, character.input.skin.surface, character.rig.skeleton, poses,
                 character.held, character.bare_frames},
                options);
  } catch (const std::invalid_argument& error) {
    throw assets::InputError(character.rig.file, error.what());
  }
}

}  // namespace

fem::Body make_body(const Character& character) {
  return body_by(fem::make_body, character, character.body_options);
}

fem::Body paint_body(const Character& character) {
  fem::BodyOptions options = character.body_options;
  if (character.clip < 0) {
    // Nobody knows how the frames turn: each that the scene does not group has a region of its own.
    std::set<int> grouped;
    for (const std::vector<int>& group : options.regions.groups) grouped.insert(group.begin(), group.end());
    for (const fem::Frame& frame : fem::frame_tree(character.lattice.lattice, character.rig.skeleton).frames)
      if (!grouped.contains(frame.joint)) options.regions.groups.push_back({frame.joint});
  }
  return body_by(fem::paint_body, character, options);
}

fem::SimulationOptions simulation_options(const Scene& scene) {
  fem::SimulationOptions options;
  options.step = scene.step;
  options.integrator = scene.integrator;
  options.model = scene.model;
  options.solver.precision = scene.precision;
  options.gravity = scene.gravity;
  options.settle_limit = scene.settle;
  if (scene.plain) {
    options.loads = loads_of(*scene.plain);
    // Flesh that nothing holds would fall for as long as it may settle.
    if (!scene.plain->is_held()) options.settle_limit = 0.0;
  }
  return options;
}

fem::SimulationOptions simulation_options(const Scene& scene, const Character& character,
                                          const fem::Body& body) {
  fem::SimulationOptions options = simulation_options(scene);
  const fem::Motion motion = [&](double time) { return character.pose(time); };
  const double t0 = character.the_clip().start;
  const std::vector<double> keys = skeleton::key_times(character.the_clip());
  options.key_interval = skeleton::key_interval(character.the_clip());
  for (const int frame : scene.cuts)
    options.cuts.push_back(
        fem::stated_cut(body.tree, motion, keys, t0 + (frame - 1) / scene.fps, t0 + frame / scene.fps));
  for (const fem::Cut& found : fem::find_cuts(body.tree, body.size, motion, keys)) {
    if (!fem::touches_cut(options.cuts, found.begin, found.end)) options.cuts.push_back(found);
  }
  return options;
}

void say_cuts(const Scene& scene, const Character& character, const std::vector<fem::Cut>& cuts,
              const FrameRange& frames, const Talk& talk) {
  const double t0 = character.the_clip().start;
  for (const int frame : scene.cuts) {
    if (frame <= frames.first || frame > frames.last)
      talk(fmt::format("warning: cuts: there is no way to frame {} within frames {} to {}, so nothing is cut",
                       frame, frames.first, frames.last));
  }
  for (const fem::Cut& cut : cuts) {
    const double begin = (cut.begin - t0) * scene.fps, end = (cut.end - t0) * scene.fps;
    if (end <= frames.first || begin >= frames.last) continue;
    talk(
        fmt::format("cut to frame {:.0f} ({}): the character jumps {:.3g} m from {:.4g} to {:.4g} s, and its "
                    "flesh goes along",
                    std::ceil(end - 1e-4), cut.stated ? "stated" : "found", cut.way, cut.begin, cut.end));
  }
}

FrameRange frame_range(const Scene& scene, const Character& character, const Talk& talk) {
  const skeleton::Clip& clip = character.the_clip();
  FrameRange range{0, 0};
  if (scene.frames) {
    range = *scene.frames;
  } else {
    constexpr double kMostFrames = 1e6;
    const double frames =
        std::floor(clip.duration() * scene.fps + 1e-6);  // rounding of keys stored as floats
    if (frames > kMostFrames) {
      throw assets::LimitError(
          fmt::format("clip '{}' has {} frames at {} fps, limit {}; hint: --frames A-B or a lower --fps",
                      clip.name, frames, scene.fps, kMostFrames));
    }
    range.last = static_cast<int>(frames);
  }
  const auto time_of = [&](int frame) { return clip.start + frame / scene.fps; };
  const auto collapse =
      assets::first_collapse(character.rig, clip, time_of(range.first), time_of(range.last));
  if (!collapse) return range;
  const std::string what =
      fmt::format("clip '{}': {}", clip.name, assets::collapse_text(character.rig, *collapse));
  // The last frame that lies before it.
  const int last = static_cast<int>(std::ceil((collapse->time - clip.start) * scene.fps - 1e-6)) - 1;
  if (scene.frames || last < range.first) {
    throw assets::InputError(
        character.rig.file,
        fmt::format("{}, expected flesh with a volume in frames {} to {}; hint: {}", what, range.first,
                    range.last,
                    last < range.first ? std::string("--frames after that")
                                       : fmt::format("--frames {}-{}", range.first, last)));
  }
  talk(fmt::format("warning: {}; frames {} to {} before it are made", what, range.first, last));
  return {range.first, last};
}

}  // namespace sinew::tools
