#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/gltf_reader.h"
#include "assets/detail/imported_scene.h"
#include "assets/detail/rig_builder.h"
#include "assets/error.h"
#include "tests/assets/tiny_gltf.h"

/// glTF files that are wrong in one thing, and the one line that each gives.
namespace sinew::assets {
namespace {

using nlohmann::json;
using testing::HasSubstr;

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
        Broken{
            "draco that is not required, alone",
            [](TinyGltf& g) {
              g.primitive()["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
              g.document["accessors"][TinyGltf::kIndices].erase("bufferView");
            },
            "/meshes/0/primitives/0: extension 'KHR_draco_mesh_compression' is not supported; hint: export "
            "again with mesh compression switched off"},
        Broken{
            "meshopt that is not required, alone",
            [](TinyGltf& g) {
              g.document["buffers"] = {
                  {{"byteLength", 320}},
                  {{"byteLength", 900}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
              g.document["bufferViews"][2]["buffer"] = 1;
              g.document["bufferViews"][2]["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}};
            },
            "/bufferViews/2: extension 'EXT_meshopt_compression' is not supported; hint: export again with "
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
               "clip 'nod': /animations/0/samplers/0/output: number of values, got 1, expected 2 for 2 keys"},
        Broken{"unknown interpolation",
               [](TinyGltf& g) { g.document["animations"][0]["samplers"][0]["interpolation"] = "MAGIC"; },
               "clip 'nod': /animations/0/samplers/0/interpolation: got 'MAGIC', expected LINEAR, STEP or "
               "CUBICSPLINE"},
        Broken{"channel for a missing node",
               [](TinyGltf& g) { g.document["animations"][0]["channels"][0]["target"]["node"] = 8; },
               "clip 'nod': /animations/0/channels/0/target/node: index, got 8, expected 0 to 2; hint: "
               "export the file "
               "again"},
        Broken{"one part of a node animated twice",
               [](TinyGltf& g) {
                 json& channels = g.document["animations"][0]["channels"];
                 channels.push_back(channels[0]);
               },
               "clip 'nod': /animations/0/channels/1/target: node's rotation is animated twice in one clip, "
               "expected once"},
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

std::string error_of(const std::string& bytes) {
  const std::string file = write_file("bytes.glb", bytes);
  try {
    detail::ImportedScene scene = detail::read_gltf(file);
    detail::check_scene(file, scene);
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
