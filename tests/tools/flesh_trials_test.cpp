// Public trials of flesh that went wrong once: what hangs beyond its bone, falls, jumps, bends and twists.

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <utility>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

using Frames = std::vector<Eigen::MatrixX3d>;

double largest(const Eigen::MatrixX3d& difference) { return difference.rowwise().norm().maxCoeff(); }

class FleshTrials : public Simulate {
 protected:
  Frames frames_of(const std::string& trial, const std::string& name, const std::string& flags) {
    const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public/trials" / trial;
    EXPECT_TRUE(fs::exists(rig)) << rig << " is missing";
    const Outcome outcome =
        run(command_line("simulate " + quoted(rig) + " -o " + quoted(out(name)) + " --preview off " + flags));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    said_ = outcome.text;
    Frames frames;
    const assets::Pc2Reader cache((out(name) / "skin.pc2").string());
    for (int k = 0; k < cache.num_samples(); ++k) frames.push_back(cache.read(k).cast<double>());
    return frames;
  }
  nlohmann::json report(const std::string& name) const {
    return nlohmann::json::parse(read(out(name) / "report.json"));
  }
  double volume(const Eigen::MatrixX3d& points, const std::string& name) const {
    const lattice::Triangles triangles = assets::read_surface((out(name) / "skin.obj").string()).triangles;
    double sum = 0.0;
    for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
      const Eigen::Vector3d a = points.row(triangles(t, 0)), b = points.row(triangles(t, 1)),
                            c = points.row(triangles(t, 2));
      sum += a.dot(b.cross(c)) / 6.0;
    }
    return sum;
  }

  std::string said_;
};

// A limb 0.6 m long, of which 0.16 m hang free: it sinks by at most a tenth of that.
TEST_F(FleshTrials, WhatGoesOnBeyondTheLastBoneHoldsItsShape) {
  const std::string flags = "--height 0.1 --cells 400 --frames 0-0 ";
  const Frames flesh = frames_of("flesh/cross.glb", "flesh", flags),
               plain = frames_of("flesh/cross.glb", "plain", flags + "--model skin --offset 0");
  EXPECT_LE(largest(flesh[0] - plain[0]), 0.016);
}

// A body that falls from the first frame on weighs nothing.
TEST_F(FleshTrials, AFallStartsWeightlessAndStaysSo) {
  const Frames flesh = frames_of("flesh/belly_fall.glb", "flesh", "--cells 400"),
               plain = frames_of("flesh/belly_fall.glb", "plain", "--cells 400 --model skin --offset 0");
  const double height = report("flesh")["height_m"].get<double>();
  for (std::size_t k = 0; k < flesh.size(); ++k)
    EXPECT_LE(largest(flesh[k] - plain[k]), 0.003 * height) << "frame " << k;
}

// A root that jumps by 3 m: the flesh goes along, as far from plain skinning after it as before.
TEST_F(FleshTrials, FleshGoesAlongWithACut) {
  const std::string flags = "--cells 400 --frames 20-40 ";
  const Frames flesh = frames_of("flesh/tp_3m_1f.glb", "flesh", flags);
  EXPECT_NE(said_.find("cut to frame 31 (found): the character jumps 3 m from 1 to 1.033 s"),
            std::string::npos)
      << said_;
  const Frames plain = frames_of("flesh/tp_3m_1f.glb", "plain", flags + "--model skin --offset 0");
  const double height = report("flesh")["height_m"].get<double>();
  double usual = 0.0, at_cut = 0.0;
  for (std::size_t k = 1; k < flesh.size(); ++k) {
    const double change = largest((flesh[k] - plain[k]) - (flesh[k - 1] - plain[k - 1])) / height;
    (k == 11 ? at_cut : usual) = std::max(k == 11 ? at_cut : usual, change);
  }
  EXPECT_LE(at_cut, usual + 0.01);
}

