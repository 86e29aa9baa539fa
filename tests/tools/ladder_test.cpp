// sinew ladder: its choices on made-up runs, and one small grid as the shell sees it.

#include "tools/ladder/ladder.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/figure.h"
#include "fem/models/model.h"
#include "tests/tools/simulate_run.h"
#include "tools/ladder/ladder_cost.h"
#include "tools/ladder/ladder_report.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

LadderRun made(const std::string& rung, int level, double per_frame, double error) {
  LadderRun run;
  run.rung = rung;
  run.level = level;
  run.step = 0.01;
  run.per_frame = per_frame;
  run.error.rms = error / 2;
  run.error.largest = error;
  run.error.frames = {{0, error / 2, error, 0}};
  run.phases = {{"assemble", 0.5}};
  return run;
}

TEST(Ladder, ChoosesTheCheapestRunWithinATolerance) {
  Ladder ladder;
  ladder.runs = {made("skin", 1, 0.001, 0.1), made("blended", 1, 0.01, 0.02), made("blended", 2, 0.05, 0.015),
                 made("blended", 3, 0.5, 0.0)};
  ladder.runs[0].failure = "it diverged";
  ladder.reference = 3;
  EXPECT_EQ(ladder.cheapest_within(0.2), 1) << "a failed run is no choice";
  EXPECT_EQ(ladder.cheapest_within(0.02), 1);
  EXPECT_EQ(ladder.cheapest_within(0.019), 2);
  EXPECT_EQ(ladder.cheapest_within(0.001), -1) << "the reference says nothing of itself";
}

TEST(Ladder, HasConvergedOnlyWhereBothNeighboursAreNear) {
  Ladder ladder;
  ladder.height = 2.0;
  ladder.limit = 0.01;
  ladder.runs = {made("blended", 1, 0.1, 0.0)};
  ladder.reference = 0;
  EXPECT_FALSE(ladder.converged());
  EXPECT_THAT(reference_text(ladder), HasSubstr("Whether it has converged is not shown"));
  ladder.neighbours = {{"one level less", 0, 0.019}, {"the next longer step", 0, 0.02}};
  EXPECT_TRUE(ladder.converged());
  EXPECT_THAT(reference_text(ladder),
              HasSubstr("With one level less it moves by 19 mm rms (0.95 % of the height)."));
  ladder.neighbours[1].rms = 0.021;
  EXPECT_FALSE(ladder.converged());
  EXPECT_THAT(reference_text(ladder), HasSubstr("NOT converged"));
}

// 0.5 s, 150 steps of 0.01 s and 31 frames of 0.002 s. Eight times the vertices: sixteen times the entries of
// a factor, 8^(4/3).
TEST(LadderClock, AddsUpWhatARunTakes) {
  const RungCost cost{0.5, 0.01, 0.002, 1000.0, true};
  EXPECT_NEAR(cost.of_run(150.0, 31.0), 0.5 + 1.5 + 0.062, 1e-12);
  const RungCost finer = cost.scaled_to(8000.0);
  EXPECT_NEAR(finer.of_run(150.0, 31.0), 8.0 * 0.5 + 16.0 * 1.5 + 8.0 * 0.062, 1e-12);
  EXPECT_FALSE(finer.timed);
}

TEST(LadderClock, IsPutRightByTheRunsThatAreOver) {
  // The third is there already.
  LadderClock clock({{"skin", 1, 10.0}, {"skin", 2, 100.0}, {"blended", 1, 0.0}, {"blended", 2, 1000.0}});
  EXPECT_NEAR(clock.left(), 1110.0, 1e-9);
  EXPECT_EQ(clock.dearest(), "blended, level 2");
  EXPECT_EQ(
      estimate_line(clock, 3, true),
      "about 18 min 30 s for 3 runs, most of it blended, level 2; hint: fewer --frames, --cells, --rungs "
      "or --levels, or longer --steps");
  // Three times as long, and so will the other be of its rung; of all 1110 s they are not much.
  clock.finish(0, 30.0);
  EXPECT_NEAR(clock.left(), 300.0 + 1000.0 * 1130.0 / 1110.0, 1e-9);
  clock.finish(1, 80.0);  // together 110 s, as was expected
  EXPECT_NEAR(clock.left(), 1000.0, 1e-9);
  clock.finish(3, 5.0);
  EXPECT_EQ(clock.left(), 0.0);
  EXPECT_EQ(clock.dearest(), "");
}

