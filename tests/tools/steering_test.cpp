// What a user can say about the lattice: how fine, where, and round which bones.

#include <algorithm>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/simulate_run.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Steering : public tests::Simulate {
 protected:
  /// One frame, the cheapest that there is.
  nlohmann::json look(const std::string& name, const std::string& flags) const {
    return simulate("hopper", name, "--levels 0 --settle 0 --frames 0-0 --preview off " + flags);
  }
  static int bones_named(const nlohmann::json& report, const std::string& start) {
    return static_cast<int>(std::count_if(
        report["lattice"]["bones"].begin(), report["lattice"]["bones"].end(),
        [&](const auto& bone) { return bone["name"].template get<std::string>().rfind(start, 0) == 0; }));
  }
  tests::Outcome refused(const std::string& flags) const {
    return tests::run(tests::command_line(
        "simulate " + tests::quoted(fs::path(SINEW_SOURCE_DIR) / "assets/samples/hopper.glb") + " -o " +
        tests::quoted(out("never")) + " " + flags));
  }
};

TEST_F(Steering, LeavesOutTheBonesThatAreExcluded) {
  const auto all = look("all", "--cells 200"),
             without = look("without", "--cells 200 --bones-exclude 'tail*,ear_?_l'");
  EXPECT_GT(bones_named(all, "tail"), 0);
  EXPECT_EQ(bones_named(without, "tail"), 0);
  EXPECT_FALSE(fs::exists(out("all") / "preview.png")) << "--preview off";
}

TEST_F(Steering, TakesTheEdgeOfTheCellsInsteadOfTheirNumber) {
  const auto coarse = look("coarse", "--cell-size 0.3"), fine = look("fine", "--cell-size 0.2");
  EXPECT_NEAR(coarse["lattice"]["edge_length_m"].get<double>(), 0.3, 1e-12);
  EXPECT_NEAR(fine["lattice"]["edge_length_m"].get<double>(), 0.2, 1e-12);
  EXPECT_GT(fine["lattice"]["cells"].get<int>(), coarse["lattice"]["cells"].get<int>());
}

TEST_F(Steering, NamesTheNearestBoneWhereAPatternFitsNone) {
  const tests::Outcome near = refused("--bones-exclude 'tial*'");
  EXPECT_EQ(near.exit_code, 2);
  EXPECT_EQ(near.text, "sinew: bones_exclude: no bone is named 'tial*'; hint: did you mean tail*?\n");
  const tests::Outcome far = refused("--bones-include xylophone");
  EXPECT_EQ(far.exit_code, 2);
  EXPECT_THAT(far.text,
              HasSubstr("bones_include: no bone is named 'xylophone', expected one of root, hips, spine,"));
  EXPECT_EQ(refused("--tip-bones none").text,
            "sinew: --tip-bones: got 'none', expected off or on; hint: off\n");
  EXPECT_THAT(refused("--lattice l.vtu --cell-size 0.1").text,
              HasSubstr("cell_size: got 0.1, expected nothing as the lattice is read from l.vtu"));
  EXPECT_FALSE(fs::exists(out("never")));
}

}  // namespace
}  // namespace sinew::tools