// The same limb with 3 and with 64 joints has the same flesh.
TEST_F(FleshTrials, TheNumberOfJointsInAChainMattersNotToTheMaterial) {
  std::vector<double> young;
  for (const char* name : {"slow3", "slow32", "slow64"}) {
    frames_of("tentacle/" + std::string(name) + ".glb", name, "--cells 300 --frames 0-0");
    young.push_back(report(name)["material"]["young_Pa"].get<double>());
  }
  const auto [least, most] = std::minmax_element(young.begin(), young.end());
  EXPECT_LE(*most, 1.1 * *least);
}

// Measured: 0.97 and 0.88 of it; plain skinning keeps 0.91 and 0.78.
TEST_F(FleshTrials, ABentAndATwistedLimbKeepTheirVolume) {
  for (const auto& [name, least] : {std::pair{"elbow120", 0.95}, std::pair{"twist180", 0.85}}) {
    const Frames flesh = frames_of("flesh/" + std::string(name) + ".glb", name, "--cells 400");
    const double first = volume(flesh[0], name);
    for (std::size_t k = 0; k < flesh.size(); ++k) {
      EXPECT_GE(volume(flesh[k], name) / first, least) << name << ", frame " << k;
      EXPECT_LE(volume(flesh[k], name) / first, 1.05) << name << ", frame " << k;
    }
  }
}

// Eight legs a fifth of a cell thick come to rest, whether their feet hang on them or on the root.
TEST_F(FleshTrials, ManyThinLegsSettle) {
  for (const char* name : {"legs", "feet_on_root"}) {
    frames_of("many_thin_legs/" + std::string(name) + ".glb", name, "");
    const nlohmann::json settle = report(name)["settle"];
    EXPECT_TRUE(settle["settled"].get<bool>()) << said_;
  }
}

/// The options that a hint names: "--young 1200, stiffer flesh" gives " --young 1200".
std::string options_of(const std::string& line) {
  std::istringstream words(line.substr(line.find("; hint: ") + 8));
  std::string options, word;
  while (words >> word) {
    if (word.rfind("--", 0) != 0) continue;
    options.append(1, ' ').append(word);
    words >> word;
    options.append(1, ' ').append(word, 0, word.find(','));
  }
  return options;
}

/// The largest share of the skin that is torn in a frame.
double torn_area(const nlohmann::json& report) {
  double torn = 0.0;
  for (const auto& frame : report["frames"]) torn = std::max(torn, frame["skin"]["torn_area"].get<double>());
  return torn;
}

// Unguarded flesh that hangs off its bones, and a character with its arms along its chest.
TEST_F(FleshTrials, NamesARemedyThatHelps) {
  struct Case {
    std::string rig, flags;
  };
  for (const Case& one :
       {Case{"trials/flesh/cross.glb", "--frames 0-1 --cells 400 --height 0.1 --young 3000"},
        Case{"characters/quaternius_Male_Casual.fbx", "--frames 0-8"}}) {
    const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public" / one.rig;
    ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
    const auto report_of = [&](const std::string& flags) {
      fs::remove_all(out("run"));
      const Outcome outcome = run(command_line("simulate " + quoted(rig) + " --preview off -o " +
                                               quoted(out("run")) + " " + one.flags + flags));
      EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
      return report("run");
    };
    const nlohmann::json torn = report_of(" --guard off");
    ASSERT_EQ(torn["skin"]["verdict"], "torn");
    const auto line = torn["skin"]["line"].get<std::string>();
    EXPECT_LT(torn_area(report_of(options_of(line))), 0.1 * torn_area(torn)) << line;
  }
}

