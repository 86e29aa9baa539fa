// What a large lattice takes is said beforehand, and what there is no room for is refused.

#include <cstdlib>
#include <string>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gmock/gmock.h>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

using testing::HasSubstr;

class LatticeMemory : public Simulate {
 protected:
  const std::string rig_ = SINEW_SOURCE_DIR "/assets/samples/hopper.glb";

  Outcome lattice(const std::string& flags, const std::string& before = {}) const {
    return run(before + command_line("lattice " + tests::quoted(rig_) + " --preview off -o " +
                                     tests::quoted(out("never.vtu")) + " " + flags));
  }
};

/// Peak of the resident memory of `sinew lattice` [bytes], what it says in `file`.
double peak_bytes(const std::string& rig, const std::string& output, const std::string& file) {
  const pid_t child = fork();
  if (child == 0) {
    const int said = open(file.c_str(), O_CREAT | O_WRONLY, 0600);
    dup2(said, STDERR_FILENO);
    execl(SINEW_COMMAND, SINEW_COMMAND, "lattice", rig.c_str(), "--cell-size", "0.05", "--cache", "off",
          "--preview", "off", "-o", output.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  EXPECT_EQ(wait4(child, &status, 0, &usage), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << read(file);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);  // kilobytes on Linux
}

TEST_F(LatticeMemory, IsStatedWithinAFactorOfTwo) {
  const double peak = peak_bytes(rig_, out("large.vtu").string(), out("said").string());
  const std::string said = read(out("said"));
  ASSERT_THAT(said, testing::StartsWith("about "));
  const double stated = 1e9 * std::strtod(said.c_str() + 6, nullptr);
  // Measured 0.12 GB.
  EXPECT_GT(stated, 0.5 * peak) << "measured " << peak;
  EXPECT_LT(stated, 2.0 * peak) << "measured " << peak;
  // For as many cells as the builder makes of that size, to a quarter: measured 6 % apart.
  const std::size_t for_cells = said.find("memory for "), made = said.find("vtu: ");
  ASSERT_NE(for_cells, std::string::npos) << said;
  ASSERT_NE(made, std::string::npos) << said;
  const double cells = std::strtod(said.c_str() + made + 5, nullptr);
  EXPECT_NEAR(std::strtod(said.c_str() + for_cells + 11, nullptr), cells, 0.25 * cells);
}

TEST_F(LatticeMemory, LimitsCellsBySizeAsByNumber) {
  const Outcome tiny = lattice("--cell-size 0.001");
  EXPECT_EQ(tiny.exit_code, 6);
  EXPECT_THAT(tiny.text, testing::StartsWith("sinew: --cell-size: got 0.001, which makes about "));
  EXPECT_THAT(tiny.text, HasSubstr("; hint: 1000 cells suffice for most characters\n"));
  // 300 MB of address space: too little for 200 000 cells by either flag.
  for (const char* flags : {"--cells 200000", "--cell-size 0.015"}) {
    const Outcome refused = lattice(flags, "ulimit -v 300000; ");
    EXPECT_EQ(refused.exit_code, 6) << refused.text;
    EXPECT_THAT(refused.text, HasSubstr("GB of memory, the limit is 0.31 GB"));
  }
  EXPECT_FALSE(fs::exists(out("never.vtu")));
}

}  // namespace
}  // namespace sinew::tests
