#pragma once

#include <exception>
#include <string>

/// What can stop a command, and what the user and the shell get to see of it.
namespace sinew::tools {

/// An exit code of tools/terminal/exit_code.h and one line of text.
struct Failure {
  int exit_code = 0;
  std::string message;
};

/// Exit code and line for what was thrown. Exceptions that say nothing about the user's input are internal
/// errors, std::invalid_argument among them. `error` must not be null.
Failure describe_failure(const std::exception_ptr& error);

}  // namespace sinew::tools
