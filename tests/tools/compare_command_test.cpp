// sinew compare as the shell sees it, on results made by hand: their distances are known.

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/sidecar.h"
#include "tests/tools/simulate_run.h"
#include "tools/ladder/comparison.h"
#include "tools/ladder/tolerance.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;
using lattice::Points;
using testing::HasSubstr;

struct Made {
  double metres_per_unit = 1.0;
  assets::UpAxis up = assets::UpAxis::Y;
  double fps = 30.0;
  int first_frame = 0;
};

class Compare : public tests::Simulate {
 protected:
  /// Four points, 2 m tall.
  static Points rest() {
    Points p(4, 3);
    p << 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1;
    return p;
  }

  /// An output folder as a run leaves it; `frames` and `rest` in its units and axes.
  std::string result(const std::string& name, const Points& rest, const std::vector<Points>& frames,
                     const Made& made = {}) const {
    fs::create_directory(out(name));
    lattice::Triangles triangles(2, 3);
    triangles << 0, 1, 2, 0, 2, 3;
    std::ofstream(out(name) / "skin.obj") << assets::obj_text({{"body", rest, triangles}});
    assets::Pc2Writer writer((out(name) / "skin.pc2").string(), static_cast<int>(rest.rows()),
                             made.first_frame);
    for (const Points& frame : frames) writer.write(frame);
    writer.finish();
    assets::Sidecar sidecar;
    sidecar.rest_mesh = "skin.obj";
    sidecar.rest = assets::to_float(rest);
    sidecar.parts = {{"body", static_cast<int>(rest.rows())}};
    sidecar.fps = made.fps;
    sidecar.first_frame = made.first_frame;
    sidecar.num_frames = static_cast<int>(frames.size());
    sidecar.metres_per_unit = made.metres_per_unit;
    sidecar.up_axis = made.up;
    std::ofstream(out(name) / "skin.json") << assets::sidecar_json(sidecar);
    return out(name).string();
  }

  static Points moved(Points points, int vertex, const Eigen::RowVector3d& by) {
    points.row(vertex) += by;
    return points;
  }

  tests::Outcome compare_text(const std::string& a, const std::string& b,
                              const std::string& flags = {}) const {
    return tests::run(
        tests::command_line("compare " + tests::quoted(a) + " " + tests::quoted(b) + " " + flags));
  }
};

