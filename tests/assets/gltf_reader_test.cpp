#include "assets/detail/gltf_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
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

TEST(GltfReader, LeavesOutMeshesOfOtherScenes) {
  TinyGltf gltf;
  gltf.document["nodes"].push_back({{"name", "elsewhere"}, {"mesh", 0}});
  EXPECT_EQ(rig_of(gltf).parts.size(), 1u);
  gltf.document["scenes"][0]["nodes"].push_back(3);
  EXPECT_EQ(rig_of(gltf).parts.size(), 2u);
}

/// One thing changed, and the line it must give after the file's name.
struct Broken {
  const char* what;
  void (*change)(TinyGltf&);
  const char* line;
};

std::ostream& operator<<(std::ostream& out, const Broken& broken) { return out << broken.what; }

class BrokenGltf : public testing::TestWithParam<Broken> {};

TEST_P(BrokenGltf, GivesItsLine) {
  TinyGltf gltf;
  GetParam().change(gltf);
  const std::string file = write_file("broken.glb", gltf.glb());
  try {
    detail::ImportedScene scene = detail::read_gltf(file);
    detail::check_scene(file, scene);
    detail::build_rig(file, std::move(scene), {});
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()), file + ": " + GetParam().line);
  }
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    OneThingAtATime, BrokenGltf,
    testing::Values(
        Broken{"old version", [](TinyGltf& g) { g.document["asset"]["version"] = "1.0"; },
               "/asset/version: got '1.0', expected 2.x; hint: export as glTF 2.0"},
        Broken{"draco",
               [](TinyGltf& g) { g.document["extensionsRequired"] = {"KHR_draco_mesh_compression"}; },
               "/extensionsRequired: extension 'KHR_draco_mesh_compression' is not supported; hint: export "
               "again with "
               "mesh compression switched off"},
        Broken{"meshopt", [](TinyGltf& g) { g.document["extensionsRequired"] = {"EXT_meshopt_compression"}; },
               "/extensionsRequired: extension 'EXT_meshopt_compression' is not supported; hint: export "
               "again with "
               "mesh compression switched off"},
        Broken{"unknown extension", [](TinyGltf& g) { g.document["extensionsRequired"] = {"ACME_bones"}; },
               "/extensionsRequired: extension 'ACME_bones' is not supported; hint: export again without it"},
        Broken{"count of 2^31 - 1", [](TinyGltf& g) { g.document["accessors"][0]["count"] = 2147483647; },
               "/accessors/0: more elements than data, needs 25769803764 bytes from offset 0, got 48 in view "
               "0; hint: "
               "copy or export the file again"},
        Broken{"count of 2^53", [](TinyGltf& g) { g.document["accessors"][0]["count"] = 9007199254740992; },
               "/accessors/0: more elements than data, needs 108086391056891904 bytes from offset 0, got 48 "
               "in view "
               "0; hint: copy or export the file again"},
        Broken{"offset near 2^64",
               [](TinyGltf& g) { g.document["bufferViews"][0]["byteOffset"] = 18446744073709551608u; },
               "/bufferViews/0/byteOffset: whole number, got 18446744073709551608, expected 0 to "
               "9007199254740992; "
               "hint: export the file again"},
        Broken{"view beyond its buffer",
               [](TinyGltf& g) { g.document["bufferViews"][0]["byteOffset"] = 9007199254740991; },
               "/bufferViews/0: reaches beyond its buffer, got 48 bytes from offset 9007199254740991, "
               "expected at "
               "most 320 bytes in all; hint: copy or export the file again"},
        Broken{"negative offset", [](TinyGltf& g) { g.document["bufferViews"][0]["byteOffset"] = -4; },
               "/bufferViews/0/byteOffset: whole number, got -4, expected 0 to 9007199254740992; hint: "
               "export the file "
               "again"},
        Broken{"index past the last vertex",
               [](TinyGltf& g) { g.set<std::uint16_t>(TinyGltf::kIndices, 5, 4); },
               "/accessors/1: element 5 points past the last vertex, got 4, expected 0 to 3; hint: export "
               "the file "
               "again"},
        Broken{"matrix of 15 numbers",
               [](TinyGltf& g) { g.document["nodes"][0]["matrix"] = std::vector<double>(15, 1.0); },
               "/nodes/0 'hip'/matrix: number of values, got 15, expected 16; hint: export the file again"},
        Broken{
            "translation of two numbers",
            [](TinyGltf& g) {
              g.document["nodes"][1]["translation"] = {0, 1};
            },
            "/nodes/1 'head'/translation: number of values, got 2, expected 3; hint: export the file again"},
        Broken{"zero rotation",
               [](TinyGltf& g) {
                 g.document["nodes"][1]["rotation"] = {0, 0, 0, 0};
               },
               "/nodes/1 'head'/rotation: quaternion of length 0, expected length 1"},
        Broken{"cycle", [](TinyGltf& g) { g.document["nodes"][1]["children"] = {0}; },
               "nodes: a node is its own ancestor, got /nodes/1 'head' -> /nodes/0 'hip' -> /nodes/1 'head', "
               "expected "
               "a tree; hint: export the file again"},
        Broken{"own parent", [](TinyGltf& g) { g.document["nodes"][2]["children"] = {2}; },
               "nodes: a node is its own ancestor, got /nodes/2 'body' -> /nodes/2 'body', expected a tree; "
               "hint: "
               "export the file again"},
        Broken{"two parents", [](TinyGltf& g) { g.document["nodes"][2]["children"] = {1}; },
               "/nodes/1 'head': has two parents, got /nodes/0 'hip' and /nodes/2 'body', expected one; "
               "hint: export "
               "the file again"},
        Broken{"child that is not there", [](TinyGltf& g) { g.document["nodes"][1]["children"] = {9}; },
               "/nodes/1 'head'/children: index, got 9, expected 0 to 2; hint: export the file again"},
        Broken{
            "NaN vertex", [](TinyGltf& g) { g.set<float>(TinyGltf::kPosition, 4, kNan); },
            "mesh 'skin': vertex 1: y coordinate, got nan, expected a finite number; hint: delete the broken "
            "vertices and export again"},
        Broken{"joint out of range", [](TinyGltf& g) { g.set<std::uint8_t>(TinyGltf::kJoints, 8, 7); },
               "mesh 'skin': vertex 2: joint index, got 7, expected 0 to 1; hint: bind the skin again"},
        Broken{"negative weight", [](TinyGltf& g) { g.set<float>(TinyGltf::kWeights, 13, -0.5F); },
               "mesh 'skin': vertex 3: weight of joint 'head', got -0.5, expected a number >= 0; hint: "
               "normalise the "
               "weights and export again"},
        Broken{"NaN weight", [](TinyGltf& g) { g.set<float>(TinyGltf::kWeights, 0, kNan); },
               "mesh 'skin': vertex 0: weight of joint 'hip', got nan, expected a number >= 0; hint: "
               "normalise the "
               "weights and export again"},
        Broken{"weights without joints", [](TinyGltf& g) { g.primitive()["attributes"].erase("JOINTS_0"); },
               "/meshes/0/primitives/0/attributes: JOINTS_0 and WEIGHTS_0 belong together, got one of them"},
        Broken{"fewer weights than vertices", [](TinyGltf& g) { g.document["accessors"][3]["count"] = 3; },
               "/meshes/0/primitives/0/attributes/WEIGHTS_0: number of elements, got 3, expected 4 as in "
               "POSITION"},
        Broken{"too few bind matrices", [](TinyGltf& g) { g.document["accessors"][4]["count"] = 1; },
               "/skins/0/inverseBindMatrices: number of matrices, got 1, expected 2, one per joint; hint: "
               "bind the "
               "skin again"},
        Broken{"singular bind matrix", [](TinyGltf& g) { g.set<float>(TinyGltf::kBind, 16, 0.0F); },
               "joint 'head': inverse bind matrix is singular, got determinant 0, expected not 0; hint: bind "
               "the skin "
               "again while the joint has a size"},
        Broken{"joint that is not there",
               [](TinyGltf& g) {
                 g.document["skins"][0]["joints"] = {0, 5};
               },
               "/skins/0/joints: index, got 5, expected 0 to 2; hint: export the file again"},
        Broken{"wrong type of positions",
               [](TinyGltf& g) { g.primitive()["attributes"]["POSITION"] = TinyGltf::kRotations; },
               "/meshes/0/primitives/0/attributes/POSITION: type of accessor 6, got VEC4, expected VEC3"},
        Broken{"accessor that is not there",
               [](TinyGltf& g) { g.primitive()["attributes"]["POSITION"] = 70; },
               "/meshes/0/primitives/0/attributes/POSITION: accessor index, got 70, expected 0 to 6"},
        Broken{"no positions", [](TinyGltf& g) { g.primitive()["attributes"].erase("POSITION"); },
               "/meshes/0/primitives/0/attributes: POSITION is missing; hint: export the file again"},
        Broken{"zero keys", [](TinyGltf& g) { g.document["accessors"][5]["count"] = 0; },
               "/accessors/5: count, got 0, expected at least 1"},
        Broken{"times that do not increase", [](TinyGltf& g) { g.set<float>(TinyGltf::kTimes, 1, 0.0F); },
               "clip 'nod': node 'head': rotation: key 1: times do not increase, got 0 s after 0 s; hint: "
               "bake the "
               "animation and export again"},
        Broken{"NaN time", [](TinyGltf& g) { g.set<float>(TinyGltf::kTimes, 1, kNan); },
               "clip 'nod': node 'head': rotation: key 1: time, got nan, expected a finite number"},
        Broken{"NaN key", [](TinyGltf& g) { g.set<float>(TinyGltf::kRotations, 5, kNan); },
               "clip 'nod': node 'head': rotation: key 1 at 1 s: quaternion of length nan, expected length "
               "1; hint: "
               "bake the animation and export again"},
        Broken{"zero key", [](TinyGltf& g) { g.set<float>(TinyGltf::kRotations, 3, 0.0F); },
               "clip 'nod': node 'head': rotation: key 0 at 0 s: quaternion of length 0, expected length 1; "
               "hint: bake "
               "the animation and export again"},
        Broken{"fewer values than keys", [](TinyGltf& g) { g.document["accessors"][6]["count"] = 1; },
               "/animations/0/samplers/0/output: number of values, got 1, expected 2 for 2 keys"},
        Broken{"unknown interpolation",
               [](TinyGltf& g) { g.document["animations"][0]["samplers"][0]["interpolation"] = "MAGIC"; },
               "/animations/0/samplers/0/interpolation: got 'MAGIC', expected LINEAR, STEP or CUBICSPLINE"},
        Broken{"channel for a missing node",
               [](TinyGltf& g) { g.document["animations"][0]["channels"][0]["target"]["node"] = 8; },
               "/animations/0/channels/0/target/node: index, got 8, expected 0 to 2; hint: export the file "
               "again"},
        Broken{"sparse count",
               [](TinyGltf& g) {
                 g.document["accessors"][0]["sparse"] = {
                     {"count", 5},
                     {"indices", {{"bufferView", 1}, {"componentType", 5121}}},
                     {"values", {{"bufferView", 0}}}};
               },
               "/accessors/0/sparse: count, got 5, expected 1 to 4"},
        Broken{"whole number too large for an index",
               [](TinyGltf& g) { g.document["nodes"][2]["mesh"] = 4294967296; },
               "/nodes/2/mesh: whole number, got 4294967296, expected -2147483648 to 2147483647; hint: "
               "export the "
               "file again"},
        Broken{"more buffer than bytes",
               [](TinyGltf& g) {
                 g.document["buffers"] = {{{"byteLength", 5000}}};
               },
               "/buffers/0/byteLength: more than there is, got 5000, expected at most 320; hint: copy or "
               "export the "
               "file again"},
        Broken{"remote buffer",
               [](TinyGltf& g) {
                 g.document["buffers"] = {{{"byteLength", 320}, {"uri", "https://example.com/a.bin"}}};
               },
               "/buffers/0/uri: 'https://example.com/a.bin': remote URIs are not supported; hint: download "
               "the buffer "
               "and put it beside the file"},
        Broken{"missing buffer",
               [](TinyGltf& g) {
                 g.document["buffers"] = {{{"byteLength", 320}, {"uri", "no%20such.bin"}}};
               },
               "/buffers/0/uri: buffer 'no%20such.bin' is missing; hint: keep it beside the file, or export "
               "as .glb"}));

