#include "assets/detail/gltf_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/imported_scene.h"
#include "assets/detail/rig_builder.h"
#include "assets/error.h"
#include "tests/assets/tiny_gltf.h"

namespace sinew::assets {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kFloatEps = std::numeric_limits<float>::epsilon();

detail::ImportedScene read(const TinyGltf& gltf) {
  const std::string file = write_file("tiny.glb", gltf.glb());
  detail::ImportedScene scene = detail::read_gltf(file);
  detail::check_scene(file, scene);
  return scene;
}

Rig rig_of(const TinyGltf& gltf) { return detail::build_rig("tiny.glb", read(gltf), {}); }

bool has_finding(const Rig& rig, const std::string& code) {
  return std::any_of(rig.findings.begin(), rig.findings.end(),
                     [&](const Finding& f) { return f.code == code; });
}

TEST(GltfReader, KeepsOrderNamesWeightsAndKeys) {
  const detail::ImportedScene scene = read(TinyGltf());
  EXPECT_EQ(scene.format, "glTF 2.0");
  EXPECT_TRUE(scene.file_vertex_order);
  ASSERT_EQ(scene.nodes.size(), 3u);
  EXPECT_EQ(scene.nodes[1].name, "head");
  EXPECT_EQ(scene.nodes[1].parent, 0);
  ASSERT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].points.row(2), Eigen::RowVector3d(0, 1, 0));
  EXPECT_EQ(scene.meshes[0].triangles.row(3), Eigen::RowVector3i(1, 2, 3));
  ASSERT_EQ(scene.meshes[0].weights[3].size(), 2u);
  EXPECT_EQ(scene.meshes[0].weights[3][1].frame, 1);
  EXPECT_EQ(scene.meshes[0].weights[3][1].weight, 0.5);
  EXPECT_EQ(scene.skins[0].joint_from_mesh[1].translation(), Eigen::Vector3d(0, -0.5, 0));
  ASSERT_EQ(scene.clips.size(), 1u);
  EXPECT_EQ(scene.clips[0].name, "nod");
  EXPECT_EQ(scene.clips[0].channels[0].rotation->times, (std::vector<double>{0, 1}));
}

TEST(GltfReader, TurnsParentsBeforeChildrenWhateverTheFilesOrder) {
  TinyGltf gltf;
  gltf.document["nodes"] = json::parse(R"([{"name": "head", "translation": [0, 0.5, 0]},
      {"name": "body", "mesh": 0, "skin": 0}, {"name": "hip", "children": [0]}])");
  gltf.document["scenes"][0]["nodes"] = {2, 1};
  gltf.document["skins"][0]["joints"] = {2, 0};
  gltf.document["animations"][0]["channels"][0]["target"]["node"] = 0;
  const Rig rig = rig_of(gltf);
  EXPECT_EQ(rig.skeleton.joint(0).name, "hip");
  EXPECT_EQ(rig.skeleton.joint(1).name, "head");
  EXPECT_EQ(rig.clips[0].channels[0].joint, 1);
}

TEST(GltfReader, DecodesIndicesOfEverySizeStripsAndFans) {
  for (const int size : {1, 2, 4}) {
    TinyGltf gltf;
    if (size == 1) gltf.primitive()["indices"] = gltf.add<std::uint8_t>("SCALAR", 5121, {0, 1, 2, 3}, 1);
    if (size == 2) gltf.primitive()["indices"] = gltf.add<std::uint16_t>("SCALAR", 5123, {0, 1, 2, 3}, 1);
    if (size == 4) gltf.primitive()["indices"] = gltf.add<std::uint32_t>("SCALAR", 5125, {0, 1, 2, 3}, 1);
    gltf.primitive()["mode"] = 5;
    lattice::Triangles strip(2, 3);
    strip << 0, 1, 2, 1, 3, 2;  // every other triangle of a strip is turned round
    EXPECT_EQ(read(gltf).meshes[0].triangles, strip);
    gltf.primitive()["mode"] = 6;
    lattice::Triangles fan(2, 3);
    fan << 1, 2, 0, 2, 3, 0;
    EXPECT_EQ(read(gltf).meshes[0].triangles, fan);
  }
  TinyGltf plain;
  plain.primitive().erase("indices");
  EXPECT_EQ(read(plain).meshes[0].triangles.rows(), 1)
      << "4 corners without indices: one triangle, one left over";
}

