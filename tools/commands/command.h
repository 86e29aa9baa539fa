#pragma once

namespace CLI {
class App;
}

namespace sinew::tools {

/// What a subcommand hands back to main.
struct CommandContext {
  int exit_code = 0;  ///< of the subcommand that ran.
};

// Each adds one subcommand to `app`; its callback does the work, prints data to stdout and talk to stderr,
// sets `context.exit_code` or throws one of the errors of assets/error.h (main maps them to exit codes and
// one line).
void add_compare_command(CLI::App& app, CommandContext& context);
void add_inspect_command(CLI::App& app, CommandContext& context);
void add_ladder_command(CLI::App& app, CommandContext& context);
void add_lattice_command(CLI::App& app, CommandContext& context);
void add_pose_command(CLI::App& app, CommandContext& context);
void add_simulate_command(CLI::App& app, CommandContext& context);

}  // namespace sinew::tools
