// sinew lattice as the shell sees it, on a bundled sample.
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <sys/wait.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/temporary_path.h"

namespace sinew::tools {
namespace {

using testing::HasSubstr;

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

class LatticeCommand : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = tests::temporary_path("lattice_command");
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Runs `sinew lattice <rig> <arguments>` in the test's folder.
  Outcome run(const std::string& rig, const std::string& arguments) const {
    const std::string line =
        "cd '" + folder_ + "' && '" SINEW_COMMAND "' lattice '" + rig + "' " + arguments + " 2> err.txt";
    FILE* pipe = popen(line.c_str(), "r");
    Outcome outcome;
    std::array<char, 4096> buffer{};
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
      outcome.out.append(buffer.data(), n);
    const int status = pclose(pipe);
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128;
    std::ostringstream text;
    text << std::ifstream(folder_ + "/err.txt").rdbuf();
    outcome.err = text.str();
    std::filesystem::remove(folder_ + "/err.txt");
    return outcome;
  }
  int num_files() const {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) count += entry.is_regular_file();
    return count;
  }

  const std::string arm_ = SINEW_SOURCE_DIR "/assets/samples/arm.glb";
  std::string folder_;
};

TEST_F(LatticeCommand, WritesTheFileAndReportsAsJson) {
  const Outcome outcome = run(arm_, "-o arm.vtu --cells 200 --json");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("arm.vtu: "));
  EXPECT_THAT(outcome.err, HasSubstr("smallest dihedral angle"));
  const nlohmann::json json = nlohmann::json::parse(outcome.out);
  EXPECT_NEAR(static_cast<double>(json["cells"].size()), 200.0, 24.0);
  const auto num_vertices = static_cast<int>(json["vertices"].size());
  ASSERT_EQ(json["bones"].size(), 2u);
  for (const auto& bone : json["bones"]) {
    EXPECT_FALSE(bone["soft"].get<bool>());
    ASSERT_GE(bone["chain"].size(), 2u);
    for (const auto& v : bone["chain"]) EXPECT_LT(v.get<int>(), num_vertices);
    EXPECT_EQ(json["vertices"][bone["chain"][0].get<int>()], bone["start"]);
  }
  EXPECT_EQ(json["tip_bones"].size(), 1u);
  EXPECT_EQ(json["quality"]["skin_vertices_outside"], 0);
  EXPECT_EQ(num_files(), 2);  // and the picture
  std::ifstream picture(folder_ + "/arm.vtu.png", std::ios::binary);
  std::string magic(8, ' ');
  picture.read(magic.data(), 8);
  EXPECT_EQ(magic, "\x89PNG\r\n\x1a\n");
}

TEST_F(LatticeCommand, KeepsAFileThatIsThereUnlessToldOtherwise) {
  std::ofstream(folder_ + "/arm.mesh") << "precious";
  const Outcome refused = run(arm_, "-o arm.mesh --cells 100");
  EXPECT_EQ(refused.exit_code, 7);
  EXPECT_EQ(refused.err, "sinew: arm.mesh: is there already; hint: give --overwrite or another name\n");
  EXPECT_EQ(std::filesystem::file_size(folder_ + "/arm.mesh"), 8u);
  EXPECT_EQ(run(arm_, "-o arm.mesh --cells 100 --overwrite").exit_code, 0);
  EXPECT_GT(std::filesystem::file_size(folder_ + "/arm.mesh"), 1000u);
}

TEST_F(LatticeCommand, RefusesBadValuesWithOneLineAndNoFile) {
  const std::pair<const char*, std::pair<int, const char*>> cases[] = {
      {"-o arm.stl",
       {2, "sinew: arm.stl: extension, got '.stl', expected .vtu, .vtk, .msh, .mesh, .node, .ele or .veg\n"}},
      {"-o a.msh --format vtk", {2, "sinew: format: got 'vtk', which does not fit the extension '.msh'\n"}},
      {"-o a.msh --snap-tolerance 2",
       {2, "sinew: --snap-tolerance: got 2, expected 1e-12 <= tolerance <= 0.1; hint: 1e-4\n"}},
      {"-o a.vtu --cells 3", {2, "sinew: --cells: got 3, expected 20 <= cells <= 1000000; hint: 1000\n"}},
      {"-o a.vtu --cells 2000000",
       {6,
        "sinew: --cells: got 2000000, the limit is 1000000 cells; that many would need at least 6 GB of "
        "memory; "
        "hint: 1000 cells suffice for most characters\n"}},
      {"-o a.vtu --height -1",
       {2, "sinew: --height: got -1, expected 0.001 <= height <= 10000 m; hint: 1.8\n"}}};
  for (const auto& [arguments, expected] : cases) {
    const Outcome outcome = run(arm_, arguments);
    EXPECT_EQ(outcome.exit_code, expected.first) << arguments;
    EXPECT_EQ(outcome.err, expected.second);
    EXPECT_EQ(num_files(), 0);
  }
}

}  // namespace
}  // namespace sinew::tools