TEST(GltfReader, DecodesNormalisedWeightsOfEightAndSixteenBits) {
  TinyGltf bytes;
  bytes.primitive()["attributes"]["WEIGHTS_0"] =
      bytes.add<std::uint8_t>("VEC4", 5121, {255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0}, 4);
  bytes.document["accessors"].back()["normalized"] = true;
  EXPECT_NEAR(read(bytes).meshes[0].weights[3][0].weight, 0.2, kEps);
  TinyGltf shorts;
  shorts.primitive()["attributes"]["WEIGHTS_0"] = shorts.add<std::uint16_t>(
      "VEC4", 5123, {65535, 0, 0, 0, 65535, 0, 0, 0, 65535, 0, 0, 0, 13107, 52428, 0, 0}, 4);
  shorts.document["accessors"].back()["normalized"] = true;
  EXPECT_NEAR(read(shorts).meshes[0].weights[3][1].weight, 0.8, kEps);
}

TEST(GltfReader, FillsInSparseValuesWithAndWithoutABase) {
  for (const bool with_base : {true, false}) {
    TinyGltf gltf;
    const int indices = gltf.add<std::uint8_t>("SCALAR", 5121, {1, 3}, 1);
    const int values = gltf.add<float>("VEC3", 5126, {7, 8, 9, 4, 5, 6}, 3);
    json& position = gltf.document["accessors"][TinyGltf::kPosition];
    position["sparse"] = {{"count", 2},
                          {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                          {"values", {{"bufferView", values}}}};
    if (!with_base) position.erase("bufferView");
    const lattice::Points points = read(gltf).meshes[0].points;
    EXPECT_EQ(points.row(1), Eigen::RowVector3d(7, 8, 9));
    EXPECT_EQ(points.row(3), Eigen::RowVector3d(4, 5, 6));
    EXPECT_EQ(points.row(2), with_base ? Eigen::RowVector3d(0, 1, 0) : Eigen::RowVector3d(0, 0, 0));
  }
}

TEST(GltfReader, HonoursStrides) {
  TinyGltf gltf;
  // Points with a fourth float between them.
  const int loose =
      gltf.add<float>("VEC3", 5126, {0, 0, 0, -1, 0.5, 0, 0, -1, 0, 1, 0, -1, 0, 0, 0.5, -1}, 4);
  gltf.document["bufferViews"].back()["byteStride"] = 16;
  gltf.primitive()["attributes"]["POSITION"] = loose;
  EXPECT_EQ(read(gltf).meshes[0].points, read(TinyGltf()).meshes[0].points);
}

TEST(GltfReader, ReadsStepAndCubicSplineKeys) {
  TinyGltf step;
  step.document["animations"][0]["samplers"][0]["interpolation"] = "STEP";
  const Rig rig = rig_of(step);
  EXPECT_EQ(rig.clips[0].channels[0].rotation->interpolation, skeleton::Interpolation::Step);
  EXPECT_TRUE(has_finding(rig, "step-keys"));
  TinyGltf cubic;
  cubic.document["animations"][0]["samplers"][0] = {
      {"input", 5},
      {"interpolation", "CUBICSPLINE"},
      {"output",
       cubic.add<float>("VEC4", 5126,
                        {9, 9, 9, 9, 0, 0, 0, 1, 1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 1, 0, 9, 9, 9, 9}, 4)}};
  const auto scene = read(cubic);
  const skeleton::RotationTrack& track = *scene.clips[0].channels[0].rotation;
  EXPECT_EQ(track.out_tangents[0], Eigen::Vector4d(1, 2, 3, 4));
  EXPECT_EQ(track.in_tangents[1], Eigen::Vector4d(5, 6, 7, 8));
  EXPECT_EQ(track.values[1].coeffs(), Eigen::Vector4d(0, 0, 1, 0));
}

TEST(GltfReader, IgnoresTheSkinnedMeshesOwnPlace) {
  TinyGltf moved;
  moved.document["nodes"][2]["translation"] = {100, 0, 0};
  moved.document["nodes"][2]["scale"] = {0.01, 0.01, 0.01};
  EXPECT_EQ(rig_of(moved).parts[0].points, rig_of(TinyGltf()).parts[0].points);
}

TEST(GltfReader, LeavesOutMorphTargetsPointsAndLinesWithAWord) {
  TinyGltf gltf;
  gltf.primitive()["targets"] = {{{"POSITION", 0}}};
  json points = gltf.primitive();
  points["mode"] = 0;
  json lines = gltf.primitive();
  lines["mode"] = 1;
  gltf.document["meshes"][0]["primitives"].push_back(points);
  gltf.document["meshes"][0]["primitives"].push_back(lines);
  const Rig rig = rig_of(gltf);
  EXPECT_EQ(rig.parts.size(), 1u);
  EXPECT_TRUE(has_finding(rig, "morph-targets-ignored"));
  EXPECT_TRUE(has_finding(rig, "points-ignored"));
  EXPECT_TRUE(has_finding(rig, "lines-ignored"));
}

std::string message_of(const Rig& rig, const std::string& code) {
  for (const Finding& finding : rig.findings)
    if (finding.code == code) return finding.where + ": " + finding.message;
  return "";
}

TEST(GltfReader, TakesTheIdentityWhereASkinStatesNoBindMatrices) {
  TinyGltf gltf;
  gltf.document["skins"].push_back({{"joints", {0}}});  // one that no mesh uses
  EXPECT_EQ(rig_of(gltf).parts[0].points, rig_of(TinyGltf()).parts[0].points);
  gltf.document["skins"][0].erase("inverseBindMatrices");
  gltf.document["nodes"][1].erase("translation");  // where the identity has it
  const Rig rig = rig_of(gltf);
  EXPECT_EQ(rig.parts[0].points, rig_of(TinyGltf()).parts[0].points);
  for (const skeleton::Joint& joint : rig.skeleton.joints())
    EXPECT_TRUE(joint.rest_from_joint.isApprox(Eigen::Affine3d::Identity(), kEps)) << joint.name;
}

TEST(GltfReader, NamesChannelsThatBelongToAnExtensionAndPlaysTheOthers) {
  TinyGltf gltf;
  json& animations = gltf.document["animations"];
  animations.push_back(
      {{"name", "glow"},
       {"channels",
        {{{"sampler", 0},
          {"target",
           {{"path", "pointer"},
            {"extensions", {{"KHR_animation_pointer", {{"pointer", "/materials/0/emissiveFactor"}}}}}}}}}},
       {"samplers", {{{"input", 5}, {"output", 6}}}}});
  animations[1]["channels"].push_back(animations[0]["channels"][0]);
  const Rig rig = rig_of(gltf);
  EXPECT_EQ(
      message_of(rig, "channels-ignored"),
      "glow: channel 0 (KHR_animation_pointer '/materials/0/emissiveFactor'): no node is animated there; "
      "left out");
  ASSERT_EQ(rig.clips.size(), 2u);
  EXPECT_EQ(rig.clips[1].channels.size(), 1u);
}

TEST(GltfReader, SetsOneFaultyClipOfSeveralAside) {
  TinyGltf gltf;
  json& animations = gltf.document["animations"];
  animations.insert(animations.begin(), animations[0]);
  animations[0].erase("name");
  animations[0]["channels"].push_back(animations[0]["channels"][0]);  // twice
  animations.push_back(animations[1]);
  animations[2]["name"] = "jerk";
  const int times = gltf.add<float>("SCALAR", 5126, {0, 0}, 1);
  animations[2]["samplers"][0]["input"] = times;
  animations.push_back(animations[1]);
  animations[3].erase("name");
  const Rig rig = rig_of(gltf);
  ASSERT_EQ(rig.clips.size(), 2u);
  EXPECT_EQ(rig.clips[0].name, "nod");
  EXPECT_EQ(rig.clips[1].name, "clip_3");  // its place in the file
  ASSERT_EQ(rig.faulty_clips.size(), 2u);
  EXPECT_EQ(rig.faulty_clips[0].name, "clip_0");
  EXPECT_EQ(rig.faulty_clips[1].name, "jerk");
  EXPECT_TRUE(has_finding(rig, "clip-faulty"));
  EXPECT_EQ(choose_clip(rig, ""), 0);
  try {
    choose_clip(rig, "jerk");
    FAIL() << "taken";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(),
                HasSubstr("tiny.glb: clip 'jerk': node 'head': rotation: key 1: times do not increase"));
  }
  try {
    choose_clip(rig, "clip_0");
    FAIL() << "taken";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(),
                HasSubstr("clip 0: /animations/0/channels/1/target: node's rotation is animated twice"));
  }
}

