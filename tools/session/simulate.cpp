#include "tools/session/simulate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <tbb/global_control.h>

#include "assets/atomic_output.h"
#include "assets/error.h"
#include "assets/lattice_cache.h"
#include "assets/lattice_files.h"
#include "assets/obj.h"
#include "assets/output_mesh.h"
#include "assets/pc2.h"
#include "assets/preview.h"
#include "assets/riding.h"
#include "assets/sidecar.h"
#include "fem/time/envelope.h"
#include "lattice/limb_copies.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/body_fields.h"
#include "tools/session/character.h"
#include "tools/session/frame_guard.h"
#include "tools/session/offset_flesh.h"
#include "tools/session/plain_loads.h"
#include "tools/session/run_report.h"
#include "tools/session/skin_report.h"
#include "tools/session/whole_skin.h"
#include "tools/support/failure.h"
#include "tools/support/interrupt.h"
#include "tools/support/progress.h"

namespace sinew::tools {
namespace {

using lattice::Points;

constexpr const char* kPicture = "preview.png";

/// Everything that a run may write into its folder.
const std::vector<std::string> kOutputs{"skin.obj",    "skin.pc2",    "skin.json",
                                        "lattice.vtu", "report.json", kPicture};

/// Which vertices are written, in which order and space.
struct OutputLayout {
  Eigen::Affine3d from_rig = Eigen::Affine3d::Identity();  ///< rig space to the output's.
  std::vector<int> rig_vertex;                             ///< rig vertex of every output vertex.
  std::vector<assets::NamedMesh> parts;                    ///< rest, in the output's space.
  assets::VertexOrder order = assets::VertexOrder::File;

  Points apply(const Points& rig_points) const {
    Points out(static_cast<Eigen::Index>(rig_vertex.size()), 3);
    for (std::size_t i = 0; i < rig_vertex.size(); ++i) {
      out.row(static_cast<Eigen::Index>(i)) =
          (from_rig * rig_points.row(rig_vertex[i]).transpose()).transpose();
    }
    return out;
  }
};

OutputLayout make_layout(const Scene& scene, const Character& character) {
  const assets::Rig& rig = character.rig;
  OutputLayout layout;
  if (scene.output_space == OutputSpace::File) layout.from_rig = rig.rig_from_file.inverse();
  layout.order = rig.file_vertex_order ? assets::VertexOrder::File : assets::VertexOrder::Importer;
  layout.rig_vertex.resize(static_cast<std::size_t>(assets::num_vertices(rig)));
  for (std::size_t i = 0; i < layout.rig_vertex.size(); ++i) layout.rig_vertex[i] = static_cast<int>(i);
  const Points rest = layout.apply(rest_points(rig));
  if (!scene.output_mesh.empty()) {
    assets::NamedMesh mesh = assets::read_surface(scene.output_mesh);
    layout.rig_vertex = assets::match_rest_positions(scene.output_mesh, mesh.points, rest,
                                                     assets::moving_together(rig, character.input.skin));
    mesh.points = layout.apply(rest_points(rig));
    layout.parts = {std::move(mesh)};
    layout.order = assets::VertexOrder::OutputMesh;
    return layout;
  }
  Eigen::Index next = 0;
  for (const assets::Part& part : rig.parts) {
    layout.parts.push_back({part.name, rest.middleRows(next, part.points.rows()), part.triangles});
    next += part.points.rows();
  }
  return layout;
}

/// One frame of the whole character in the rig's space: the flesh from the simulation, everything else
/// skinned.
struct CharacterFrame {
  Points simulated, skinned;
};

CharacterFrame frame_at(const Character& character, const std::vector<Eigen::Affine3d>& pose,
                        const Points& surface) {
  CharacterFrame frame;
  frame.skinned = assets::skin(character.rig, pose);
  frame.simulated = frame.skinned;
  const std::vector<int>& map = character.input.skin.surface_of_vertex;
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (map[i] >= 0) frame.simulated.row(static_cast<Eigen::Index>(i)) = surface.row(map[i]);
  }
  return frame;
}

/// "frame 0: at most 2.1 % of the height from plain skinning, in 'body' at joint 'spine'".
std::string distance_line(const assets::Rig& rig, const CharacterFrame& frame, int number) {
  Eigen::Index vertex = 0;
  const double distance = (frame.simulated - frame.skinned).rowwise().norm().maxCoeff(&vertex);
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
  return fmt::format("frame {}: at most {:.2g} % of the height from plain skinning, {}", number,
                     100.0 * distance / rig.height, place);
}

std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> posed_bones(
    const lattice::ControlLattice& lattice, const std::vector<Eigen::Affine3d>& pose) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bones;
  for (const auto& bone : lattice.bones) {
    bones.emplace_back(pose[static_cast<std::size_t>(bone.start.joint_a)] * bone.start.x_a,
                       pose[static_cast<std::size_t>(bone.end.joint_b)] * bone.end.x_b);
  }
  return bones;
}

