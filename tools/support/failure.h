#pragma once

#include <exception>
#include <stdexcept>
#include <string>

/// What can stop a command, and what the user and the shell get to see of it. Errors of files, flags and
/// limits are those of assets/error.h; here are the two that belong to no file.
namespace sinew::tools {

/// The numerics failed, or a gate refused the result (exit code 4). One line with step, place and remedy.
class NumericalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The user asked to stop (exit code 128 + signal). Thrown where stopping is clean; `message` says how far it
/// got.
class Interrupted : public std::runtime_error {
 public:
  Interrupted(int signal, const std::string& message) : std::runtime_error(message), signal_(signal) {}
  int signal() const { return signal_; }

 private:
  int signal_;
};

/// An exit code of tools/support/exit_code.h and one line of text.
struct Failure {
  int exit_code = 0;
  std::string message;
};

/// Exit code and line for what was thrown. Unknown exceptions are internal errors. `error` must not be null.
Failure describe_failure(const std::exception_ptr& error);

/// True for valid UTF-8; file names need not be.
bool is_utf8(const std::string& text);

/// The text on one line of valid UTF-8: control characters and bytes that are no UTF-8 (file names may hold
/// both) become \xNN.
std::string single_line(const std::string& text);

}  // namespace sinew::tools