TEST(GltfUris, OutsideTheAssetsDirectoryAreRefusedInEveryDisguise) {
  // The secret lies one folder up; no disguise may reach it, and its text may not show.
  std::filesystem::create_directories(test_folder() + "asset");
  write_file("secret.bin", std::string(320, 's'));
  std::error_code ignored;
  std::filesystem::remove(test_folder() + "asset/link.bin", ignored);
  std::filesystem::create_symlink(test_folder() + "secret.bin", test_folder() + "asset/link.bin");
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("%2e%2e%2fsecret.bin"), std::string("..\\secret.bin"),
        std::string("sub/../../secret.bin"), test_folder() + "secret.bin",
        "file://" + test_folder() + "secret.bin", std::string("link.bin"), std::string("a%00b")}) {
    TinyGltf gltf;
    gltf.document["buffers"] = {{{"byteLength", 320}, {"uri", uri}}};
    const std::string file = write_file("asset/outside.glb", gltf.glb());
    try {
      detail::read_gltf(file);
      ADD_FAILURE() << "accepted " << uri;
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()),
                file + ": /buffers/0/uri: '" + uri +
                    "' is outside the asset directory; hint: put the buffer beside the file, or "
                    "export as .glb");
    }
  }
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

std::string error_of(const std::string& bytes) {
  const std::string file = write_file("bytes.glb", bytes);
  try {
    detail::check_scene(file, detail::read_gltf(file));
  } catch (const InputError& e) {
    return std::string(e.what()).substr(file.size() + 2);
  }
  return "accepted";
}