// A tail that lags in bumps, guard and all, and a bent sausage whose flesh rests a third of its height from
// where plain skinning collapses: with what the line names an eye finds nothing more.
TEST_F(FleshTrials, NamesARemedyThatLeavesNothingToSee) {
  struct Case {
    std::string rig, verdict;
  };
  for (const Case& one : {Case{"trials/flesh/tail_hop.glb", "rough"},
                          Case{"nasty/motionbuilder_sausage_rrss_7700_binary.fbx", "torn"}}) {
    const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public" / one.rig;
    ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
    const auto finding_of = [&](const std::string& flags) {
      fs::remove_all(out("run"));
      const Outcome outcome =
          run(command_line("simulate " + quoted(rig) + " --preview off -o " + quoted(out("run")) + flags));
      EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
      return report("run")["skin"];
    };
    const nlohmann::json before = finding_of("");
    ASSERT_EQ(before["verdict"], one.verdict) << one.rig;
    const auto line = before["line"].get<std::string>();
    EXPECT_EQ(finding_of(options_of(line))["verdict"], "fine") << line;
  }
}

/// The longest way by which skin was laid back in a frame [m].
double mended_way(const nlohmann::json& report) {
  double way = 0.0;
  for (const auto& frame : report["frames"]) way = std::max(way, frame["largest_mended_m"].get<double>());
  return way;
}

// A horse that falls: its head lags so far that the guard lays it back by more than a tenth of the height,
// which is warned of; the stiffer flesh that is named needs a third of that at most.
TEST_F(FleshTrials, WarnsWhereMuchIsMendedAndNamesARemedyThatHelps) {
  const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public/quadrupeds/quaternius_Horse.fbx";
  ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
  const std::string command =
      "simulate " + quoted(rig) + " --clip 'Armature|Death' --frames 0-20 --preview off -o ";
  const Outcome outcome = run(command_line(command + quoted(out("mended"))));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const std::size_t at = outcome.text.find("warning: mended up to");
  ASSERT_NE(at, std::string::npos) << outcome.text;
  const std::string line = outcome.text.substr(at, outcome.text.find('\n', at) - at);
  const nlohmann::json before = report("mended");
  EXPECT_GT(mended_way(before), 0.1 * before["height_m"].get<double>());
  const Outcome helped = run(command_line(command + quoted(out("helped")) + options_of(line)));
  ASSERT_EQ(helped.exit_code, 0) << helped.text;
  EXPECT_EQ(helped.text.find("warning: mended"), std::string::npos) << helped.text;
  EXPECT_LE(mended_way(report("helped")), mended_way(before) / 3.0) << line;
}

// The horse again, in small steps of time: what is laid back must not jerk. Second differences of the guarded
// skin are at most twice those of the flesh (measured: 1.7 times; laid back frame by frame ten times).
TEST_F(FleshTrials, GuardedSkinDoesNotPop) {
  const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public/quadrupeds/quaternius_Horse.fbx";
  ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
  const auto jerk = [&](const std::string& guard) {
    const fs::path folder = out("guard_" + guard);
    const Outcome outcome =
        run(command_line("simulate " + quoted(rig) + " --clip 'Armature|Death' --fps 240 --frames 130-190" +
                         " --preview off --guard " + guard + " -o " + quoted(folder)));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    const assets::Pc2Reader cache((folder / "skin.pc2").string());
    double most = 0.0;
    for (int k = 2; k < cache.num_samples(); ++k)
      most = std::max(most, largest(cache.read(k).cast<double>() - 2.0 * cache.read(k - 1).cast<double>() +
                                    cache.read(k - 2).cast<double>()));
    return most;
  };
  EXPECT_LE(jerk("on"), 2.0 * jerk("off"));
}

