#pragma once

#include <stdexcept>
#include <string>

namespace sinew::assets {

/// A file is wrong (exit code 3). One line: "<file>: <thing>: <what>, got <value>, expected <range>; hint:
/// <remedy>".
class InputError : public std::runtime_error {
 public:
  /// `file` as the user gave it; `message` names the thing in it, what is wrong and the remedy.
  InputError(const std::string& file, const std::string& message)
      : std::runtime_error(file + ": " + message) {}
};

/// A flag or a key of the scene is wrong (exit code 2).
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reading or writing failed: missing file, no permission, disk full (exit code 5).
class IoError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A stated limit was reached: memory, time, counts (exit code 6).
class LimitError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The output is there already or in use (exit code 7).
class BusyError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace sinew::assets
