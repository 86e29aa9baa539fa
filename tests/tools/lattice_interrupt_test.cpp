// A signal that asks `sinew lattice` to stop is heeded within the build, which takes minutes where cells are
// many.

#include <csignal>

#include <unistd.h>

#include <gmock/gmock.h>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

/// `sinew lattice` of a hundred thousand cells, half a minute's work, which is sent a signal as soon as it
/// has said how much memory it takes: the last that it does before it builds.
Outcome interrupted(const std::string& output, int signal) {
  int ends[2];
  Outcome outcome;
  if (pipe(ends) != 0) return outcome;
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    execl(SINEW_COMMAND, SINEW_COMMAND, "lattice", SINEW_SOURCE_DIR "/assets/samples/hopper.glb", "--cells",
          "100000", "-o", output.c_str(), nullptr);
    _exit(127);
  }
  close(ends[1]);
  char letter = 0;
  bool is_sent = false;
  while (::read(ends[0], &letter, 1) == 1) {
    outcome.text += letter;
    if (letter != '\n' || is_sent) continue;
    EXPECT_EQ(outcome.text, "about 0.22 GB of memory for 100000 cells\n");
    kill(child, signal);
    is_sent = true;
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

using LatticeInterrupt = Simulate;

TEST_F(LatticeInterrupt, StopsWithinTheBuildAndLeavesNothing) {
  for (const auto& [signal, name, code] : {std::tuple{SIGINT, "SIGINT", 130}, {SIGTERM, "SIGTERM", 143}}) {
    const Outcome outcome = interrupted(out("large.vtu").string(), signal);
    EXPECT_EQ(outcome.exit_code, code);
    // Not after it: nothing was drawn, written or kept.
    EXPECT_THAT(outcome.text,
                testing::EndsWith("stopped by " + std::string(name) + " while building the lattice\n"));
    EXPECT_EQ(num_entries(), 0);
  }
}

}  // namespace
}  // namespace sinew::tests