TEST_F(Compare, FindsTheWorstVertexAndFrameInMetresAndShareOfTheHeight) {
  const std::string a = result("a", rest(), {rest(), rest(), rest()});
  // 0.5 m = 25 % of the height of 2 m; over four vertices of three frames rms = 0.5 / sqrt(12).
  const std::string b = result("b", rest(), {rest(), moved(rest(), 2, {0.3, 0.0, 0.4}), rest()});
  const tests::Outcome outcome = compare_text(a, b, "--json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto json = nlohmann::json::parse(outcome.text);
  EXPECT_EQ(json["worst_vertex"], 2);
  EXPECT_EQ(json["worst_frame"], 1);
  // Floats of size 1: their rounding is 6e-8.
  EXPECT_NEAR(json["largest_m"].get<double>(), 0.5, 1e-7);
  EXPECT_NEAR(json["largest_percent"].get<double>(), 25.0, 1e-5);
  EXPECT_NEAR(json["rms_m"].get<double>(), 0.5 / std::sqrt(12.0), 1e-7);
  EXPECT_NEAR(json["frames"][1]["rms_m"].get<double>(), 0.25, 1e-7);
  EXPECT_EQ(json["frames"][2]["largest_m"], 0.0);
  EXPECT_EQ(json.count("within_limit"), 0u);
  EXPECT_THAT(compare_text(a, b).text,
              HasSubstr("largest: 0.5 m (25 % of the height) at vertex 2 in frame 1"));
}

TEST_F(Compare, LeavesWithEightOverTheLimitAndWithZeroBelow) {
  const std::string a = result("a", rest(), {rest(), rest()});
  const std::string b = result("b", rest(), {rest(), moved(rest(), 3, {0.0, 0.02, 0.0})});
  EXPECT_EQ(compare_text(a, b, "--limit 21mm").exit_code, 0);
  EXPECT_EQ(compare_text(a, b, "--limit 1.1%").exit_code, 0);
  const tests::Outcome over = compare_text(a, b, "--limit 0.9%");
  EXPECT_EQ(over.exit_code, 8);
  EXPECT_THAT(over.text, HasSubstr("sinew: " + b + ": frame 1: vertex 3 lies 20 mm from where " + a +
                                   " has it, expected at most 18 mm (0.9 % of the height)\n"));
  const std::string data_only =
      "(" + tests::command_line("compare --json --limit 1cm " + tests::quoted(a) + " " + tests::quoted(b)) +
      " 2>/dev/null)";
  EXPECT_EQ(nlohmann::json::parse(tests::run(data_only).text)["within_limit"], false);
}

TEST_F(Compare, SeesThatCentimetresWithZUpAreTheSameCharacter) {
  const std::string a = result("a", rest(), {moved(rest(), 1, {0.0, 0.5, 0.0})});
  // (x, y, z) of Y up is (x, -z, y) of Z up.
  Eigen::Matrix3d z_up;
  z_up << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const auto file = [&](const Points& p) -> Points { return 100.0 * (p * z_up.transpose()); };
  const std::string b =
      result("b", file(rest()), {file(moved(rest(), 1, {0.0, 0.5, 0.0}))}, {0.01, assets::UpAxis::Z});
  EXPECT_EQ(compare_text(a, b, "--limit 1um").exit_code, 0);
}

TEST_F(Compare, ComparesTheFramesThatBothHave) {
  const std::string a = result("a", rest(), {moved(rest(), 0, {9.0, 0.0, 0.0}), rest(), rest()});
  const std::string b = result("b", rest(), {rest(), rest()}, {.first_frame = 1});
  const tests::Outcome outcome = compare_text(a, b, "--limit 1um");
  EXPECT_EQ(outcome.exit_code, 0) << "frame 0, where they differ, is in one of them only";
  EXPECT_THAT(outcome.text, HasSubstr("warning: only the 2 frames 1 to 2 are in both"));
}

TEST_F(Compare, RefusesWhatIsNoResultOfTheSameMesh) {
  const std::string a = result("a", rest(), {rest()});
  const std::string fewer = result("fewer", rest().topRows(4).replicate(2, 1), {rest().replicate(2, 1)});
  EXPECT_EQ(compare_text(a, fewer).exit_code, 3);
  EXPECT_EQ(compare_text(a, fewer).text, "sinew: " + fewer + ": vertices: got 8, expected 4 as in " + a +
                                             "; hint: compare results of one rig\n");
  const std::string other = result("other", moved(rest(), 1, {0.0, 0.0, 0.001}), {rest()});
  EXPECT_EQ(compare_text(a, other).exit_code, 3);
  EXPECT_THAT(compare_text(a, other).text, HasSubstr("other: rest shape: vertex 1 lies 0.001 m from where"));
  const std::string slow = result("slow", rest(), {rest()}, {.fps = 24.0});
  EXPECT_EQ(compare_text(a, slow).exit_code, 3);
  EXPECT_THAT(compare_text(a, slow).text, HasSubstr("slow: frames per second: got 24, expected 30 as in"));
  const std::string late = result("late", rest(), {rest()}, {.first_frame = 7});
  EXPECT_EQ(compare_text(a, late).exit_code, 3);
  EXPECT_THAT(compare_text(a, late).text,
              HasSubstr("late: frames: got 7 to 7, expected some of 0 to 0 as in"));
}

TEST_F(Compare, TakesABareCacheInMetres) {
  const std::string a = result("a", rest(), {rest()});
  fs::copy_file(out("a") / "skin.pc2", out("bare.pc2"));
  const tests::Outcome outcome = compare_text(a, out("bare.pc2").string(), "--limit 1um");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, HasSubstr("bare.pc2: no sidecar, its units are taken as metres"));
}

TEST_F(Compare, SaysWhichFileIsMissingOrDamaged) {
  const std::string a = result("a", rest(), {rest()});
  EXPECT_EQ(compare_text(a, out("nothing").string()).exit_code, 5);
  EXPECT_THAT(compare_text(a, out("nothing").string()).text, HasSubstr("nothing: not found ("));
  fs::create_directory(out("empty"));
  EXPECT_THAT(compare_text(a, out("empty").string()).text, HasSubstr("hint: is the folder the output of"));
  const std::string b = result("b", rest(), {rest()});
  std::ofstream(out("b") / "skin.json") << "{\"format\": \"sinew-cache\", \"fps\": 30}";
  EXPECT_EQ(compare_text(a, b).exit_code, 3);
  EXPECT_THAT(compare_text(a, b).text,
              HasSubstr("skin.json: /units/metres_per_unit: missing or of the wrong type"));
  const std::string c = result("c", rest(), {rest()});
  fs::resize_file(out("c") / "skin.pc2", 50);
  EXPECT_EQ(compare_text(a, c).exit_code, 3);
  EXPECT_EQ(tests::run("mkfifo " + tests::quoted(out("pipe")) + " && " +
                       tests::command_line("compare " + tests::quoted(a) + " " + tests::quoted(out("pipe"))))
                .exit_code,
            5)
      << "must not wait for a writer";
}

TEST_F(Compare, RefusesALimitWithoutUnit) {
  const tests::Outcome outcome = compare_text("a", "b", "--limit 2");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.text,
            "sinew: --limit: got '2', expected a positive length in um, mm, cm or m, or a percentage of the "
            "height; "
            "hint: 2mm or 0.5%\n");
  for (const char* text : {"-1mm", "0%", "nan m", "1e999m", "mm", "2 inch", ""})
    EXPECT_THROW(parse_tolerance(text, "x"), assets::ConfigError) << text;
  EXPECT_EQ(parse_tolerance("0.5 %", "x"), (Tolerance{0.005, true}));
  EXPECT_DOUBLE_EQ(parse_tolerance("2mm", "x").metres(1.8), 0.002);
  EXPECT_DOUBLE_EQ(parse_tolerance("1%", "x").metres(1.8), 0.018);
}

}  // namespace
}  // namespace sinew::tools
