#include "tools/shell/run.h"

#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "assets/error.h"
#include "tools/commands/command.h"
#include "tools/support/suggest.h"
#include "tools/terminal/exit_code.h"
#include "tools/terminal/failure.h"

namespace sinew::tools {
namespace {

/// One line per subcommand of tools/commands/command.h that exists.
void add_commands(CLI::App& app, CommandContext& context) {
  add_compare_command(app, context);
  add_inspect_command(app, context);
  add_ladder_command(app, context);
  add_lattice_command(app, context);
  add_pose_command(app, context);
  add_simulate_command(app, context);
}

const CLI::App& deepest_parsed(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : deepest_parsed(*parsed.front());
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

std::string quoted_list(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

/// One line for what CLI11 could not parse. Arguments nobody asked for are named first, before what they may
/// have left missing.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& command = deepest_parsed(app);
  const std::string help = &command == &app ? "sinew --help" : "sinew " + command.get_name() + " --help";
  for (const std::string& argument : app.remaining(/*recurse=*/true)) {
    if (argument.size() > 1 && argument.front() == '-') {
      const std::string name = argument.substr(0, argument.find('='));
      const std::string suggestion = nearest(name, option_names(command));
      return fmt::format("{}: unknown option; hint: {}", name,
                         suggestion.empty() ? "see " + help : "did you mean " + suggestion + "?");
    }
    if (&command == &app) {
      const std::string suggestion = nearest(argument, command_names(app));
      return fmt::format("{}: unknown command, expected one of {}; hint: {}", argument,
                         quoted_list(command_names(app)),
                         suggestion.empty() ? "see " + help : "did you mean " + suggestion + "?");
    }
    return fmt::format("{}: unexpected argument; hint: see {}", argument, help);
  }
  if (&command == &app) {
    return fmt::format("a command is missing, expected one of {}; hint: see {}",
                       quoted_list(command_names(app)), help);
  }
  return fmt::format("{}; hint: see {}", error.what(), help);
}

/// True for a pipe that nobody reads any more. Asked of the pipe itself: the write that failed may be long
/// ago.
bool reader_has_gone() {
  pollfd out{STDOUT_FILENO, POLLOUT, 0};
  return poll(&out, 1, 0) > 0 && (out.revents & POLLERR) != 0;
}

/// Writes out what stdout still buffers. A reader that went away (`sinew inspect FILE | head`) is no failure.
void flush_stdout() {
  std::cout.flush();
  const bool failed = std::fflush(stdout) != 0 || !std::cout || std::ferror(stdout) != 0;
  if (failed && !reader_has_gone()) {
    throw assets::IoError("standard output: cannot be written; hint: is the disk full?");
  }
}

int parse_and_run(int argc, const char* const* argv) {
  CLI::App app("Characters whose flesh moves: from a rigged, animated character to frames of moving flesh.",
               "sinew");
  app.set_version_flag("--version", "sinew " SINEW_VERSION);
  app.require_subcommand(1);
  app.failure_message(nullptr);
  app.footer(
      "Exit codes: 0 done, 1 internal error, 2 usage or configuration, 3 bad input file, 4 numerical "
      "failure,\n"
      "5 input/output, 6 limit reached, 7 output busy, 8 a comparison did not hold, 130/143 stopped by a\n"
      "signal.");
  CommandContext context;
  add_commands(app, context);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& e) {
    app.exit(e);
  } catch (const CLI::CallForVersion& e) {
    app.exit(e);
  } catch (const CLI::ParseError& e) {
    throw assets::ConfigError(usage_message(app, e));
  }
  flush_stdout();
  return context.exit_code;
}

}  // namespace

int run(int argc, const char* const* argv) noexcept {
  Failure failure;
  try {
    return parse_and_run(argc, argv);
  } catch (...) {
    failure = describe_failure(std::current_exception());
  }
  std::fprintf(stderr, "sinew: %s\n", failure.message.c_str());  // fmt::print throws where stderr is full
  return failure.exit_code;
}

}  // namespace sinew::tools
