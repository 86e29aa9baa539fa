// Scenes without a rig: what their files say, how they are refused, and the answers of small ones.

#include "tools/scene/plain_scene.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/vtu.h"
#include "tests/tools/simulate_run.h"
#include "tools/scene/scene.h"
#include "tools/session/character.h"
#include "tools/session/plain_character.h"

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

[[point_load]]
at = [1, 0, 0.1]
force = [0, 0.5, 0]

[[body_load]]
density = [10, 0, 0]
acceleration = [0, 0, -1]

[[face_load]]
face = "x-max"
traction = [0, 0, 3]

[[face_load]]
face = "z-max"
pressure = 20

[velocity]
linear = [0, 0, 0.1]
spin = [0, 0, 30]
about = [0.5, 0, 0]
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
  EXPECT_EQ(s.plain->point_loads, (std::vector<PlainPointLoad>{{{1, 0, 0.1}, {0, 0.5, 0}}}));
  EXPECT_EQ(s.plain->body_loads, (std::vector<PlainBodyLoad>{{{10, 0, 0}, {0, 0, -1}}}));
  EXPECT_EQ(s.plain->face_loads,
            (std::vector<PlainFaceLoad>{{{0, true}, 0.0, {0, 0, 3}}, {{2, true}, 20.0, {0, 0, 0}}}));
  EXPECT_EQ(s.plain->velocity, (PlainVelocity{{0, 0, 0.1}, {0, 0, 30}, Eigen::Vector3d(0.5, 0, 0)}));
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

TEST_F(PlainScenes, RefuseLoadsAndVelocitiesInOneLine) {
  const std::string box = "young = 1e5\n[lattice]\nbox = [1, 1, 1]\n";
  EXPECT_EQ(refusal(box + "[[point_load]]\nat = [0, 0, 0]"),
            "FILE:4: point_load 1: force: missing, expected three numbers in newtons");
  EXPECT_EQ(refusal(box + "[[point_load]]\nat = [0, 0, 1.1]\nforce = [0, 0, 1]"),
            "FILE: point_load 1: at: got [0, 0, 1.1], expected a point of the box");
  EXPECT_EQ(refusal(box + "[[point_load]]\nat = [0, 0, 0]\nfroce = [0, 0, 1]"),
            "FILE:6: froce: unknown key; hint: did you mean force?");
  EXPECT_EQ(refusal(box + "[[pointload]]\nat = [0, 0, 0]"),
            "FILE:4: pointload: unknown key; hint: did you mean point_load?");
  EXPECT_EQ(refusal(box + "[[body_load]]"),
            "FILE:4: body_load 1: no load, expected density (N/m^3) or acceleration (m/s^2); hint: density = "
            "[0, -100, 0]");
  EXPECT_EQ(
      refusal(box + "[[body_load]]\ndensity = [0, 1e13, 0]"),
      "FILE: body_load 1: density: got [0, 10000000000000, 0], expected three numbers within 1e+12 N/m^3");
  EXPECT_EQ(refusal(box + "[[face_load]]\npressure = 1"),
            "FILE:4: face_load 1: face: missing, expected a side of the box; hint: face = \"x-max\"");
  EXPECT_EQ(refusal(box + "[[face_load]]\nface = \"x-max\""),
            "FILE:4: face_load 1: no load, expected pressure (turns with the surface) or traction (keeps its "
            "direction) in pascal; hint: pressure = 100");
  EXPECT_EQ(refusal(box + "[[face_load]]\nface = \"x-max\"\npressure = nan"),
            "FILE: face_load 1: pressure: got nan, expected a number within 1e+12 Pa");
  EXPECT_EQ(refusal(box + "[velocity]\nlinaer = 3"),
            "FILE:5: linaer: unknown key; hint: did you mean linear?");
  EXPECT_EQ(
      refusal(box + "[velocity]"),
      "FILE:4: velocity: no velocity, expected linear (m/s) or spin (degrees/s); hint: linear = [0, 1, 0]");
  EXPECT_EQ(refusal(box + "[velocity]\nlinear = [0, 1e5, 0]"),
            "FILE: velocity: linear: got [0, 100000, 0], expected three numbers within 10000 m/s");
  EXPECT_EQ(refusal("young = 1\n[velocity]\nlinear = [0, 1, 0]"),
            "FILE: [lattice]: missing, expected a box; hint: bones, fixed faces, loads and velocities belong "
            "to scenes without a rig, whose flesh is a box");
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

/// Displacements of pose.vtu at rest points.
class PlainPoses : public PlainScenes {
 protected:
  std::vector<Eigen::Vector3d> moved(const std::string& text, const std::string& flags,
                                     const std::vector<Eigen::RowVector3d>& at) const {
    const tests::Outcome run = tests::run(tests::command_line(
        "pose " + tests::quoted(file(text)) + " --overwrite -o " + tests::quoted(out("pose")) + " " + flags));
    EXPECT_EQ(run.exit_code, 0) << run.text;
    std::vector<Eigen::Vector3d> u(at.size(), Eigen::Vector3d::Constant(std::nan("")));
    if (run.exit_code != 0) return u;
    const std::string path = (out("pose") / "pose.vtu").string();
    const assets::VtuGrid grid = assets::parse_vtu(path, tests::read(path));
    const auto& values = std::get<std::vector<double>>(grid.point_arrays.at(0).values);
    for (std::size_t k = 0; k < at.size(); ++k) {
      Eigen::Index vertex = 0;
      EXPECT_LT((grid.points.rowwise() - at[k]).rowwise().norm().minCoeff(&vertex), 1e-9);
      u[k] = Eigen::Map<const Eigen::Vector3d>(values.data() + 3 * vertex);
    }
    return u;
  }
};

constexpr const char* kBar = R"(
young = 1e5
poisson = 0
gravity = [0, 0, 0]
[lattice]
box = [1, 0.2, 0.2]
cells = [5, 1, 1]
[[fixed]]
face = "x-min"
)";

