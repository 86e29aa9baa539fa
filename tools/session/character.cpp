#include "tools/session/character.h"

#include <chrono>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "assets/error.h"
#include "assets/lattice_cache.h"
#include "tools/session/flesh_settings.h"
#include "tools/session/lattice_memory.h"
#include "tools/session/lattice_settings.h"
#include "tools/session/plain_character.h"
#include "tools/session/roles.h"
#include "tools/session/thin_limbs.h"
#include "tools/support/errors.h"

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

}  // namespace

std::vector<Eigen::Affine3d> Character::pose(double time) const {
  return skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, the_clip(), time));
}

namespace {

void load_rig(const Scene& scene, const Caller& caller, Character& c) {
  const Talk talk = caller.words();
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
    lattice::BuildOptions options = build_options(scene, c.input.joints.names, caller);
    hang_idle_sizes(c.input, talk, options);
    if (scene.lattice.empty()) {
      check_lattice_memory(scene, c.input.skin.surface, talk);
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

Character make_character(const Scene& scene, const Caller& caller) {
  const Talk talk = caller.words();
  Character c;
  warn_of_precision(scene, talk);
  if (scene.plain) {
    load_plain(scene, talk, c);
  } else {
    load_rig(scene, caller, c);
  }
  settle_flesh(scene, c, talk);
  return c;
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
  const auto make = [](const fem::BodyInput& input, const fem::BodyOptions& options) {
    return fem::make_body(input, options);
  };
  return body_by(make, character, character.body_options);
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

}  // namespace sinew::tools
