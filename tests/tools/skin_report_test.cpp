// What a run says of its skin: the measures against another program's, the warning, --strict.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "assets/rig.h"
#include "fem/skin/skin_judge.h"
#include "skeleton/clip.h"
#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

using lattice::Points;

/// A sample at rest and its clip.
class Sample {
 public:
  explicit Sample(const std::string& name) {
    assets::LoadOptions options;
    options.importer_executable = SINEW_IMPORTER;
    rig_ =
        assets::load_rig((fs::path(SINEW_SOURCE_DIR) / "assets/samples" / (name + ".glb")).string(), options);
    int offset = 0;
    rest_.resize(assets::num_vertices(rig_), 3);
    std::vector<Eigen::RowVector3i> triangles;
    for (const assets::Part& part : rig_.parts) {
      rest_.middleRows(offset, part.points.rows()) = part.points;
      for (Eigen::Index t = 0; t < part.triangles.rows(); ++t)
        triangles.emplace_back(part.triangles.row(t).array() + offset);
      offset += static_cast<int>(part.points.rows());
    }
    triangles_.resize(static_cast<Eigen::Index>(triangles.size()), 3);
    for (std::size_t t = 0; t < triangles.size(); ++t)
      triangles_.row(static_cast<Eigen::Index>(t)) = triangles[t];
  }

  /// Plain skinning at a time after the clip's start [s].
  Points plain(double time) const {
    const skeleton::Clip& clip = rig_.clips[static_cast<std::size_t>(assets::choose_clip(rig_, ""))];
    return assets::skin(rig_, skeleton::pose_from_rest(
                                  rig_.skeleton, skeleton::sample(rig_.skeleton, clip, clip.start + time)));
  }
  /// Made-up flesh: plain skinning moved by waves of the rest shape, as stated with the figures below.
  Points waves(const Points& plain, double amplitude, double number) const {
    Points x = plain;
    const double a = amplitude * rig_.height, k = 2.0 * 3.14159265358979323846 * number / rig_.height;
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      const Eigen::RowVector3d r = rest_.row(i);
      x.row(i) += a * Eigen::RowVector3d(std::sin(k * r.y()), std::sin(k * r.z()), std::sin(k * r.x()) + 0.1);
    }
    return x;
  }

  const assets::Rig& rig() const { return rig_; }
  const Points& rest() const { return rest_; }
  const lattice::Triangles& triangles() const { return triangles_; }

 private:
  assets::Rig rig_;
  Points rest_;
  lattice::Triangles triangles_;
};

/// A made-up frame and what another program found in it.
struct Row {
  const char* sample;
  double amplitude, number;  ///< of the waves.
  double time;               ///< [s].
  fem::SkinFrame expected;
};

// Written independently in another language, with a singular value decomposition for every rotation, and fed
// with these frames as files of floats. The distance that 1 % exceed it does not have.
TEST(SkinReport, HasTheFiguresOfAnotherProgram) {
  const std::vector<Row> rows{
      {"arm",
       0.06,
       6,
       0.2,
       {0.3749639, 41, 1776, 78, 126, 12.568356, 0.644377, 1.063272, 0.096677, 0.0, 0.107159}},
      {"arm",
       0.06,
       6,
       0.4,
       {0.3761143, 43, 1786, 65, 113, 12.131209, 0.636417, 1.198893, 0.096677, 0.0, 0.107159}},
      {"hopper",
       0.02,
       5,
       0.2,
       {0.0008362, 6, 0, 9, 30, 1.001395, 0.185249, 0.997686, 0.032025, 0.0, 0.035736}},
      {"hopper",
       0.02,
       5,
       0.4,
       {0.0000000, 0, 0, 0, 10, 0.552237, 0.188196, 1.000551, 0.032025, 0.0, 0.035736}},
      {"patchwork",
       0.03,
       4,
       0.2,
       {0.0000000, 0, 0, 0, 0, 0.945057, 0.216497, 0.979921, 0.048376, 0.0, 0.053531}},
      {"patchwork",
       0.03,
       4,
       0.4,
       {0.0000000, 0, 0, 0, 1, 0.990802, 0.212178, 0.976940, 0.048376, 0.0, 0.053531}},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(std::string(row.sample) + " at " + std::to_string(row.time) + " s");
    const Sample sample(row.sample);
    const std::vector<Points> plain{sample.plain(0.2), sample.plain(0.4), sample.plain(0.6)};
    const std::vector<bool> all(static_cast<std::size_t>(sample.rest().rows()), true);
    fem::SkinJudge judge({sample.rest(), sample.triangles(), all, plain, sample.rig().height});
    const Points skinned = sample.plain(row.time);
    const fem::SkinFrame found =
        judge.measure(sample.waves(skinned, row.amplitude, row.number), skinned, fem::FrameKind::Later);
    EXPECT_EQ(found.flipped, row.expected.flipped);
    EXPECT_EQ(found.stretched, row.expected.stretched);
    EXPECT_EQ(found.squeezed, row.expected.squeezed);
    EXPECT_EQ(found.folds, row.expected.folds);
    // Its frames are floats: 6e-8 of a height, against edges of a hundredth of it, and six decimals are kept.
    EXPECT_NEAR(found.torn_area, row.expected.torn_area, 1e-6);
    EXPECT_NEAR(found.creases, row.expected.creases, 2e-6);
    EXPECT_NEAR(found.roughness, row.expected.roughness, 1e-5);
    EXPECT_NEAR(found.volume_ratio, row.expected.volume_ratio, 2e-6);
    EXPECT_NEAR(found.away_95, row.expected.away_95, 2e-6);
    EXPECT_NEAR(found.away_most, row.expected.away_most, 2e-6);
    EXPECT_LE(found.away_95, found.away_99);
    EXPECT_LE(found.away_99, found.away_most);
  }
}