// Without Poisson's ratio the bar keeps its width, and its stretch s solves s E (s^2 - 1) / 2 = P with the
// nominal stress P of St. Venant-Kirchhoff: the traction, or the pressure on an end that keeps its area.
TEST_F(PlainPoses, AreStretchedByTractionAndPressureAsTheClosedFormSays) {
  const std::string bar = kBar;
  const auto stretch_at = [](double stress) {
    double s = 1.0;
    for (int i = 0; i < 50; ++i) s -= (0.5e5 * s * (s * s - 1.0) - stress) / (0.5e5 * (3.0 * s * s - 1.0));
    return s;
  };
  const std::vector<Eigen::RowVector3d> end{{1.0, 0.1, 0.1}, {0.5, 0.0, 0.2}};
  const auto expect = [&](const std::string& load, double stress) {
    const auto u = moved(bar + "[[face_load]]\nface = \"x-max\"\n" + load, "--model stvk", end);
    const double s = stretch_at(stress);
    // The rest tolerance of 1e-10 of the forces.
    EXPECT_LT((u[0] - Eigen::Vector3d(s - 1.0, 0, 0)).norm(), 1e-9) << load;
    EXPECT_LT((u[1] - Eigen::Vector3d(0.5 * (s - 1.0), 0, 0)).norm(), 1e-9) << load;
  };
  expect("traction = [2e4, 0, 0]", 2e4);
  expect("pressure = -2e4", 2e4);
  expect("pressure = 500", -500.0);  // 20 N: it buckles at pi^2 E I / 4 = 33 N
  expect("pressure = 1e4\ntraction = [3e4, 0, 0]", 2e4);
}

// All that pose.vtu says of the cells of that bar: Green strain (s^2 - 1) / 2, the nominal stress as Cauchy
// stress since the section keeps its area, and E e^2 / 2 per volume.
TEST_F(PlainPoses, ReportStrainStressAndEnergyOfEveryCell) {
  moved(std::string(kBar) + "[[face_load]]\nface = \"x-max\"\ntraction = [2e4, 0, 0]", "--model stvk",
        {{1.0, 0.1, 0.1}});
  const std::string path = (out("pose") / "pose.vtu").string();
  const assets::VtuGrid grid = assets::parse_vtu(path, tests::read(path));
  ASSERT_EQ(grid.cells.size(), 40u);
  const auto array = [&](const std::string& name) {
    for (const assets::VtuArray& a : grid.cell_arrays) {
      if (a.name == name) return std::get<std::vector<double>>(a.values);
    }
    ADD_FAILURE() << name;
    return std::vector<double>(9 * grid.cells.size(), std::nan(""));
  };
  // (1 + 2 e) E^2 e^2 = P^2.
  double e = 0.15;
  for (int i = 0; i < 50; ++i) e = 0.2 / std::sqrt(1.0 + 2.0 * e);
  const auto strain = array("strain"), stress = array("stress"), von_mises = array("von_mises"),
             energy = array("energy");
  for (std::size_t c = 0; c < grid.cells.size(); ++c) {
    for (std::size_t k = 0; k < 9; ++k) {
      EXPECT_NEAR(strain[9 * c + k], k == 0 ? e : 0.0, 1e-9);
      EXPECT_NEAR(stress[9 * c + k], k == 0 ? 2e4 : 0.0, 1e-4);
    }
    EXPECT_NEAR(von_mises[c], 2e4, 1e-4);
    EXPECT_NEAR(energy[c], 0.5e5 * e * e * 0.001, 1e-9);
  }
}

