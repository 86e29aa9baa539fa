// sinew pose: where the flesh comes to rest in one pose.

#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "assets/error.h"
#include "tools/commands/command.h"
#include "tools/commands/simulate_options.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/pose.h"
#include "tools/terminal/caller.h"

namespace sinew::tools {
namespace {

struct PoseArguments {
  SimulateOptions options;
  std::optional<std::string> time;
  int load_steps = PoseRequest().load_steps;
};

PoseRequest request_of(const PoseArguments& arguments) {
  PoseRequest request;
  if (arguments.load_steps < 1 || arguments.load_steps > 10000)
    throw assets::ConfigError(
        fmt::format("--load-steps: got {}, expected 1 ... 10000; hint: 4", arguments.load_steps));
  request.load_steps = arguments.load_steps;
  if (!arguments.time) return request;
  request.time = parse_number(*arguments.time);
  if (!request.time || !(std::abs(*request.time) <= 1e6))
    throw assets::ConfigError(
        fmt::format("--time: got '{}', expected a number of seconds within 1e6; hint: 0.5", *arguments.time));
  return request;
}

void find_pose(const PoseArguments& arguments) {
  const PoseRequest request = request_of(arguments);
  const Scene scene = arguments.options.scene();
  if (arguments.options.print_scene_only()) {
    std::cout << print_scene(scene);
    return;
  }
  const std::string report = pose(request, scene, terminal_caller());
  if (scene.json) std::cout << report;
}

}  // namespace

void add_pose_command(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("pose", "Find where the flesh comes to rest in one pose of the clip");
  const auto request = std::make_shared<PoseArguments>();
  request->options.add_to(*command);
  command
      ->add_option("--time", request->time, "time of the pose in the clip; left out: that of the first frame")
      ->type_name("s");
  command
      ->add_option("--load-steps", request->load_steps,
                   "steps in which pose, gravity and loads grow; 1 ... 10000")
      ->capture_default_str();
  command->footer(
      "Writes pose.vtu (the lattice's cells at rest, with displacement, Green strain, Cauchy and von Mises "
      "stress and\n"
      "energy), skin.obj (the posed skin) and pose.json. Exit code 4: no equilibrium was found (the message "
      "says "
      "at\n"
      "which part of the load, and where), or with --strict the skin is torn.");
  command->callback([request, &context] {
    find_pose(*request);
    context.exit_code = 0;
  });
}

}  // namespace sinew::tools