TEST(GlbContainer, CutAtAnyByteGivesOneLine) {
  const std::string whole = TinyGltf().glb();
  ASSERT_EQ(error_of(whole), "accepted");
  // Below 4 bytes the magic itself is missing, and the bytes count as JSON.
  for (std::size_t length = 1; length < whole.size(); ++length) {
    const std::string line = error_of(whole.substr(0, length));
    EXPECT_THAT(line, HasSubstr("hint: ")) << "cut to " << length << " bytes";
    if (length >= 12) {
      EXPECT_EQ(line, "GLB header: file is truncated, got " + std::to_string(length) + " bytes, expected " +
                          std::to_string(whole.size()) +
                          " as declared at offset 8; hint: copy or export the file again");
    }
  }
}

TEST(GlbContainer, CutWithAMatchingLengthFieldGivesOneLineToo) {
  // The harder case: the header agrees with the cut, so that chunks, JSON and views must notice.
  const std::string whole = TinyGltf().glb();
  for (std::size_t length = 12; length < whole.size(); ++length) {
    std::string cut = whole.substr(0, length);
    std::string field;
    TinyGltf::append_u32(field, length);
    cut.replace(8, 4, field);
    EXPECT_NE(error_of(cut), "accepted") << "cut to " << length << " bytes";
  }
}

