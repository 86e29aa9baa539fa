#include "assets/glb_writer.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sinew::assets {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// A strip of triangles over `num_points` points, on one joint.
GlbScene strip(int num_points) {
  GlbPrimitive primitive;
  primitive.points.resize(num_points, 3);
  for (int i = 0; i < num_points; ++i) primitive.points.row(i) << i, i % 2, -0.25;
  primitive.normals = lattice::Points::Zero(num_points, 3);
  primitive.triangles.resize(num_points - 2, 3);
  for (int t = 0; t + 2 < num_points; ++t) primitive.triangles.row(t) << t, t + 1, t + 2;
  primitive.weights.assign(static_cast<std::size_t>(num_points), {{0, 1.0}});
  GlbScene scene;
  scene.meshes = {{"strip", {primitive}}};
  scene.nodes.resize(2);
  scene.nodes[0].name = "joint";
  scene.nodes[1].name = "strip";
  scene.nodes[1].mesh = 0;
  scene.nodes[1].skinned = true;
  scene.joints = {0};
  scene.joint_from_rest = {Eigen::Affine3d::Identity()};
  return scene;
}

/// The two chunks of a GLB file, taken apart as the specification draws them.
struct Chunks {
  nlohmann::json json;
  std::string binary;

  explicit Chunks(const std::string& bytes) {
    const auto u32 = [&](std::size_t at) {
      std::uint32_t value = 0;
      std::memcpy(&value, bytes.data() + at, 4);
      return value;
    };
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(u32(4), 2u);
    EXPECT_EQ(u32(8), bytes.size());
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    const std::size_t length = u32(12);
    json = nlohmann::json::parse(bytes.substr(20, length));
    EXPECT_EQ(bytes.substr(20 + length + 4, 4), std::string("BIN\0", 4));
    binary = bytes.substr(28 + length);
    EXPECT_EQ(binary.size(), u32(20 + length));
    EXPECT_EQ(json["buffers"][0]["byteLength"], binary.size());
  }

  template <class T>
  std::vector<T> values(const nlohmann::json& accessor_index, std::size_t width) const {
    const auto& accessor = json["accessors"][accessor_index.get<std::size_t>()];
    const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    std::vector<T> list(accessor["count"].get<std::size_t>() * width);
    EXPECT_EQ(view["byteLength"], list.size() * sizeof(T));
    std::memcpy(list.data(), binary.data() + view["byteOffset"].get<std::size_t>(), list.size() * sizeof(T));
    return list;
  }
};

TEST(GlbBytes, HoldPositionsWithTheirBoundsAndIndices) {
  const Chunks file(glb_bytes(strip(5)));
  const auto& primitive = file.json["meshes"][0]["primitives"][0];
  const auto positions = file.values<float>(primitive["attributes"]["POSITION"], 3);
  EXPECT_THAT(positions,
              testing::ElementsAre(0, 0, -0.25f, 1, 1, -0.25f, 2, 0, -0.25f, 3, 1, -0.25f, 4, 0, -0.25f));
  const auto& accessor = file.json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_EQ(accessor["min"], nlohmann::json({0.0, 0.0, -0.25}));
  EXPECT_EQ(accessor["max"], nlohmann::json({4.0, 1.0, -0.25}));
  EXPECT_THAT(file.values<std::uint16_t>(primitive["indices"], 1),
              testing::ElementsAre(0, 1, 2, 1, 2, 3, 2, 3, 4));
}

TEST(GlbBytes, StoreWeightsThatSumToOneExactly) {
  GlbScene scene = strip(4);
  auto& weights = scene.meshes[0].primitives[0].weights;
  weights[0] = {{0, 1.0 / 3}, {1, 1.0 / 3}, {2, 1.0 / 3}};
  weights[1] = {{3, 0.7}, {1, 0.1}, {0, 0.1}, {2, 0.1}};
  weights[2] = {{2, 1e-9}, {1, 1.0}};
  const Chunks file(glb_bytes(scene));
  const auto& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  const auto shares = file.values<std::uint16_t>(attributes["WEIGHTS_0"], 4);
  for (std::size_t v = 0; v < 4; ++v)
    EXPECT_EQ(shares[4 * v] + shares[4 * v + 1] + shares[4 * v + 2] + shares[4 * v + 3], 65535) << v;
  EXPECT_EQ(shares[0], 21845);  // a third of 65535
  const auto joints = file.values<std::uint8_t>(attributes["JOINTS_0"], 4);
  EXPECT_EQ(joints[4], 3);
  EXPECT_EQ(joints[8], 0);  // a share of 0 names joint 0
}

TEST(GlbBytes, TakeWiderIndicesWhereSixteenBitsDoNotReach) {
  for (const auto& [num_points, component] : {std::pair{65535, 5123}, {65536, 5125}}) {
    const Chunks file(glb_bytes(strip(num_points)));
    const auto index = file.json["meshes"][0]["primitives"][0]["indices"].get<std::size_t>();
    EXPECT_EQ(file.json["accessors"][index]["componentType"], component) << num_points;
  }
}

TEST(GlbBytes, RefuseAnInconsistentSceneByName) {
  const auto expect = [](const auto& change, const std::string& words) {
    GlbScene scene = strip(4);
    change(scene);
    EXPECT_THAT([&] { glb_bytes(scene); }, ThrowsMessage<std::invalid_argument>(HasSubstr(words)));
  };
  expect([](GlbScene& s) { s.meshes[0].primitives[0].triangles(0, 0) = 4; },
         "'strip': a triangle names vertex 4 of 4");
  expect([](GlbScene& s) { s.meshes[0].primitives[0].normals.resize(3, 3); },
         "'strip': one normal per vertex");
  expect([](GlbScene& s) { s.meshes[0].primitives[0].triangles.resize(0, 3); }, "'strip': no triangles");
  expect([](GlbScene& s) { s.meshes[0].primitives[0].weights[2].clear(); }, "vertex 2 has 0 influences");
  expect([](GlbScene& s) { s.meshes[0].primitives[0].weights[2][0].frame = 256; },
         "joint 256, expected 0 to 255");
  expect([](GlbScene& s) { s.meshes[0].primitives[0].weights[1][0].weight = 0.0; },
         "vertex 1 has a weight that is not");
  expect([](GlbScene& s) { s.nodes[0].parent = 1; }, "node 'joint': its parent must come before it");
  expect([](GlbScene& s) { s.joint_from_rest.clear(); }, "one inverse bind matrix per joint");
  expect(
      [](GlbScene& s) {
        skeleton::VectorTrack track{
            skeleton::Interpolation::CubicSpline, {0.0}, {Eigen::Vector3d::Zero()}, {}, {}};
        s.clips = {{"wave", 0.0, 0.0, 1, {{0, track, std::nullopt, std::nullopt}}}};
      },
      "clip 'wave': only linear and stepped keys");
}

}  // namespace
}  // namespace sinew::assets
