#include "tools/terminal/progress.h"

#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>

#include "tools/support/text.h"

namespace sinew::tools {
namespace {

constexpr std::chrono::milliseconds kTerminalInterval{100};
constexpr std::chrono::seconds kLogInterval{10};

}  // namespace

std::string progress_line(const std::string& label, int done, int total, double seconds) {
  const double share = total > 0 ? static_cast<double>(done) / total : 1.0;
  std::string line = fmt::format("{}: {} %", label, static_cast<int>(100.0 * share));
  if (done > 0 && done < total)
    line += fmt::format(", {} left", duration_text(seconds * (1.0 / share - 1.0)));
  return line;
}

bool stderr_takes_colour() {
  const char* no_color = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  const bool dumb = term == nullptr || std::string_view(term) == "dumb";
  return isatty(STDERR_FILENO) != 0 && !dumb && (no_color == nullptr || *no_color == '\0');
}

Progress::Progress(std::string label, int total)
    : label_(std::move(label)),
      total_(total),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      last_print_(start_) {}

Progress::~Progress() { finish(); }

void Progress::update(int done) {
  const auto now = Clock::now();
  if (now - last_print_ < (terminal_ ? Clock::duration(kTerminalInterval) : Clock::duration(kLogInterval)))
    return;
  last_print_ = now;
  const std::string line =
      progress_line(label_, done, total_, std::chrono::duration<double>(now - start_).count());
  // "\033[K" clears the rest of the line: not a colour, so NO_COLOR does not concern it.
  if (terminal_) {
    std::fputs(("\r" + line + "\033[K").c_str(), stderr);
  } else {
    std::fputs((line + "\n").c_str(), stderr);
  }
  line_open_ = terminal_;
}

void Progress::finish() {
  if (line_open_) std::fputs("\r\033[K", stderr);
  line_open_ = false;
}

}  // namespace sinew::tools