TEST(GlbContainer, NamesTheChunkThatIsWrong) {
  const std::string whole = TinyGltf().glb();
  std::string huge = whole;
  huge.replace(8, 4, "\xff\xff\xff\xff");
  EXPECT_EQ(error_of(huge),
            "GLB header: file is truncated, got " + std::to_string(whole.size()) +
                " bytes, expected 4294967295 as declared at offset 8; hint: copy or export the file "
                "again");
  std::string long_chunk = whole;
  long_chunk.replace(12, 4, "\xff\xff\xff\xff");
  EXPECT_EQ(error_of(long_chunk),
            "GLB JSON chunk at offset 12: longer than the file, got a declared 4294967295 bytes, "
            "expected at most " +
                std::to_string(whole.size() - 20) + "; hint: copy or export the file again");
  std::string binary_first = whole;
  binary_first.replace(16, 4, std::string("BIN\0", 4));
  EXPECT_EQ(
      error_of(binary_first),
      "GLB JSON chunk at offset 12: wrong chunk type, got BIN, expected JSON; hint: export the file again");
  std::string old = whole;
  old[4] = 1;
  EXPECT_EQ(error_of(old), "GLB header: version, got 1, expected 2; hint: export as glTF 2.0");
}

TEST(GltfJson, IsParsedStrictly) {
  for (const char* text :
       {"{\"a\": 1e999}", "{\"a\": NaN}", "{\"a\": 1,5}", "{\"a\": 0x10}", "{\"a\": 1,}", "[1", ""}) {
    const std::string line = error_of(text);
    EXPECT_THAT(line, HasSubstr("JSON: cannot be parsed: ")) << text;
    EXPECT_EQ(line.find('\n'), std::string::npos);
  }
  EXPECT_EQ(error_of(std::string(100000, '[')),
            "JSON: nested too deeply, got more than 128 levels; hint: export the file again");
}

TEST(GltfAccessors, DoNotAllocateWhatTheFileOnlyClaims) {
  // 10^7 claimed elements without data: refused before anything of that size is allocated.
  TinyGltf gltf;
  json& position = gltf.document["accessors"][TinyGltf::kPosition];
  position.erase("bufferView");
  position["count"] = 1u << 30;
  EXPECT_THAT(error_of(gltf.glb()), HasSubstr("/accessors/0: elements without data, got 1073741824"));
}

}  // namespace
}  // namespace sinew::assets
