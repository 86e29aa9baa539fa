#include "tools/session/session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "assets/error.h"
#include "fem/time/envelope.h"
#include "lattice/limb_copies.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/frame_maker.h"
#include "tools/session/plain_loads.h"
#include "tools/session/run_settings.h"
#include "tools/support/errors.h"

namespace sinew::tools {
namespace {

/// "frame 0: at most 2.1 % of the height from plain skinning, in 'body' at joint 'spine'".
std::string distance_line(const assets::Rig& rig, const Frame& frame) {
  Eigen::Index vertex = 0;
  const double distance = (frame.positions - frame.skinned).rowwise().norm().maxCoeff(&vertex);
  std::size_t p = 0;
  for (; vertex >= rig.parts[p].points.rows(); ++p) vertex -= rig.parts[p].points.rows();
  const assets::Part& part = rig.parts[p];
  std::string place = fmt::format("in '{}'", part.name);
  if (!part.weights.empty()) {
    const auto& influences = part.weights[static_cast<std::size_t>(vertex)];
    const auto most = std::max_element(influences.begin(), influences.end(),
                                       [](const auto& a, const auto& b) { return a.weight < b.weight; });
    if (most != influences.end())
      place += fmt::format(" at joint '{}'", rig.skeleton.joint(most->frame).name);
  }
  return fmt::format("frame {}: at most {:.2g} % of the height from plain skinning, {}", frame.report.frame,
                     100.0 * distance / rig.height, place);
}

void say_what_runs(const Scene& scene, const Character& c, const FrameRange& frames, const Talk& talk) {
  const skeleton::Clip& clip = c.the_clip();
  const lattice::ControlLattice& l = c.lattice.lattice;
  talk(fmt::format("{}: {:.3g} m tall, clip '{}' of {:.3g} s, frames {} to {} at {:g} fps", c.rig.file,
                   c.rig.height, clip.name, clip.duration(), frames.first, frames.last, scene.fps));
  std::string others;
  for (const auto& other : c.rig.clips) {
    if (&other != &clip) others += (others.empty() ? "" : ", ") + other.name;
  }
  if (scene.clip.empty() && !others.empty()) talk("other clips: " + others);
  double stiffest = c.body_options.material.young;
  for (const auto& of_joint : c.body_options.materials)
    stiffest = std::max(stiffest, of_joint.material.young);
  talk(fmt::format(
      "lattice: {} cells, {} vertices, {} bones; flesh: E {:.3g} to {:.3g} Pa, nu {:g}, rho {:g} kg/m^3, "
      "damping {:g} "
      "at {:g} Hz",
      l.complex.cells.size(), l.complex.points.rows(), l.bones.size(), c.body_options.material.young,
      stiffest, scene.poisson, scene.density, scene.damping, scene.damping_frequency));
  for (const std::string& warning : outside_envelope(scene)) talk("warning: " + warning);
}

void say_settling(const Scene& scene, const Character& character, const fem::SimulationReport& settled,
                  const fem::Body& body, const Talk& talk) {
  if (settled.settled) {
    if (settled.steps > 0)
      talk(fmt::format("settled in {} steps; fastest flesh left {:.2g} mm/s", settled.steps,
                       1e3 * settled.speed));
    return;
  }
  // What a stable step leaves grows slower with more time; what it feeds, by another model.
  const char* remedy = scene.model == "blended"
                           ? "--model blended-stiffness, whose steps feed no motion"
                           : "a longer --settle, stiffer flesh (--young) or more --damping";
  const std::string line = fmt::format(
      "not settled: the flesh of '{}' still moves at {:.3g} m/s after {} steps, where {:.2g} "
      "is rest; hint: {}",
      settled.fastest, settled.speed, settled.steps, fem::kSettledRate * body.size, remedy);
  if (scene.strict) throw NumericalError(character.rig.file + ": " + line);
  talk("warning: " + line);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// One line on what was mended, and where most.
void say_what_was_mended(const Character& character, const std::vector<FrameReport>& frames,
                         const Talk& talk) {
  const auto most = std::max_element(
      frames.begin(), frames.end(),
      [](const FrameReport& a, const FrameReport& b) { return a.mended.largest < b.mended.largest; });
  if (most == frames.end() || most->mended.vertex < 0) return;
  const lattice::Surface& surface = character.input.skin.surface;
  const int joint = lattice::skin_frame(surface.weights[static_cast<std::size_t>(most->mended.vertex)],
                                        character.lattice.lattice.frame_of_joint);
  const double widest =
      std::max_element(frames.begin(), frames.end(), [](const FrameReport& a, const FrameReport& b) {
        return a.mended.area < b.mended.area;
      })->mended.area;
  const double way = most->mended.largest / character.rig.height;
  // A tenth of the height is more than flesh swings by: there is none to be seen any more.
  const bool much = way > 0.1;
  talk(fmt::format(
      "{}mended up to {:.3g} % of the skin, where cells are too coarse for it, by at most {:.3g} % of the "
      "height: frame {} at '{}'; {}--guard off leaves it",
      much ? "warning: " : "", 100.0 * widest, 100.0 * way, most->frame,
      joint < 0 ? std::string("the body") : character.input.joints.names[static_cast<std::size_t>(joint)],
      much ? fmt::format("hint: --young {:.2g}, stiffer flesh, keeps more of its motion; ",
                         much_stiffer(character))
           : ""));
}

/// Keeps what the report says of every frame.
class ReportSink final : public FrameSink {
 public:
  explicit ReportSink(RunReport& report) : report_(report) {}
  void take(const Frame& frame) override { report_.frames.push_back(frame.report); }

 private:
  RunReport& report_;
};

/// Says how far the first frame is from plain skinning.
class FirstFrameSink final : public FrameSink {
 public:
  FirstFrameSink(const assets::Rig& rig, Talk talk) : rig_(rig), talk_(std::move(talk)) {}
  void take(const Frame& frame) override {
    if (!said_) talk_(distance_line(rig_, frame));
    said_ = true;
  }

 private:
  const assets::Rig& rig_;
  Talk talk_;
  bool said_ = false;
};

/// Holds as long as it lives; nothing for 0.
std::shared_ptr<void> limit_threads(int threads) {
  if (threads <= 0) return nullptr;
  return std::make_shared<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                               static_cast<std::size_t>(threads));
}

}  // namespace

Session::Session(const Scene& scene, Caller caller) : scene_(scene), caller_(std::move(caller)) {
  scene_.validate();
  threads_ = limit_threads(scene_.threads);
  character_ = make_character(scene_, caller_);
  frames_ = frame_range(scene_, character_, caller_.words());
}

void Session::settle(RunReport& report, fem::Simulation& simulation) const {
  const fem::SimulationReport settled = simulation.settle();
  if (settled.status != fem::SimulationStatus::Ok) fail(character_, caller_, settled, "settling");
  if (scene_.plain && scene_.plain->velocity)
    simulation.set_velocity(starting_velocity(*scene_.plain, simulation.flesh().x));
  report.settle_steps = settled.steps;
  report.settle_speed = settled.speed;
  report.settle_joint = settled.fastest;
  report.settled = settled.settled;
  say_settling(scene_, character_, settled, *body_, caller_.words());
}

/// The verdict on the frames of the report, which is thrown where it is strict and bad.
void Session::judge(RunReport& report) const {
  std::vector<fem::SkinFrame> skins;
  std::vector<int> numbers;
  for (const FrameReport& frame : report.frames) {
    if (!frame.skin) return;
    skins.push_back(*frame.skin);
    numbers.push_back(frame.frame);
  }
  report.finding = find_fault(scene_, character_, *body_, skins, numbers);
  if (scene_.strict) refuse_torn(*report.finding);
}

RunReport Session::run(std::span<FrameSink* const> sinks) {
  if (body_) throw std::logic_error("Session::run was called twice");
  const Talk talk = caller_.words();
  say_what_runs(scene_, character_, frames_, talk);
  caller_.stop_if_asked("before the simulation");

  RunReport report;
  report.version = SINEW_VERSION;
  report.settings = print_scene(scene_);
  report.times = character_.times;
  auto start = std::chrono::steady_clock::now();
  const auto lap = [&](const std::string& phase) {
    report.times.emplace_back(phase, seconds_since(start));
    start = std::chrono::steady_clock::now();
  };
  body_ = make_body(character_);
  lap("assemble");
  const auto motion = [&](double time) { return character_.pose(time); };
  const double first = character_.the_clip().start + frames_.first / scene_.fps;
  const fem::SimulationOptions options = simulation_options(scene_, character_, *body_);
  say_cuts(scene_, character_, options.cuts, frames_, talk);
  report.cuts = options.cuts;
  const long steps = std::lround((frames_.last - frames_.first) / (scene_.fps * scene_.step));
  for (const std::string& warning : fem::outside_envelope(*body_, motion, options, first, steps))
    talk("warning: " + warning);
  std::optional<fem::Simulation> made;
  try {
    made.emplace(*body_, motion, first, options, [this] { return caller_.wants_to_stop(); });
  } catch (const std::invalid_argument& error) {
    throw assets::ConfigError(error.what());  // what a model and an integrator cannot do together
  }
  fem::Simulation& simulation = *made;
  settle(report, simulation);
  lap("factor and settle");

  ReportSink reports(report);
  FirstFrameSink distance(character_.rig, talk);
  std::vector<FrameSink*> all{&distance, &reports};
  all.insert(all.end(), sinks.begin(), sinks.end());
  FrameMaker maker(scene_, character_, caller_, simulation, options, frames_);
  while (const std::optional<Frame> frame = maker.next()) {
    for (FrameSink* sink : all) sink->take(*frame);
  }
  for (FrameSink* sink : all) sink->finish();
  report.judging = maker.judging_seconds();
  lap("simulate and write frames");
  report.times.back().second -= report.judging;
  report.times.emplace_back(kJudging, report.judging);
  judge(report);
  say_what_was_mended(character_, report.frames, talk);
  report.counts = simulation.counts();
  report.energy_taken = simulation.energy_taken();
  return report;
}

}  // namespace sinew::tools
