// What a user can say about the lattice: how fine, where, and round which bones.

#include <algorithm>
#include <filesystem>
#include <fstream>

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

TEST_F(Steering, SizesCellsBoneByBone) {
  std::ofstream(out("sized.toml"))
      << "rig = \"" << SINEW_SOURCE_DIR "/assets/samples/hopper.glb"
      << "\"\noutput = \"run\"\ncells = 300\ngrade = \"off\"\n[[size]]\nbones = [\"tail*\"]\nfactor = 0.5\n";
  const auto lattice_of = [&](const std::string& input, const std::string& name) {
    const fs::path json = out(name + ".json");
    const tests::Outcome run = tests::run_line(tests::command_line(
        "lattice " + tests::quoted(input) + " --cells 300 --grade off --json --preview off -o " +
        tests::quoted(out(name)) + " > " + tests::quoted(json) + " 2>/dev/null"));
    EXPECT_EQ(run.exit_code, 0) << run.text;
    return nlohmann::json::parse(tests::read(json));
  };
  const auto plain = lattice_of(SINEW_SOURCE_DIR "/assets/samples/hopper.glb", "plain.vtu"),
             sized = lattice_of(out("sized.toml").string(), "sized.vtu");
  const auto pieces_of_tail = [](const nlohmann::json& lattice) {
    std::size_t pieces = 0;
    for (const auto& bone : lattice["bones"])
      if (bone["name"].get<std::string>().rfind("tail", 0) == 0 && !bone["soft"].get<bool>())
        pieces += bone["chain"].size() - 1;
    return pieces;
  };
  EXPECT_GT(pieces_of_tail(sized), pieces_of_tail(plain));
  EXPECT_TRUE(sized["symmetry"]["mirrored"].get<bool>()) << sized["symmetry"].dump();
  EXPECT_FALSE(fs::exists(out("run"))) << "the output of a scene is that of a simulation";
}

TEST_F(Steering, SaysWhyALopsidedLatticeIsNotMirrored) {
  std::ofstream(out("lopsided.toml")) << "rig = \"" << SINEW_SOURCE_DIR "/assets/samples/hopper.glb"
                                      << "\"\n[[size]]\nbones = [\"thigh_l\"]\nfactor = 0.5\n";
  const tests::Outcome run =
      tests::run(tests::command_line("lattice " + tests::quoted(out("lopsided.toml")) +
                                     " --cells 300 --preview off -o " + tests::quoted(out("lopsided.vtu"))));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.text,
              HasSubstr("symmetry: none, as cells are sized by 0.5 at 'thigh_l' and by 1 at its mirror "
                        "image 'thigh_r'\n"));
}

// On the hopper's root hangs no skin; a lattice from the cache says so too.
TEST_F(Steering, WarnsOfASizeWhereNoSkinHangs) {
  std::ofstream(out("idle.toml"))
      << "rig = \"" << SINEW_SOURCE_DIR "/assets/samples/hopper.glb"
      << "\"\ncells = 100\n[[size]]\nbones = [\"root\", \"hips\"]\nfactor = 0.5\n";
  const std::string warning = "warning: [[size]]: no skin hangs on 'root', so that nothing is sized there\n";
  const std::string lattice = "lattice " + tests::quoted(out("idle.toml")) +
                              " --preview off --overwrite -o " + tests::quoted(out("idle.vtu"));
  for (const char* cached : {"", "lattice: nothing changed"}) {
    const tests::Outcome run = tests::run(tests::command_line(lattice));
    EXPECT_EQ(run.exit_code, 0) << run.text;
    EXPECT_THAT(run.text, HasSubstr(cached));
    EXPECT_THAT(run.text, HasSubstr(warning));
  }
  const tests::Outcome simulated = tests::run(tests::command_line(
      "simulate " + tests::quoted(out("idle.toml")) +
      " --levels 0 --settle 0 --frames 0-0 --preview off -o " + tests::quoted(out("run"))));
  EXPECT_EQ(simulated.exit_code, 0) << simulated.text;
  EXPECT_THAT(simulated.text, HasSubstr(warning));
}

TEST_F(Steering, NamesTheBoneThatASizeDoesNotFit) {
  std::ofstream(out("wrong.toml")) << "rig = \"" << SINEW_SOURCE_DIR "/assets/samples/hopper.glb"
                                   << "\"\n[[size]]\nbones = [\"tial*\"]\nfactor = 0.5\n";
  const tests::Outcome run = tests::run(tests::command_line("lattice " + tests::quoted(out("wrong.toml")) +
                                                            " -o " + tests::quoted(out("wrong.vtu"))));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(run.text, "sinew: size 1: no bone is named 'tial*'; hint: did you mean tail*?\n");
  EXPECT_FALSE(fs::exists(out("wrong.vtu")));
  const std::string scene = tests::quoted(out("wrong.toml"));
  EXPECT_THAT(tests::run(tests::command_line("lattice " + scene + " --lattice l.vtu -o " +
                                             tests::quoted(out("wrong.vtu"))))
                  .text,
              HasSubstr("[[size]]: expected none as the lattice is read from l.vtu"));
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
