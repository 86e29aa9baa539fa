#pragma once

#include <functional>
#include <string>
#include <string_view>

/// Who asks for long work: where its words go, and how it is stopped.
namespace sinew::tools {

/// Called with one line for whatever the user should hear: warnings, what was chosen, what was done.
using Talk = std::function<void(const std::string& line)>;

/// Each part may be left empty: then nobody listens, and nobody stops the work.
struct Caller {
  Talk talk;
  /// `done` of `total` units of a piece of work are finished; the last call has done == total.
  std::function<void(std::string_view work, int done, int total)> progress;
  /// Asked between steps, from the calling thread: why to stop, as "SIGINT"; empty: go on.
  std::function<std::string()> stop;

  /// `talk`, or words to nobody.
  Talk words() const;
  void report(std::string_view work, int done, int total) const;
  bool wants_to_stop() const;
  /// Throws Stopped with "stopped by <why> <where>" where the work is to stop.
  void stop_if_asked(const std::string& where) const;
};

}  // namespace sinew::tools