TEST(LadderClock, BelievesARungsOwnRunsMoreThanThoseOfOthers) {
  LadderClock clock({{"skin", 1, 10.0}, {"blended", 1, 10.0}, {"blended", 2, 100.0}, {"stvk", 1, 1.0}});
  clock.finish(0, 40.0);
  clock.finish(1, 5.0);
  EXPECT_NEAR(clock.left(), 100.0 * 0.5 + 1.0 * 146.0 / 121.0, 1e-9);
  EXPECT_EQ(estimate_line(clock, 1, false),
            "about 51 s for 1 run (fine levels scaled from coarser ones), most of it blended, level 2");
}

TEST(Ladder, EscapesWhatItPutsIntoThePage) {
  Ladder ladder;
  ladder.height = 1.0;
  ladder.runs = {made("blended", 1, 0.1, 0.0), made("skin", 1, 0.01, 0.1)};
  ladder.runs[1].failure = "<script>alert(\"&\")</script>";
  ladder.reference = 0;
  const std::string html = ladder_html(ladder, "a <b>", "young = 1", {});
  EXPECT_THAT(html, HasSubstr("failed: &lt;script&gt;alert(&quot;&amp;&quot;)&lt;/script&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("<script>")));
}

// Half of the costs and half of the errors stand at half of the axis: log(10) of log(100).
TEST(Ladder, DrawsErrorAgainstCostOnLogarithmicAxes) {
  Ladder ladder;
  ladder.height = 1.0;
  ladder.runs = {made("skin", 1, 0.001, 0.2), made("blended", 1, 0.01, 0.02), made("blended", 2, 0.1, 0.002),
                 made("blended", 3, 0.1, 0.0)};
  ladder.reference = 3;
  std::vector<Eigen::Vector2d> centres;
  for (const auto& mark : error_cost_figure(ladder).marks) {
    const auto* disc = std::get_if<assets::FigureDisc>(&mark);
    if (disc != nullptr && !disc->tip.empty()) centres.push_back(disc->centre);
  }
  ASSERT_EQ(centres.size(), 4u);
  EXPECT_NEAR((centres[0] + centres[2] - 2.0 * centres[1]).norm(), 0.0, 1e-9);
  EXPECT_LT(centres[0].x(), centres[2].x());
  EXPECT_LT(centres[0].y(), centres[2].y()) << "less error is lower";
}

TEST(Figure, IsTheSameAsSvgAndAsPicture) {
  assets::Figure figure{40, 20, {}};
  figure.marks.emplace_back(assets::FigureBox{{10, 5}, {20, 15}, {1.0, 0.0, 0.0}, "a & b"});
  figure.marks.emplace_back(assets::FigureText{{5, 10}, "<x>", assets::TextAnchor::Middle, 12.0, {0, 0, 0}});
  const std::string svg = assets::svg_text(figure);
  EXPECT_THAT(svg, HasSubstr("<rect x=\"10.00\" y=\"5.00\" width=\"10.00\" height=\"10.00\" fill=\"#ff0000\">"
                             "<title>a &amp; b</title></rect>"));
  EXPECT_THAT(svg, HasSubstr("text-anchor=\"middle\""));
  EXPECT_THAT(svg, HasSubstr(">&lt;x&gt;</text>"));
  const assets::Image image = assets::draw_figure(figure, 2);
  EXPECT_EQ(image.width, 80);
  const auto pixel = [&](int x, int y) {
    return image.rgb[static_cast<std::size_t>(3 * (y * image.width + x) + 1)];
  };
  EXPECT_EQ(pixel(39, 29), 0) << "the last pixel of the red box";
  EXPECT_EQ(pixel(40, 29), 255) << "beside it";
  EXPECT_EQ(assets::png_data_uri(image).rfind("data:image/png;base64,iVBORw0KGgo", 0), 0u);
}

class LadderCommand : public tests::Simulate {
 protected:
  tests::Outcome ladder(const std::string& arguments) const {
    return tests::run(tests::command_line("ladder " + arguments));
  }
  std::string scene() const {
    const fs::path path = out("scene.toml");
    std::ofstream(path)
        << "young = 5e4\nframes = \"0-3\"\nsettle = 0\n[lattice]\nbox = [1, 0.2, 0.2]\ncells = [4, 1, 1]\n"
           "[[bone]]\nname = \"a\"\nstart = [0, 0, 0]\nend = [0.5, 0, 0]\n"
           "keys = [{ time = 0 }, { time = 0.1, angle = 20 }]\n";
    return tests::quoted(path);
  }
};

TEST_F(LadderCommand, RunsTheGridOnceAndChoosesARunForATolerance) {
  const std::string arguments =
      scene() + " --rungs skin,blended --levels 1,2 --steps 1/60,1/120 -o " + tests::quoted(out("ladder"));
  const tests::Outcome first = ladder(arguments + " --tolerance 50%");
  ASSERT_EQ(first.exit_code, 0) << first.text;
  EXPECT_THAT(first.text, HasSubstr("reference: blended, level 2, 1/120 s, the finest run that worked."));
  EXPECT_THAT(first.text, Not(HasSubstr("was there")));
  EXPECT_THAT(first.text,
              ContainsRegex("^about [0-9]+ s for 8 runs, most of it blended, level [12]\n\\[1/8\\] "
                            "skin, level 1, 1/60 s: [0-9.e-]+ ms per frame; [0-9]+ s left\n"));
  EXPECT_THAT(first.text, ContainsRegex("\\[8/8\\] blended, level 2, 1/120 s: [0-9.]+ ms per frame\n"));
  const auto json = nlohmann::json::parse(tests::read(out("ladder") / "ladder.json"));
  ASSERT_EQ(json["runs"].size(), 8u);
  const auto& reference = json["runs"][json["reference"].get<std::size_t>()];
  EXPECT_EQ(reference["rms_m"], 0.0);
  EXPECT_EQ(reference["step_s"], 1.0 / 120.0);
  EXPECT_EQ(reference["error_over_time"].size(), 4u);
  EXPECT_EQ(json["neighbours"].size(), 2u);
  for (const auto& run : json["runs"]) EXPECT_GT(run["ms_per_frame"].get<double>(), 0.0);
  // Its own word: the command that compares two results.
  const std::string other = json["runs"][4]["folder"];
  const auto compared = nlohmann::json::parse(
      tests::run(tests::command_line("compare --json " +
                                     tests::quoted(reference["folder"].get<std::string>()) + " " +
                                     tests::quoted(other)))
          .text);
  EXPECT_EQ(compared["rms_m"], json["runs"][4]["rms_m"]);
  const std::string html = tests::read(out("ladder") / "ladder.html");
  EXPECT_THAT(html, HasSubstr("<svg xmlns"));
  EXPECT_THAT(html, HasSubstr("data:image/png;base64,"));
  EXPECT_THAT(html, Not(HasSubstr("src=\"http")));
  for (const char* name : {"error_cost.png", "error_time.png", "phases.png"})
    EXPECT_GT(fs::file_size(out("ladder") / name), 1000u) << name;

  const tests::Outcome again = ladder(arguments + " --tolerance 0.001mm");
  EXPECT_EQ(again.exit_code, 8);
  EXPECT_THAT(
      again.text,
      HasSubstr("sinew: --tolerance: no run but the reference itself has a largest error of at most 1 um"));
  EXPECT_FALSE(fs::exists(out("ladder") / "chosen.toml")) << "that of the tolerance before";
  std::size_t reused = 0;
  for (std::size_t at = 0; (at = again.text.find("(was there)", at)) != std::string::npos; ++at) ++reused;
  EXPECT_EQ(reused, 8u);
  EXPECT_THAT(again.text, Not(HasSubstr("about"))) << "what is there takes no time";
  EXPECT_EQ(nlohmann::json::parse(tests::read(out("ladder") / "ladder.json")), json)
      << "costs are those of the runs";

  ASSERT_EQ(ladder(arguments + " --tolerance 50%").exit_code, 0);
  const tests::Outcome chosen = tests::run(
      tests::command_line("simulate " + tests::quoted(out("ladder") / "chosen.toml") + " --preview off"));
  EXPECT_EQ(chosen.exit_code, 0) << chosen.text;
}

TEST_F(LadderCommand, RunsEveryRungAndTakesTheHighestAsReference) {
  const tests::Outcome outcome =
      ladder(scene() + " --levels 0,1 --steps 1/60,1/30 --frames 0-2 -o " + tests::quoted(out("ladder")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("reference: neo-hookean, level 1, 1/60 s"));
  const auto json = nlohmann::json::parse(tests::read(out("ladder") / "ladder.json"));
  ASSERT_EQ(json["runs"].size(), 4u * fem::models().size());
  EXPECT_EQ(json["neighbours"].size(), 2u);
  const std::string html = tests::read(out("ladder") / "ladder.html");
  for (std::size_t k = 0; k < json["runs"].size(); ++k) {
    const auto& run = json["runs"][k];
    const std::string rung(fem::models()[k / 4].name);
    EXPECT_EQ(run["rung"], rung);
    EXPECT_TRUE(fs::exists(fs::path(run["folder"].get<std::string>()) / "skin.pc2")) << rung;
    EXPECT_THAT(html, HasSubstr(rung));
  }
  // The bar is linear at this bend of 20 degrees, and its bones alone move it by 17 cm: whatever the rung,
  // the same within a tenth of that; `skin`, which has no inertia, is 2.5 cm away.
  for (const auto& run : json["runs"])
    EXPECT_LT(run["rms_m"].get<double>(), run["rung"] == "skin" ? 0.03 : 0.02) << run["rung"];
}

TEST_F(LadderCommand, RunsAgainWhereTheSceneHasChanged) {
  const std::string arguments = " --rungs skin --levels 1 --steps 1/60 -o " + tests::quoted(out("ladder"));
  const std::string file = scene();
  EXPECT_EQ(ladder(file + arguments).exit_code, 0);
  EXPECT_THAT(ladder(file + arguments).text, HasSubstr("was there"));
  EXPECT_THAT(ladder(file + arguments + " --frames 0-2").text, Not(HasSubstr("was there")));
}

// Flesh that is squeezed to nothing is beyond StVK's law. That is an answer too: it is kept and not sought
// again.
TEST_F(LadderCommand, KeepsWhatFailedAndRunsTheRest) {
  const fs::path path = out("crushed.toml");
  std::ofstream(path)
      << "young = 5e4\nframes = \"0-6\"\nsettle = 0.1\n[lattice]\nbox = [1, 0.2, 0.2]\ncells = [4, 1, 1]\n"
         "[[bone]]\nname = \"anvil\"\nstart = [0, 0, 0]\nend = [0.25, 0, 0]\n"
         "[[bone]]\nname = \"press\"\nstart = [1, 0, 0]\nend = [0.75, 0, 0]\n"
         "keys = [{ time = 0 }, { time = 0.2, move = [-0.6, 0, 0] }]\n"
         "[[point_load]]\nat = [0.5, 0.2, 0.1]\nforce = [0, -0.2, 0]\n"
         "[[face_load]]\nface = \"z-max\"\npressure = 100\n";
  const std::string arguments = tests::quoted(path) +
                                " --rungs stvk,neo-hookean --levels 1 --steps 1/60,1/120 -o " +
                                tests::quoted(out("ladder"));
  const tests::Outcome first = ladder(arguments);
  ASSERT_EQ(first.exit_code, 0) << first.text;
  EXPECT_THAT(first.text,
              ContainsRegex("stvk, level 1, 1/60 s: failed: .*crushed.toml: frame [0-9]: stvk: collapsed"));
  EXPECT_THAT(first.text, HasSubstr("reference: neo-hookean, level 1, 1/120 s"));
  const auto json = nlohmann::json::parse(tests::read(out("ladder") / "ladder.json"));
  EXPECT_THAT(json["runs"][0]["failure"].get<std::string>(), HasSubstr("leaf cell"));
  EXPECT_GT(json["runs"][2]["rms_m"].get<double>(), 0.0);
  const tests::Outcome again = ladder(arguments);
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_THAT(again.text, HasSubstr(json["runs"][0]["failure"].get<std::string>() + " (was there)"));
  EXPECT_EQ(nlohmann::json::parse(tests::read(out("ladder") / "ladder.json")), json);
}

TEST_F(LadderCommand, SaysWhatIsWrongWithItsFlags) {
  const std::string output = " -o " + tests::quoted(out("ladder"));
  const tests::Outcome rung = ladder(scene() + output + " --rungs skin,blendde");
  EXPECT_EQ(rung.exit_code, 2);
  EXPECT_THAT(rung.text, HasSubstr("sinew: --rungs: got 'blendde', expected one of skin,"));
  EXPECT_THAT(rung.text, HasSubstr("hint: blended"));
  EXPECT_EQ(ladder(scene() + output + " --levels 1,7").text,
            "sinew: --levels: got 7, expected 0 <= levels <= 3; hint: 1\n");
  EXPECT_THAT(ladder(scene() + output + " --steps 0").text,
              HasSubstr("sinew: --steps: got 0, expected 1e-06 <= h <= 0.1 s"));
  EXPECT_THAT(ladder(scene() + output + " --levels ,").text,
              HasSubstr("--levels: got nothing, expected values with commas"));
  EXPECT_THAT(ladder(scene() + output + " --tolerance 3").text,
              HasSubstr("--tolerance: got '3', expected a positive length"));
  EXPECT_EQ(ladder(tests::quoted(out("missing.glb")) + output).exit_code, 5);
  EXPECT_FALSE(fs::exists(out("ladder"))) << "nothing ran";
}

}  // namespace
}  // namespace sinew::tools
