// Scenes without a rig: what their files say, how they are refused, and the answers of small ones.

#include "tools/plain_scene.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "tests/tools/simulate_run.h"
#include "tools/character.h"
#include "tools/plain_character.h"
#include "tools/scene.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kElbow = R"(
young = 5e4
poisson = 0.3
frames = "0-4"

[lattice]
box = [1.2, 0.24, 0.24]
corner = [-0.1, -0.12, -0.12]
cells = [12, 2, 2]

[[bone]]
name = "upper"
start = [0, 0, 0]
end = [0.5, 0, 0]

[[bone]]
name = "lower"
parent = "upper"
start = [0.5, 0, 0]
end = [1, 0, 0]
keys = [{ time = 0 }, { time = 0.1, angle = 30 }, { time = 1, angle = 390, move = [0, 0.5, 0] }]

[[fixed]]
face = "x-min"
bone = "upper"

[[material]]
bones = ["lower"]
young = 7e4
)";

class PlainScenes : public tests::Simulate {
 protected:
  std::string file(const std::string& text) const {
    const fs::path path = out("scene.toml");
    std::ofstream(path) << text;
    return path.string();
  }
  Scene scene(const std::string& text) const {
    Scene scene = read_scene(file(text));
    scene.validate();
    return scene;
  }
  std::string refusal(const std::string& text) const {
    try {
      make_plain_character(scene(text));
    } catch (const std::runtime_error& error) {
      std::string message = error.what();
      const std::string path = out("scene.toml").string();
      for (std::size_t i; (i = message.find(path)) != std::string::npos;)
        message.replace(i, path.size(), "FILE");
      return message;
    }
    return "nothing";
  }
};

TEST_F(PlainScenes, AreReadWithEveryKey) {
  const Scene s = scene(kElbow);
  ASSERT_TRUE(s.plain);
  EXPECT_EQ(s.plain->box.size, Eigen::Vector3d(1.2, 0.24, 0.24));
  EXPECT_EQ(s.plain->box.cells, Eigen::Vector3i(12, 2, 2));
  ASSERT_EQ(s.plain->bones.size(), 2u);
  EXPECT_EQ(s.plain->bones[1].parent, "upper");
  EXPECT_EQ(s.plain->bones[1].keys[2].move, Eigen::Vector3d(0, 0.5, 0));
  EXPECT_EQ(s.plain->fixed, (std::vector<FixedFace>{{{0, false}, "upper"}}));
  EXPECT_EQ(scene("young = 1\n[lattice]\nbox = [1, 1, 1]\ntype = \"wedges\"").plain->box.type,
            lattice::CellType::Wedge);
}

TEST_F(PlainScenes, PrintedAndReadAgainAreTheSame) {
  const Scene s = scene(kElbow);
  EXPECT_EQ(scene(print_scene(s)), s);
  EXPECT_THAT(print_scene(s), testing::Not(HasSubstr("rig =")));
}

TEST_F(PlainScenes, AreRefusedWithLineThingValueAndRange) {
  const std::string box = "young = 1e5\n[lattice]\nbox = [1, 1, 1]\n";
  EXPECT_EQ(refusal("young = 1\n[lattice]\ncells = [1, 1, 1]"),
            "FILE:2: lattice: box: missing, expected its size in metres; hint: box = [1, 0.2, 0.2]");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 0, 1]"),
            "FILE: lattice: box: got [1, 0, 1], expected three sizes of 1e-09 to "
            "1e+06 m");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 1]"),
            "FILE:2: lattice: box: got an array, expected an array of three numbers");
  EXPECT_EQ(refusal("[lattice]\nboxx = [1, 1]"), "FILE:2: boxx: unknown key; hint: did you mean box?");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 1, 1]\ncells = [1, 0, 1]"),
            "FILE:3: lattice: cells: got 0, expected 1 ... 1000000 blocks");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 1, 1]\ncells = [1000, 1000, 2]"),
            "lattice: cells: got [1000, 1000, 2], the limit is 1e+06 cells");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 1, 1]\ntype = \"pyramids\""),
            "FILE:3: lattice: type: got 'pyramids', expected hexahedra, wedges or tetrahedra");
  EXPECT_EQ(refusal("[lattice]\nbox = [1, 1, 1]"),
            "young: missing, expected Young's modulus in pascal as the scene is a box without a rig; hint: "
            "young = 1e5");
  EXPECT_EQ(refusal("cells = 500\n" + box),
            "cells: got 500, expected nothing as the scene is a box without a rig; hint: "
            "[lattice] holds its size and its cells");
  EXPECT_THAT(refusal("young = 1\n[[fixed]]\nface = \"x-min\""),
              HasSubstr("FILE: [lattice]: missing, expected a box"));
  EXPECT_EQ(refusal(box + "[[fixed]]\nface = \"left\""),
            "FILE:5: fixed 1: face: got 'left', expected x-min, x-max, y-min, y-max, z-min or z-max");
  EXPECT_EQ(refusal(box + "[[fixed]]\nface = \"x-min\"\nbone = \"arm\""),
            "FILE: fixed 1: bone: got 'arm', expected a bone that stands above it, there is none");
  EXPECT_EQ(refusal(box + "[[bone]]\nname = \"a\"\nstart = [0, 0, 0]"),
            "FILE:4: bone 1: end: missing, expected three coordinates in metres");
  const auto bone = [](const std::string& more) {
    return "[[bone]]\nname = \"arm\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\n" + more;
  };
  EXPECT_EQ(refusal(box + bone("parent = \"amr\"")),
            "FILE: bone 'arm': parent: got 'amr', expected a bone that stands above it, there is none");
  EXPECT_EQ(refusal(box + bone("") + bone("")),
            "FILE: bone 'arm': got the name twice, expected names that differ");
  EXPECT_EQ(refusal(box + bone("keys = [{ time = 1 }, { time = 1 }]")),
            "FILE: bone 'arm': key 2: time: got 1, expected more than 1 s, the key before");
  EXPECT_EQ(refusal(box + bone("keys = [{ angle = 3 }]")),
            "FILE:8: bone 1: key 1: time: missing, expected seconds");
  EXPECT_EQ(refusal(box + bone("keys = [{ time = 1, axis = [0, 0, 0] }]")),
            "FILE: bone 'arm': key 1: axis: got [0, 0, 0], expected a direction");
  EXPECT_EQ(refusal(box + "[[bone]]\nname = \"b\"\nstart = [0, 0, 0]\nend = [0.5, 0, 0]"),
            "FILE: bone 'b': its end lies 0.5 m from the nearest lattice vertex, expected lattice vertices "
            "from its start to "
            "its end, each pair joined by an edge; hint: other cells, or soft = true");
  EXPECT_EQ(refusal(box + "[[bone]]\nname = \"b\"\nstart = [0, 0, 0]\nend = [1, 1, 0]"),
            "FILE: bone 'b': lattice vertices 0 and 3 on it are not joined, expected lattice vertices from "
            "its start to its "
            "end, each pair joined by an edge; hint: other cells, or soft = true");
}

