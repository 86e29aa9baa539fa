#include "tools/commands/inspect_command.h"

#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include <sys/wait.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/assets/tiny_gltf.h"

namespace sinew::tools {
namespace {

using assets::TinyGltf;
using assets::write_file;
using nlohmann::json;
using testing::HasSubstr;

constexpr const char* kArm = SINEW_SOURCE_DIR "/assets/samples/arm.glb";

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

std::string contents(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

Outcome run(const std::string& arguments) {
  const std::string out = write_file("out", ""), err = write_file("err", "");
  const int status = std::system((SINEW_COMMAND " inspect " + arguments + " >" + out + " 2>" + err).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(out), contents(err)};
}

TEST(Inspect, SaysInJsonWhatTheArmSampleHolds) {
  const Outcome result = run(std::string("--json ") + kArm);
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.err, "");
  const json document = json::parse(result.out);
  EXPECT_EQ(document["file"], kArm);
  EXPECT_EQ(document["format"], "glTF 2.0");
  EXPECT_EQ(document["usable"], true);
  EXPECT_EQ(document["up_axis"], "Y");
  EXPECT_EQ(document["vertex_order"], "file");
  ASSERT_EQ(document["parts"].size(), 1u);
  EXPECT_EQ(document["parts"][0]["role"], "simulated");
  EXPECT_EQ(document["parts"][0]["vertices"], document["vertices"]);
  EXPECT_EQ(document["clip_taken"], "elbow");
  EXPECT_EQ(document["clips"][0]["taken"], true);
  EXPECT_EQ(document["clips"][1]["name"], "twist");
  EXPECT_EQ(document["clips"][1]["taken"], false);
  double share = 0.0;
  for (const json& joint : document["joints"]) {
    share += joint["weight_share"].get<double>();
    // Every joint says either which bones it moves or why it has none.
    EXPECT_NE(joint["bones"].empty(), joint["reason_for_no_bone"].is_null()) << joint;
  }
  EXPECT_NEAR(share, 1.0, 1e-9);  // thousands of shares, each rounded to 1e-16
  ASSERT_GE(document["bones"].size(), 2u);
  EXPECT_EQ(document["bones"][0]["joint"], "upper_arm");
}

TEST(Inspect, SaysItInWordsToo) {
  const Outcome result = run(kArm);
  EXPECT_EQ(result.exit_code, 0);
  for (const char* line :
       {"arm.glb (glTF 2.0)\n  height    ", "up axis Y\n", "  mesh      1 part, ",
        "  skeleton  3 joints, 2 with skin weight\n", "  motion    2 clips; 'elbow' is taken\n",
        "forearm_end        -  no bone: ", "\nClips (* is taken when none is named)\n * elbow ",
        "\nFindings\n", "\nCan be simulated: yes\n"}) {
    EXPECT_THAT(result.out, HasSubstr(line));
  }
}

TEST(Inspect, OfAFileWithoutAClipPrintsAllItKnowsAndEndsWithThree) {
  TinyGltf gltf;
  gltf.document.erase("animations");
  const std::string file = write_file("still.glb", gltf.glb());
  const Outcome result = run(file);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.out, HasSubstr("Can be simulated: no\n"));
  EXPECT_THAT(result.out, HasSubstr("  error    no-clip: the file holds no animation\n"
                                    "           -> export the character together with an animation\n"));
  EXPECT_EQ(result.err, "sinew: " + file +
                            ": no-clip: the file holds no animation; hint: export the character together "
                            "with an animation\n");
}

TEST(Inspect, OfAFileWithoutTrianglesCountsWhatItHolds) {
  TinyGltf gltf;
  gltf.primitive()["mode"] = 0;
  gltf.document["meshes"][0]["primitives"].push_back(gltf.primitive());
  gltf.document["meshes"][0]["primitives"][1]["mode"] = 3;
  const std::string file = write_file("points.glb", gltf.glb());
  const Outcome result = run(file);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.err, "sinew: " + file +
                            ": no-skin: the file holds no mesh of triangles: 1 primitives of points only "
                            "are left out, 1 primitives of lines only are left out; hint: export the "
                            "character's mesh with its skin weights, skeleton and animation in one "
                            "file\n");
}

TEST(Inspect, OfABrokenFilePrintsNothingButTheLine) {
  const std::string file = write_file("broken.glb", TinyGltf().glb().substr(0, 100));
  const Outcome result = run(file);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err,
              testing::StartsWith("sinew: " + file + ": GLB header: file is truncated, got 100 bytes"));
  EXPECT_EQ(run("none.glb").exit_code, 5);
}

TEST(Inspect, TakesTheHeightItIsGivenAndRefusesNonsense) {
  const json document = json::parse(run(std::string("--json --height 1.33 ") + kArm).out);
  EXPECT_DOUBLE_EQ(document["height_m"].get<double>(), 1.33);
  for (const char* height : {"0", "-1", "nan"}) {
    const Outcome result = run(std::string("--height ") + height + " " + kArm);
    EXPECT_EQ(result.exit_code, 2) << height;
    EXPECT_THAT(result.err, HasSubstr("--height: got ")) << height;
  }
}

}  // namespace
}  // namespace sinew::tools