[[noreturn]] void fail(const Character& character, const fem::SimulationReport& report,
                       const std::string& where) {
  if (report.status == fem::SimulationStatus::Stopped) stop_if_interrupted(where);
  throw NumericalError(fmt::format("{}: {}: {}", character.rig.file, where, report.message));
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

/// The files that stand beside the cache.
void write_companions(const Scene& scene, const Character& character, const OutputLayout& layout,
                      const RunReport& report, const fem::Body& body, const FrameRange& frames,
                      const assets::OutputDirectory& out) {
  out.write("skin.obj", assets::obj_text(layout.parts));
  assets::Sidecar sidecar;
  sidecar.version = report.version;
  sidecar.rig_file = character.rig.file;
  sidecar.clip = character.the_clip().name;
  sidecar.rest_mesh = "skin.obj";
  sidecar.cache = "skin.pc2";
  sidecar.rest = assets::to_float(layout.apply(rest_points(character.rig)));
  for (const auto& part : layout.parts)
    sidecar.parts.push_back({part.name, static_cast<int>(part.points.rows())});
  sidecar.vertex_order = layout.order;
  sidecar.fps = scene.fps;
  sidecar.clip_start = character.the_clip().start;
  sidecar.first_frame = frames.first;
  sidecar.num_frames = frames.last - frames.first + 1;
  const bool si = scene.output_space == OutputSpace::Si;
  sidecar.metres_per_unit = si ? 1.0 : character.rig.metres_per_unit;
  sidecar.up_axis = si ? assets::UpAxis::Y : character.rig.up_axis;
  sidecar.settings_json = nlohmann::json{{"scene_toml", report.settings}}.dump();
  out.write("skin.json", assets::sidecar_json(sidecar));
  out.write("lattice.vtu", assets::format_lattice(assets::LatticeFormat::Vtu, character.lattice.lattice,
                                                  character.input.joints, body_fields(body)));
  out.write("report.json", report_json(report, character, body));
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

/// The verdict on the frames of the report, which is thrown where it is strict and bad.
void judge_frames(const Scene& scene, const Character& character, const fem::Body& body, RunReport& report) {
  std::vector<fem::SkinFrame> skins;
  std::vector<int> numbers;
  for (const FrameReport& frame : report.frames) {
    if (!frame.skin) return;
    skins.push_back(*frame.skin);
    numbers.push_back(frame.frame);
  }
  report.finding = find_fault(scene, character, body, skins, numbers);
  if (scene.strict) refuse_torn(*report.finding);
}

/// Steps through the frames, writes the cache and keeps what the preview shows.
std::vector<assets::PreviewFrame> run_frames(const Scene& scene, const Character& character,
                                             fem::Simulation& simulation,
                                             const fem::SimulationOptions& options, const FrameRange& frames,
                                             const OutputLayout& layout, const std::string& cache,
                                             const Talk& talk, RunReport& report) {
  const double t0 = character.the_clip().start;
  const int count = frames.last - frames.first + 1;
  const std::vector<int> shown = assets::preview_frames(count);
  std::vector<assets::PreviewFrame> preview;
  FrameJudge judge(scene, character, frames);
  assets::Pc2Writer writer(cache, static_cast<int>(layout.rig_vertex.size()), frames.first);
  FrameGuard guard(scene, character, scene.fps);
  const assets::PropMotion props(character.rig);
  std::optional<OffsetFlesh> offset;
  if (scene.offset.value_or(0.0) != 0.0) offset.emplace(*scene.offset, character, simulation, options);
  Progress progress("simulating", count);
  // Frames that the guard has seen and not mended.
  struct Pending {
    CharacterFrame frame;
    std::vector<Eigen::Affine3d> pose;
    FrameReport report;
  };
  std::deque<Pending> pending;
  int written = 0;
  const auto write_first = [&] {
    auto& [frame, pose, f] = pending.front();
    f.mended = guard.mend_next(frame.simulated);
    props.place(pose, frame.skinned, frame.simulated);
    if (written == 0) talk(distance_line(character.rig, frame, f.frame));
    try {
      writer.write(layout.apply(frame.simulated));
    } catch (const std::domain_error& error) {
      throw NumericalError(
          fmt::format("{}: frame {} at {:.6g} s: {}", character.rig.file, f.frame, f.time, error.what()));
    }
    f.skin = judge.measure(frame.simulated, frame.skinned,
                           written == 0 ? fem::FrameKind::First : fem::FrameKind::Later);
    report.frames.push_back(f);
    if (std::find(shown.begin(), shown.end(), written) != shown.end()) {
      preview.push_back(
          {f.frame, f.time, frame.simulated, frame.skinned, posed_bones(character.lattice.lattice, pose)});
    }
    pending.pop_front();
    progress.update(++written);
  };
  for (int k = 0; k < count; ++k) {
    const int number = frames.first + k;
    const double time = t0 + number / scene.fps;
    const fem::SimulationReport step = simulation.advance_to(time);
    if (step.status != fem::SimulationStatus::Ok) fail(character, step, fmt::format("frame {}", number));
    std::vector<Eigen::Affine3d> pose = character.pose(time);
    const Points surface = simulation.skin_of(simulation.positions_at(time));
    CharacterFrame frame = frame_at(character, pose, surface);
    if (offset) {
      offset->apply(time, pose, frame.skinned, frame.simulated);
    } else if (scene.offset) {
      frame.simulated = frame.skinned;
    }
    guard.see(frame.skinned, frame.simulated);
    FrameReport f;
    f.frame = number;
    f.time = time;
    f.steps = step.steps;
    f.measures = simulation.measures_at(time);
    pending.push_back({std::move(frame), std::move(pose), f});
    while (static_cast<int>(pending.size()) > guard.lookahead()) write_first();
  }
  while (!pending.empty()) write_first();
  writer.finish();
  report.judging = judge.seconds();
  return preview;
}

void write_picture(const Character& character, const std::vector<assets::PreviewFrame>& frames,
                   const std::string& file) {
  assets::PreviewOptions picture;
  picture.caption =
      std::filesystem::path(character.rig.file).stem().string() + ", " + character.the_clip().name;
  picture.colours = assets::role_colours(character.rig);
  assets::write_preview(file, all_triangles(character.rig), frames, picture);
}

}  // namespace

void simulate(const Scene& scene, const Talk& talk) {
  std::unique_ptr<tbb::global_control> threads;
  if (scene.threads > 0) {
    threads = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                    static_cast<std::size_t>(scene.threads));
  }
  const assets::Overwrite overwrite =
      scene.overwrite ? assets::Overwrite::Replace : assets::Overwrite::Refuse;
  assets::OutputDirectory out(scene.output, overwrite, kOutputs);
  const Character character = make_character(scene, talk);
  const FrameRange frames = frame_range(scene, character, talk);
  const OutputLayout layout = make_layout(scene, character);
  say_what_runs(scene, character, frames, talk);
  stop_if_interrupted("before the simulation");

  RunReport report;
  report.version = SINEW_VERSION;
  report.settings = print_scene(scene);
  report.times = character.times;
  auto start = std::chrono::steady_clock::now();
  const auto lap = [&](const std::string& phase) {
    report.times.emplace_back(phase, seconds_since(start));
    start = std::chrono::steady_clock::now();
  };
  const fem::Body body = make_body(character);
  lap("assemble");
  const auto motion = [&](double time) { return character.pose(time); };
  const double first = character.the_clip().start + frames.first / scene.fps;
  const fem::SimulationOptions options = simulation_options(scene, character, body);
  say_cuts(scene, character, options.cuts, frames, talk);
  report.cuts = options.cuts;
  for (const std::string& warning :
       fem::outside_envelope(body, motion, options, first,
                             std::lround((frames.last - frames.first) / (scene.fps * scene.step))))
    talk("warning: " + warning);
  fem::Simulation simulation(body, motion, first, options, [] { return interrupt_signal() != 0; });
  const fem::SimulationReport settled = simulation.settle();
  lap("factor and settle");
  if (settled.status != fem::SimulationStatus::Ok) fail(character, settled, "settling");
  if (scene.plain && scene.plain->velocity)
    simulation.set_velocity(starting_velocity(*scene.plain, simulation.flesh().x));
  report.settle_steps = settled.steps;
  report.settle_speed = settled.speed;
  report.settle_joint = settled.fastest;
  report.settled = settled.settled;
  say_settling(scene, character, settled, body, talk);
  const auto preview =
      run_frames(scene, character, simulation, options, frames, layout, out.file("skin.pc2"), talk, report);
  lap("simulate and write frames");
  report.times.back().second -= report.judging;
  report.times.emplace_back(kJudging, report.judging);
  judge_frames(scene, character, body, report);
  say_what_was_mended(character, report.frames, talk);
  if (scene.preview == Switch::On) write_picture(character, preview, out.file(kPicture));
  lap("preview");
  report.counts = simulation.counts();
  report.energy_taken = simulation.energy_taken();
  write_companions(scene, character, layout, report, body, frames, out);
  stop_if_interrupted("before the results were in place");
  out.commit();
  if (!character.new_lattice_key.empty())
    assets::keep_lattice(assets::cache_folder(scene.output), character.new_lattice_key, character.lattice,
                         character.input.joints);

  if (scene.json) std::cout << report_json(report, character, body);
  double total = 0.0;
  for (const auto& phase : report.times) total += phase.second;
  talk(fmt::format("wrote {} frames of {} vertices to {} in {:.1f} s:", frames.last - frames.first + 1,
                   layout.rig_vertex.size(), scene.output, total));
  for (const std::string& name : kOutputs) {
    if (name != kPicture || scene.preview == Switch::On) talk("  " + scene.output + "/" + name);
  }
  if (scene.preview == Switch::On) talk("look at " + scene.output + "/" + kPicture);
  if (report.finding) tell(*report.finding, talk);
}

}  // namespace sinew::tools