TEST_F(PlainScenes, TurnAsFarAsTheirKeysSay) {
  const PlainCharacter c = make_plain_character(scene(kElbow));
  const auto pose = [&](double time) {
    return skeleton::pose_from_rest(c.rig.skeleton, skeleton::sample(c.rig.skeleton, c.rig.clips[0], time));
  };
  // Half way from 30 to 390 degrees is 210, not the way back of a slerp; the joint has moved by half of (0,
  // 0.5, 0).
  const Eigen::Vector3d tip = pose(0.55)[1] * Eigen::Vector3d(1.0, 0.0, 0.0);
  const double angle = 210.0 * M_PI / 180.0;
  EXPECT_NEAR((tip - Eigen::Vector3d(0.5 + 0.5 * std::cos(angle), 0.25 + 0.5 * std::sin(angle), 0.0)).norm(),
              0.0, 1e-12);
  EXPECT_EQ(c.rig.clips[0].end, 1.0);
}

TEST_F(PlainScenes, GiveTheChainsAndWeightsOfTheirBones) {
  const PlainCharacter c = make_plain_character(scene(kElbow));
  ASSERT_EQ(c.lattice.bones.size(), 2u);
  EXPECT_EQ(c.lattice.bones[0].chain.size(), 6u);  // 0, 0.1, ... 0.5
  EXPECT_EQ(c.lattice.bones[0].chain.back(), c.lattice.bones[1].chain.front());
  lattice::validate(c.lattice);
  for (Eigen::Index v = 0; v < c.input.skin.surface.points.rows(); ++v) {
    double sum = 0.0, lower = 0.0;
    for (const auto& influence : c.input.skin.surface.weights[static_cast<std::size_t>(v)]) {
      sum += influence.weight;
      if (influence.frame == 1) lower += influence.weight;
    }
    EXPECT_NEAR(sum, 1.0, 1e-15);
    const double x = c.input.skin.surface.points(v, 0);
    if (std::abs(x - 0.5) < 1e-9) continue;
    EXPECT_EQ(lower > 0.5, x > 0.5) << x;
  }
}

TEST_F(PlainScenes, RunFromTheShellLikeAnyOther) {
  const std::string toml = file(kElbow);
  const tests::Outcome run =
      tests::run(tests::command_line("simulate " + tests::quoted(toml) + " -o " + tests::quoted(out("run"))));
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const auto report = nlohmann::json::parse(tests::read(out("run") / "report.json"));
  tests::expect_sound(report, out("run"), 5);
  EXPECT_EQ(report["lattice"]["bones"].size(), 2u);
  EXPECT_EQ(
      tests::run(tests::command_line("simulate " + tests::quoted(toml) + " --rig x.glb -o a")).exit_code, 2);
  const tests::Outcome refused = tests::run(
      tests::command_line("simulate " + tests::quoted(toml) + " --cells 300 -o " + tests::quoted(out("b"))));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.text, HasSubstr("cells: got 300, expected nothing as the scene is a box"));
}

// Nothing but gravity acts on a box that nothing holds: after half a second at 10 m/s^2 it has fallen by 1.25
// m, to the rounding of the floats of the cache. BDF2 starts with a step of first order in the velocity's
// history, but velocity and acceleration are those of a parabola: its steps are exact up to that first one,
// h^2 g / 6 = 1.2e-4 m.
TEST_F(PlainScenes, FallFreelyWhereNothingHoldsThem) {
  const std::string toml = file(
      "young = 1e5\ngravity = [0, -10, 0]\ndamping = 0\nsettle = 0\nframes = \"0-15\"\n[lattice]\nbox = "
      "[0.3, 0.2, 0.2]\n"
      "cells = [2, 1, 1]\n");
  const tests::Outcome run =
      tests::run(tests::command_line("simulate " + tests::quoted(toml) + " -o " + tests::quoted(out("run"))));
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const assets::Pc2Reader cache((out("run") / "skin.pc2").string());
  const assets::FloatPoints moved = cache.read(15) - cache.read(0);
  EXPECT_LT((moved.rowwise() - Eigen::RowVector3f(0.0F, -1.25F, 0.0F)).cwiseAbs().maxCoeff(), 3e-4F);
}

}  // namespace
}  // namespace sinew::tools
