#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "tools/commands/command.h"
#include "tools/commands/simulate_options.h"
#include "tools/session/simulate.h"
#include "tools/terminal/caller.h"

namespace sinew::tools {

void add_simulate_command(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("simulate", "Turn a rigged, animated character into frames of moving flesh");
  const auto options = std::make_shared<SimulateOptions>();
  options->add_to(*command);
  command->callback([options, &context] {
    const Scene scene = options->scene();
    if (options->print_scene_only()) {
      std::cout << print_scene(scene);
    } else {
      const std::string report = simulate(scene, terminal_caller());
      if (scene.json) std::cout << report;
    }
    context.exit_code = 0;
  });
}

}  // namespace sinew::tools