TEST_F(PlainPoses, NeedSomethingThatHoldsTheFlesh) {
  const auto pose = [&](const std::string& text) {
    return tests::run(tests::command_line("pose " + tests::quoted(file(text)) + " --overwrite -o " +
                                          tests::quoted(out("pose"))));
  };
  const std::string box = "young = 1e5\n[lattice]\nbox = [1, 1, 1]\n";
  const tests::Outcome free = pose(box);
  EXPECT_EQ(free.exit_code, 2);
  EXPECT_THAT(free.text,
              HasSubstr("scene.toml: bone: none and no fixed side, expected something that holds"));
  EXPECT_FALSE(fs::exists(out("pose")));
  const tests::Outcome moving = pose(box + "[[fixed]]\nface = \"x-min\"\n[velocity]\nspin = [0, 0, 1]");
  EXPECT_EQ(moving.exit_code, 0);
  EXPECT_THAT(moving.text, HasSubstr("warning: a pose is at rest: the velocity does nothing"));
}

// A dead load on the side of a bending bar keeps its direction; a pressure turns with the surface and so
// pulls the tip back: at first alike, then bent less far along x than the dead load makes it.
TEST_F(PlainPoses, TellFollowingPressureFromDeadTraction) {
  const std::string bar = kBar;
  const std::vector<Eigen::RowVector3d> tip{{1.0, 0.1, 0.1}};
  const auto bent = [&](double amount) {
    const std::string side = "[[face_load]]\nface = \"z-max\"\n";
    return std::pair{
        moved(bar + side + fmt::format("pressure = {}", amount), "--model neo-hookean", tip)[0],
        moved(bar + side + fmt::format("traction = [0, 0, {}]", -amount), "--model neo-hookean", tip)[0]};
  };
  const auto [small_follower, small_dead] = bent(0.1);
  EXPECT_LT(small_dead.z(), -1e-6);
  EXPECT_LT((small_follower - small_dead).norm(), 1e-3 * small_dead.norm());
  const auto [follower, dead] = bent(300.0);
  EXPECT_LT(dead.z(), -0.2);
  // Turned by up to 20 degrees, the pressure has a part along -x that the dead load has not.
  EXPECT_LT(follower.x(), dead.x() - 1e-2);
}

// 1 kg/dm^3 at 2 m/s^2 is 2000 N/m^3, told as gravity, as acceleration, as density of force.
TEST_F(PlainPoses, FeelABodyLoadAsTheyFeelGravity) {
  const std::vector<Eigen::RowVector3d> tip{{1.0, 0.1, 0.1}};
  std::string heavy = kBar;
  heavy.replace(heavy.find("[0, 0, 0]"), 9, "[0, 0, -2]");
  const Eigen::Vector3d expected = moved(heavy, "--model corotational", tip)[0];
  EXPECT_LT(expected.z(), -0.1);
  for (const char* load : {"density = [0, 0, -2000]", "acceleration = [0, 0, -2]",
                           "acceleration = [0, 0, -1]\ndensity = [0, 0, -1000]"}) {
    const std::string text = std::string(kBar) + "[[body_load]]\n" + load;
    EXPECT_LT((moved(text, "--model corotational", tip)[0] - expected).norm(), 1e-8) << load;
  }
}

