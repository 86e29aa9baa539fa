#pragma once

#include <array>
#include <cstdio>
#include <string>

#include <sys/wait.h>

/// Commands run as a user runs them, through the shell.
namespace sinew::tests {

struct Outcome {
  int exit_code = -1;  ///< 128 + the signal's number where one ended it.
  std::string text;    ///< what comes out of stdout.
};

inline Outcome run_line(const std::string& line) {
  FILE* pipe = popen(line.c_str(), "r");
  Outcome outcome;
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.text.append(buffer.data(), n);
  const int status = pclose(pipe);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

}  // namespace sinew::tests