TEST(GltfReader, TakesPlainDataThatStandsBesideCompressedData) {
  TinyGltf gltf;
  gltf.primitive()["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
  gltf.document["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  EXPECT_EQ(rig_of(gltf).parts[0].points, rig_of(TinyGltf()).parts[0].points);
}

TEST(GltfReader, RepairsWeightsThatAreNoNumbersLikeMissingOnes) {
  TinyGltf gltf;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < 4; ++i) gltf.set<float>(TinyGltf::kWeights, i, nan);  // all of vertex 0
  gltf.set<float>(TinyGltf::kWeights, 13, std::numeric_limits<float>::infinity());  // one of vertex 3
  const Rig rig = rig_of(gltf);
  EXPECT_EQ(message_of(rig, "weights-not-numbers"),
            "skin: 2 of 4 vertices had weights that are no numbers (nan or inf); those count as 0");
  EXPECT_TRUE(has_finding(rig, "weights-missing"));
  // Vertex 0 follows its neighbour 1, which hangs on the hip; vertex 3 keeps its other weight.
  for (const std::size_t v : {0u, 3u}) {
    ASSERT_EQ(rig.parts[0].weights[v].size(), 1u);
    EXPECT_EQ(rig.parts[0].weights[v][0].frame, 0);
    EXPECT_EQ(rig.parts[0].weights[v][0].weight, 1.0);
  }
}

TEST(GltfReader, FindsTheCharacterInAnotherScene) {
  TinyGltf gltf;
  gltf.document["nodes"].push_back({{"name", "prop"}, {"mesh", 0}});
  gltf.document["scenes"] = {
      {{"nodes", {3}}}, {{"nodes", json::array()}}, {{"name", "stage"}, {"nodes", {0, 2}}}};
  const Rig rig = rig_of(gltf);
  ASSERT_EQ(rig.parts.size(), 1u);
  EXPECT_EQ(rig.parts[0].role, PartRole::Simulated);
  EXPECT_EQ(message_of(rig, "other-scene-taken"),
            "stage: the default scene 0 shows no skinned mesh; scene 2 does and is taken");
  gltf.document["scene"] = 2;
  EXPECT_FALSE(has_finding(rig_of(gltf), "other-scene-taken"));
}

TEST(GltfReader, LeavesOutMeshesOfOtherScenes) {
  TinyGltf gltf;
  gltf.document["nodes"].push_back({{"name", "elsewhere"}, {"mesh", 0}});
  EXPECT_EQ(rig_of(gltf).parts.size(), 1u);
  gltf.document["scenes"][0]["nodes"].push_back(3);
  EXPECT_EQ(rig_of(gltf).parts.size(), 2u);
}

TEST(GltfUris, ABufferBesideTheFileAndADataUriAreRead) {
  TinyGltf gltf;
  write_file("beside me.bin", gltf.binary);
  gltf.document["buffers"] = {{{"byteLength", gltf.binary.size()}, {"uri", "beside%20me.bin"}}};
  EXPECT_EQ(read(gltf).meshes[0].points, read(TinyGltf()).meshes[0].points);
  TinyGltf inside;
  inside.document.erase("animations");
  inside.document.erase("skins");
  inside.document["nodes"][2].erase("skin");
  inside.document["accessors"] =
      json::parse(R"([{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}])");
  inside.document["bufferViews"] = json::parse(R"([{"buffer": 0, "byteLength": 36}])");
  // Nine floats: 0 0 0, 1 0 0, 0 1 0.
  inside.document["buffers"] = {
      {{"byteLength", 36},
       {"uri", "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}};
  inside.document["meshes"] = json::parse(R"([{"primitives": [{"attributes": {"POSITION": 0}}]}])");
  EXPECT_EQ(read(inside).meshes[0].points.row(2), Eigen::RowVector3d(0, 1, 0));
}

}  // namespace
}  // namespace sinew::assets
