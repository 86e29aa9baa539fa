#pragma once

#include <stdexcept>

/// What can end a run besides the errors of files, settings and limits (assets/error.h).
namespace sinew::tools {

/// The numerics failed, or a gate refused the result. One line with step, place and remedy.
class NumericalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The caller asked to stop. Thrown where stopping is clean; the message says how far the work had got.
class Stopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace sinew::tools