// The report's figures are those of the files beside it against a run of plain skinning.
TEST_F(Simulate, ReportsTheSkinOfTheFramesThatItWrites) {
  const std::string flags = "--frames 0-6 --fps 10 --cells 100 --preview off --output-space si ";
  const nlohmann::json report = simulate("arm", "flesh", flags + "--young 4e3");
  simulate("arm", "plain", flags + "--model skin --offset 0");
  const assets::NamedMesh rest = assets::read_surface((out("flesh") / "skin.obj").string());
  const assets::Pc2Reader flesh((out("flesh") / "skin.pc2").string()),
      plain((out("plain") / "skin.pc2").string());
  const std::vector<bool> all(static_cast<std::size_t>(rest.points.rows()), true);
  const std::vector<Points> samples{plain.read(0).cast<double>(), plain.read(3).cast<double>(),
                                    plain.read(6).cast<double>()};
  fem::SkinJudge judge({rest.points, rest.triangles, all, samples, report["height_m"].get<double>()});
  std::vector<fem::SkinFrame> frames;
  for (int k = 0; k <= 6; ++k) {
    const fem::FrameKind kind = k == 0 ? fem::FrameKind::First : fem::FrameKind::Later;
    frames.push_back(judge.measure(flesh.read(k).cast<double>(), plain.read(k).cast<double>(), kind));
    const fem::SkinFrame& expected = frames.back();
    const nlohmann::json& frame = report["frames"][static_cast<std::size_t>(k)];
    const nlohmann::json& skin = frame["skin"];
    EXPECT_EQ(skin["flipped_triangles"], expected.flipped) << k;
    EXPECT_EQ(frame["flipped_triangles"], expected.flipped) << k;
    EXPECT_EQ(skin["stretched_triangles"], expected.stretched) << k;
    EXPECT_EQ(skin["squeezed_triangles"], expected.squeezed) << k;
    // Frames are floats of up to 1 m: 6e-8 of rounding, against edges of 2 cm or more 1e-5, and heights of
    // 0.1.
    EXPECT_NEAR(skin["roughness_edges"].get<double>(), expected.roughness, 1e-4) << k;
    EXPECT_NEAR(skin["volume_ratio"].get<double>(), expected.volume_ratio, 1e-5) << k;
    EXPECT_NEAR(skin["away_p99_heights"].get<double>(), expected.away_99, 1e-5) << k;
    EXPECT_NEAR(skin["away_largest_heights"].get<double>(), expected.away_most, 1e-5) << k;
    EXPECT_NEAR(skin["torn_area"].get<double>(), expected.torn_area, 1e-4) << k;
  }
  EXPECT_EQ(report["skin"]["verdict"], fem::name(fem::summarise(frames).judgement.verdict));
  EXPECT_EQ(report["skin"]["worst_frame"], fem::summarise(frames).worst_frame);
}

