#include "tools/session/run_settings.h"

#include <cmath>

#include <fmt/format.h>

#include "assets/collapse.h"
#include "assets/error.h"
#include "tools/session/plain_loads.h"

namespace sinew::tools {

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