// Where `blended` once grew wings to four lengths and would not come to rest.
TEST_F(FleshTrials, BlendedStandsOnThinLimbs) {
  struct Case {
    std::string rig, flags;
  };
  for (const Case& one :
       {Case{"trials/many_thin_legs/legs.glb", ""}, Case{"trials/many_thin_legs/feet_on_root.glb", ""},
        Case{"creatures/q_Spider.glb", "--clip 'SpiderArmature|Spider_Attack' --cells 400"},
        Case{"creatures/q_Spider.glb", "--clip 'SpiderArmature|Spider_Death' --cells 400"},
        Case{"creatures/mesh2motion_bird-animations.glb", "--clip Fly"}}) {
    SCOPED_TRACE(one.rig + " " + one.flags);
    const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public" / one.rig;
    ASSERT_TRUE(fs::exists(rig)) << rig << " is missing";
    std::array<Frames, 2> frames;
    for (const bool plain : {false, true}) {
      const fs::path folder = out(plain ? "plain" : "blended");
      fs::remove_all(folder);
      const Outcome outcome =
          run(command_line("simulate " + quoted(rig) + " " + one.flags + " --frames 0-8 --preview off -o " +
                           quoted(folder) + (plain ? " --model skin --offset 0" : " --model blended")));
      ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
      const assets::Pc2Reader cache((folder / "skin.pc2").string());
      for (int k = 0; k < cache.num_samples(); ++k) frames[plain].push_back(cache.read(k).cast<double>());
    }
    EXPECT_TRUE(report("blended")["settle"]["settled"].get<bool>());
    // The longest side of the box in every frame: legs and wings keep their length within a tenth.
    const auto side = [](const Eigen::MatrixX3d& x) {
      return (x.colwise().maxCoeff() - x.colwise().minCoeff()).maxCoeff();
    };
    for (std::size_t k = 0; k < frames[0].size(); ++k)
      EXPECT_NEAR(side(frames[0][k]), side(frames[1][k]), 0.1 * side(frames[1][k])) << "frame " << k;
  }
}

// Four fifths of the skin of a limb bent by up to 120 degrees (measured: 0.85) face within 5 degrees of where
// plain skinning has them; the rest is the fold, where plain skinning collapses, and what bulges beside it.
TEST_F(FleshTrials, NormalsOfABentLimbStayNearThoseOfPlainSkinning) {
  const std::string rig = quoted(fs::path(SINEW_SOURCE_DIR) / "assets/samples/arm.glb");
  std::array<Frames, 2> frames;
  for (const bool plain : {false, true}) {
    const fs::path folder = out(plain ? "plain" : "flesh");
    const Outcome outcome =
        run(command_line("simulate " + rig + " --clip elbow --frames 0-40 --preview off -o " +
                         quoted(folder) + (plain ? " --model skin --offset 0" : "")));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
    const assets::Pc2Reader cache((folder / "skin.pc2").string());
    for (int k = 0; k < cache.num_samples(); ++k) frames[plain].push_back(cache.read(k).cast<double>());
  }
  const lattice::Triangles triangles = assets::read_surface((out("flesh") / "skin.obj").string()).triangles;
  const auto normals = [&](const Eigen::MatrixX3d& x) {
    Eigen::MatrixX3d sum = Eigen::MatrixX3d::Zero(x.rows(), 3);
    for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
      const Eigen::RowVector3d a = x.row(triangles(t, 0)), b = x.row(triangles(t, 1)),
                               c = x.row(triangles(t, 2));
      for (int k = 0; k < 3; ++k) sum.row(triangles(t, k)) += (b - a).cross(c - a);
    }
    return sum;
  };
  for (std::size_t k = 0; k < frames[0].size(); ++k) {
    const Eigen::MatrixX3d flesh = normals(frames[0][k]), plain = normals(frames[1][k]);
    double within = 0.0, all = 0.0;
    for (Eigen::Index v = 0; v < flesh.rows(); ++v) {
      const double size = plain.row(v).norm() * flesh.row(v).norm(), area = plain.row(v).norm();
      all += area;
      if (flesh.row(v).dot(plain.row(v)) >= std::cos(5.0 * M_PI / 180.0) * size) within += area;
    }
    EXPECT_GE(within, 0.8 * all) << "frame " << k;
  }
}

}  // namespace
}  // namespace sinew::tests
