#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace sinew::tools {

/// Progress of one long piece of work, on stderr: on a terminal one line that is rewritten, with percentage
/// and time left; elsewhere (a pipe, a log) a plain line every ten seconds. Silent where the work is over
/// sooner.
class Progress {
 public:
  /// `total` units of work; >= 0.
  Progress(std::string label, int total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` units are finished, 0 <= done <= total.
  void update(int done);
  /// Clears the line on a terminal. The destructor does it too.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;

  std::string label_;
  int total_ = 0;
  bool terminal_ = false;
  bool line_open_ = false;
  Clock::time_point start_;
  Clock::time_point last_print_;
};

/// "hop: 40 %, 1 min 20 s left": the line for `done` of `total` after `seconds`; without an estimate while
/// nothing is done.
std::string progress_line(const std::string& label, int done, int total, double seconds);

/// True where text on stderr may be coloured: a terminal, and NO_COLOR unset or empty.
bool stderr_takes_colour();

}  // namespace sinew::tools
