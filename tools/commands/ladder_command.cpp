#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "assets/atomic_output.h"
#include "assets/error.h"
#include "fem/models/model.h"
#include "tools/commands/command.h"
#include "tools/ladder/ladder.h"
#include "tools/ladder/ladder_report.h"
#include "tools/ladder/tolerance.h"
#include "tools/scene/scene_fields.h"
#include "tools/terminal/caller.h"
#include "tools/terminal/exit_code.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

struct LadderRequest {
  std::string input, output;
  std::string rungs, levels = "1,2", steps = "1/120,1/240", frames, cells, converged = "0.5%", tolerance;
  bool json = false, strict = false;
};

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts;
  std::size_t from = 0;
  while (from <= list.size()) {
    const std::size_t comma = std::min(list.find(',', from), list.size());
    std::string part = list.substr(from, comma - from);
    part.erase(0, std::min(part.find_first_not_of(' '), part.size()));
    part.erase(part.find_last_not_of(' ') + 1);
    if (!part.empty()) parts.push_back(part);
    from = comma + 1;
  }
  return parts;
}

/// The values of one key for every part of a list, checked as the key's own.
template <class Value>
std::vector<Value> values(const char* flag, const char* key, const std::string& list, Value Scene::*member) {
  std::vector<Value> result;
  for (const std::string& part : split(list)) {
    Scene scratch;
    set_from_text(scratch, *find_scene_field(key), part, flag);
    if (std::find(result.begin(), result.end(), scratch.*member) == result.end())
      result.push_back(scratch.*member);
  }
  if (result.empty())
    throw assets::ConfigError(fmt::format("{}: got nothing, expected values with commas between", flag));
  return result;
}

LadderGrid grid_of(const LadderRequest& request) {
  LadderGrid grid;
  std::string rungs = request.rungs;
  if (rungs.empty()) {
    for (const fem::ModelInfo& model : fem::models())
      rungs += std::string(rungs.empty() ? "" : ",") + std::string(model.name);
  }
  grid.rungs = values<std::string>("--rungs", "model", rungs, &Scene::model);
  grid.levels = values<int>("--levels", "levels", request.levels, &Scene::levels);
  grid.steps = values<double>("--steps", "step", request.steps, &Scene::step);
  return grid;
}

Scene scene_of(const LadderRequest& request) {
  Scene scene;
  if (fs::path(request.input).extension() == ".toml") {
    scene = read_scene(request.input);
  } else {
    scene.rig = request.input;
  }
  if (!request.frames.empty()) set_from_text(scene, *find_scene_field("frames"), request.frames, "--frames");
  if (!request.cells.empty()) set_from_text(scene, *find_scene_field("cells"), request.cells, "--cells");
  if (request.strict) scene.strict = true;
  scene.validate();
  if (scene.rig.empty() && !scene.plain)
    throw assets::ConfigError(request.input + ": rig is missing; hint: rig = \"character.glb\"");
  return scene;
}

void write_png(const std::string& file, const assets::Figure& figure) {
  assets::write_file(file, assets::png_bytes(assets::draw_figure(figure)), assets::Overwrite::Replace);
}

/// Prints the cheapest run within the tolerance and writes it as a scene.
int choose(const Scene& scene, const Ladder& ladder, const Tolerance& tolerance, const std::string& output) {
  if (tolerance.of_height && !(ladder.height > 0.0))
    throw assets::ConfigError(
        "--tolerance: got a share of the height, expected a length, as the character has no height");
  const std::string file = (fs::path(output) / "chosen.toml").string();
  const double metres = tolerance.metres(ladder.height);
  const int chosen = ladder.cheapest_within(metres);
  if (chosen < 0) {
    fs::remove(file);  // that of an earlier tolerance
    std::cout.flush();
    std::fprintf(
        stderr, "%s\n",
        fmt::format(
            "sinew: --tolerance: no run but the reference itself has a largest error of at most {} ({}); "
            "hint: more --levels or shorter --steps",
            length_text(metres), tolerance_text(tolerance))
            .c_str());
    return exit_code::kCheck;
  }
  const LadderRun& run = ladder.runs[static_cast<std::size_t>(chosen)];
  Scene found = scene;
  found.model = run.rung;
  found.levels = run.level;
  found.step = run.step;
  found.output = (fs::path(output) / "out").string();
  found.overwrite = found.json = false;
  // Paths in a scene file are relative to its own folder.
  for (std::string Scene::*path : {&Scene::rig, &Scene::output, &Scene::lattice, &Scene::output_mesh}) {
    if (!(found.*path).empty()) found.*path = fs::absolute(found.*path).lexically_normal().string();
  }
  assets::write_file(file, print_scene(found), assets::Overwrite::Replace);
  fmt::print(stderr, "cheapest within {}: {}: {:.3g} ms per frame, largest error {}; written as {}\n",
             tolerance_text(tolerance), run.name(), 1e3 * run.per_frame, length_text(run.error.largest),
             file);
  return exit_code::kDone;
}