// Far from where it acts only a load's resultant counts: 0.1 N at the middle of the end, or spread over its
// 0.04 m^2. Half a length away the difference has died out.
TEST_F(PlainPoses, FeelAPointLoadAsItsResultant) {
  const std::vector<Eigen::RowVector3d> middle{{0.5, 0.1, 0.1}};
  const std::string bar = kBar;
  const Eigen::Vector3d spread = moved(bar + "[[face_load]]\nface = \"x-max\"\ntraction = [0, 0, -2.5]",
                                       "--model neo-hookean", middle)[0];
  const Eigen::Vector3d point = moved(bar + "[[point_load]]\nat = [1, 0.1, 0.1]\nforce = [0, 0, -0.1]",
                                      "--model neo-hookean", middle)[0];
  EXPECT_LT(spread.z(), -5e-4);
  EXPECT_LT((point - spread).norm(), 1e-3 * spread.norm());
}

// Nothing but gravity acts on a box that nothing holds: after half a second at 10 m/s^2 it has fallen by 1.25
// m, to the rounding of the floats of the cache. BDF2 starts with a step of first order in the velocity's
// history, but velocity and acceleration are those of a parabola: its steps are exact up to that first one,
// h^2 g / 6 = 1.2e-4 m.
TEST_F(PlainScenes, FallFreelyWhereNothingHoldsThem) {
  const std::string toml = file(
      "young = 1e5\ngravity = [0, -10, 0]\ndamping = 0\nframes = \"0-15\"\n[lattice]\nbox = "
      "[0.3, 0.2, 0.2]\n"
      "cells = [2, 1, 1]\n");
  const tests::Outcome run =
      tests::run(tests::command_line("simulate " + tests::quoted(toml) + " -o " + tests::quoted(out("run"))));
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const assets::Pc2Reader cache((out("run") / "skin.pc2").string());
  const assets::FloatPoints moved = cache.read(15) - cache.read(0);
  EXPECT_LT((moved.rowwise() - Eigen::RowVector3f(0.0F, -1.25F, 0.0F)).cwiseAbs().maxCoeff(), 3e-4F);
}

// A free box that is thrown and spun: its centre goes straight, and after a quarter turn each corner is where
// the turn puts it. BDF2 keeps a spin w to the third order of w h = 0.026: over 60 steps some 1e-3; the spin
// stretches the flesh by rho w^2 L^2 / E = 1e-4.
TEST_F(PlainScenes, StartWithTheVelocityTheyAreGiven) {
  const std::string toml = file(R"(
young = 1e6
gravity = [0, 0, 0]
damping = 0
model = "corotational"
frames = "0-15"
[lattice]
box = [0.3, 0.2, 0.2]
corner = [1, 0, 0]
cells = [2, 1, 1]
[velocity]
linear = [0.5, 0, -1]
spin = [0, 0, 180]
)");
  const tests::Outcome run =
      tests::run(tests::command_line("simulate " + tests::quoted(toml) + " -o " + tests::quoted(out("run"))));
  ASSERT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("nothing holds the flesh: it starts without settling"));
  const assets::Pc2Reader cache((out("run") / "skin.pc2").string());
  const lattice::Points rest = cache.read(0).cast<double>(), posed = cache.read(15).cast<double>();
  const Eigen::RowVector3d centre(1.15, 0.1, 0.1), thrown(0.25, 0.0, -0.5);
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    const Eigen::RowVector3d arm = rest.row(v) - centre;
    const Eigen::RowVector3d turned(-arm[1], arm[0], arm[2]);
    EXPECT_LT((posed.row(v) - centre - thrown - turned).norm(), 2e-3 * arm.norm()) << v;
  }
}

TEST_F(PlainScenes, WarnWhereTheModelCannotFollow) {
  const std::string toml =
      file("young = 1e6\nframes = \"0-1\"\n[lattice]\nbox = [1, 1, 1]\n[velocity]\nspin = [0, 9, 0]");
  const auto said = [&](const std::string& model) {
    return tests::run(tests::command_line("simulate " + tests::quoted(toml) + " --overwrite --model " +
                                          model + " -o " + tests::quoted(out("run"))))
        .text;
  };
  EXPECT_THAT(said("blended"), HasSubstr("warning: model 'blended' is linear in the bones' frames"));
  EXPECT_THAT(said("skin"),
              HasSubstr("warning: model 'skin' has no dynamics: loads and velocity do nothing"));
  EXPECT_THAT(said("stvk --precision short"),
              HasSubstr("warning: precision: does nothing, as model 'stvk' keeps no factors"));
  EXPECT_THAT(said("corotational --precision short"), testing::Not(HasSubstr("precision")));
  EXPECT_THAT(said("corotational"), testing::Not(HasSubstr("warning")));
}

}  // namespace
}  // namespace sinew::tools