// Flesh a hundred times too soft hangs off its bones: a warning at the end, and by --strict a refusal in the
// same words that leaves nothing.
TEST_F(Simulate, WarnsOfTornSkinAndRefusesItWhenStrict) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const std::string command = "simulate " + quoted(rig) + " --frames 0-3 --cells 100 --preview off -o " +
                              quoted(out("run")) + " --young 300 --settle 20 --guard off";
  const Outcome warned = run(command_line(command));
  ASSERT_EQ(warned.exit_code, 0) << warned.text;
  const nlohmann::json report = nlohmann::json::parse(read(out("run") / "report.json"));
  ASSERT_EQ(report["skin"]["verdict"], "torn");
  const auto line = report["skin"]["line"].get<std::string>();
  const std::string last = "warning: " + line + "\n";
  ASSERT_GT(warned.text.size(), last.size());
  EXPECT_EQ(warned.text.substr(warned.text.size() - last.size()), last);
  EXPECT_NE(line.find("arm.glb: frame "), std::string::npos) << line;
  EXPECT_NE(line.find("the skin is torn at '"), std::string::npos) << line;
  EXPECT_NE(line.find("; hint: --"), std::string::npos) << line;
  // It has stretched along its bones, too, which plain skinning does not: a note before the warning.
  double farthest = 0.0, held = 1.0;
  for (const auto& frame : report["frames"]) {
    const double of_rest = frame["skin"]["volume_of_rest"], of_plain = frame["skin"]["volume_ratio"];
    const double off = std::min(std::abs(of_rest - 1.0), std::abs(of_plain - 1.0));
    if (off > farthest) farthest = off, held = of_rest;
  }
  EXPECT_GT(farthest, 0.05);
  const auto volume = report["skin"]["volume_line"].get<std::string>();
  std::array<char, 8> number{};
  std::snprintf(number.data(), number.size(), "%.2f", held);
  EXPECT_NE(volume.find("the skin holds " + std::string(number.data()) + " times its volume at rest"),
            std::string::npos)
      << volume;
  EXPECT_NE(warned.text.find("note: " + volume + "\n"), std::string::npos) << warned.text;

  fs::remove_all(out("run"));
  const Outcome refused = run(command_line(command + " --strict"));
  EXPECT_EQ(refused.exit_code, 4) << refused.text;
  EXPECT_EQ(refused.text.substr(refused.text.size() - line.size() - 1), line + "\n");
  EXPECT_FALSE(fs::exists(out("run")));
}

TEST_F(Simulate, KeepsFineSkinWhenStrictAndSaysNothingOfIt) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const Outcome outcome = run(command_line("simulate " + quoted(rig) +
                                           " --frames 0-3 --cells 100 --strict -o " + quoted(out("run"))));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(outcome.text.find("warning"), std::string::npos) << outcome.text;
  EXPECT_EQ(outcome.text.find("note"), std::string::npos) << outcome.text;
  EXPECT_EQ(nlohmann::json::parse(read(out("run") / "report.json"))["skin"]["verdict"], "fine");
}

// Soft flesh that is given no time: it still falls when the frames begin.
TEST_F(Simulate, SaysWhatDidNotSettleAndRefusesItWhenStrict) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const std::string command =
      "simulate " + quoted(rig) +
      " --frames 0-1 --cells 100 --model neo-hookean --young 300 --settle 0.02 --preview off -o " +
      quoted(out("run"));
  const Outcome warned = run(command_line(command));
  EXPECT_EQ(warned.exit_code, 0) << warned.text;
  EXPECT_NE(warned.text.find("not settled: the flesh of"), std::string::npos) << warned.text;
  fs::remove_all(out("run"));
  const Outcome refused = run(command_line(command + " --strict"));
  EXPECT_EQ(refused.exit_code, 4) << refused.text;
  EXPECT_NE(refused.text.find("not settled: the flesh of"), std::string::npos) << refused.text;
  EXPECT_FALSE(fs::exists(out("run")));
}

TEST_F(Simulate, JudgesThePosedSkinToo) {
  const fs::path rig = fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb";
  const std::string command = "pose " + quoted(rig) + " --cells 100 --time 0 -o " + quoted(out("pose"));
  const Outcome fine = run(command_line(command + " --strict"));
  EXPECT_EQ(fine.exit_code, 0) << fine.text;
  const nlohmann::json pose = nlohmann::json::parse(read(out("pose") / "pose.json"));
  EXPECT_EQ(pose["skin"]["verdict"], "fine") << pose["skin"];
  EXPECT_GT(pose["skin"]["away_largest_heights"].get<double>(), 0.0);
  fs::remove_all(out("pose"));
  const Outcome torn = run(command_line(command + " --guard off --young 300"));
  ASSERT_EQ(torn.exit_code, 0) << torn.text;
  EXPECT_NE(torn.text.find("warning: " + rig.string() + ": pose at 0 s: the skin is torn at"),
            std::string::npos)
      << torn.text;
  fs::remove_all(out("pose"));
  const Outcome refused = run(command_line(command + " --guard off --young 300 --strict"));
  EXPECT_EQ(refused.exit_code, 4) << refused.text;
  EXPECT_FALSE(fs::exists(out("pose")));
}

}  // namespace
}  // namespace sinew::tests
