#pragma once

namespace sinew::tools {

/// The whole command: parses, runs one subcommand and hands back the exit code (tools/terminal/exit_code.h).
/// Data go to stdout; a failure is one line on stderr, "sinew: <message>". Never throws.
int run(int argc, const char* const* argv) noexcept;

}  // namespace sinew::tools