int run_ladder_command(const LadderRequest& request) {
  const LadderGrid grid = grid_of(request);
  const Scene scene = scene_of(request);
  std::optional<Tolerance> tolerance;
  if (!request.tolerance.empty()) tolerance = parse_tolerance(request.tolerance, "--tolerance");
  const Tolerance converged = parse_tolerance(request.converged, "--converged");
  if (!converged.of_height)
    throw assets::ConfigError(fmt::format(
        "--converged: got '{}', expected a percentage of the height; hint: 0.5%", request.converged));
  for (const std::string& warning : outside_envelope(scene)) std::cerr << "warning: " << warning << '\n';
  const Ladder ladder = run_ladder(scene, grid, converged.value, request.output, terminal_caller());
  const std::string settings = print_scene(scene);
  const std::string json = ladder_json(ladder, settings);
  const auto out = [&](const char* name) { return (fs::path(request.output) / name).string(); };
  assets::write_file(out("ladder.json"), json, assets::Overwrite::Replace);
  write_png(out("error_cost.png"), error_cost_figure(ladder));
  write_png(out("error_time.png"), error_time_figure(ladder));
  write_png(out("phases.png"), phases_figure(ladder));
  const std::string title = "Ladder of " + fs::path(request.input).stem().string();
  assets::write_file(out("ladder.html"), ladder_html(ladder, title, settings, ladder_thumbnails(ladder)),
                     assets::Overwrite::Replace);
  std::cout << (request.json ? json : ladder_table(ladder));
  std::cerr << reference_text(ladder) << "\nlook at " << out("ladder.html") << '\n';
  if (const std::string fault = fault_text(ladder); !fault.empty()) std::cerr << fault << '\n';
  return tolerance ? choose(scene, ladder, *tolerance, request.output) : exit_code::kDone;
}

}  // namespace

void add_ladder_command(CLI::App& app, CommandContext& context) {
  const auto request = std::make_shared<LadderRequest>();
  CLI::App* command = app.add_subcommand(
      "ladder", "Run one scene on every rung and show what each costs and how exact it is");
  command->add_option("input", request->input, "scene file (.toml), or a rig: glTF, GLB, FBX, Collada, ...")
      ->type_name("SCENE.toml|RIG")
      ->required();
  command->add_option("-o,--output", request->output, "folder for the runs, ladder.json and ladder.html")
      ->type_name("DIR")
      ->required();
  command->add_option("--rungs", request->rungs, "models, with commas between; left out: all of them");
  command->add_option("--levels", request->levels, "finest levels, with commas between")
      ->capture_default_str();
  command->add_option("--steps", request->steps, "time steps in seconds, with commas between")
      ->capture_default_str();
  command->add_option("--frames", request->frames, "output frames A-B; left out: the scene's")
      ->type_name("A-B");
  command->add_option("--cells", request->cells, "wanted number of lattice cells; left out: the scene's");
  command
      ->add_option(
          "--converged", request->converged,
          "the reference counts as converged if one level less and the next longer step move it by no more")
      ->capture_default_str();
  command
      ->add_option("--tolerance", request->tolerance,
                   "print the cheapest run whose largest error is within it, and write it as a scene")
      ->type_name("2mm|1%");
  command->add_flag("--strict", request->strict,
                    "a run whose skin is torn or that did not settle has failed");
  command->add_flag("--json", request->json, "print ladder.json instead of a table");
  command->footer(
      "The reference is the finest run that worked: highest rung, then level, then shortest step. Runs that "
      "OUT/runs\n"
      "holds already with the same settings and input files are not repeated. Exit code 4: no run worked; 8: "
      "no run\n"
      "but the reference is within the tolerance.");
  command->callback([request, &context] { context.exit_code = run_ladder_command(*request); });
}

}  // namespace sinew::tools
