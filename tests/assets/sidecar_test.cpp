#include "assets/sidecar.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sinew::assets {
namespace {

Sidecar example() {
  Sidecar sidecar;
  sidecar.version = "1.2.3";
  sidecar.rig_file = "hopper.glb";
  sidecar.clip = "hop";
  sidecar.rest_mesh = "skin.obj";
  sidecar.cache = "skin.pc2";
  sidecar.rest = FloatPoints::Zero(3, 3);
  sidecar.parts = {{"body", 2}, {"eye", 1}};
  sidecar.vertex_order = VertexOrder::Importer;
  sidecar.fps = 24.0;
  sidecar.clip_start = 10.5;
  sidecar.first_frame = 5;
  sidecar.num_frames = 9;
  sidecar.metres_per_unit = 0.01;
  sidecar.up_axis = UpAxis::Z;
  sidecar.settings_json = R"({"step": 0.01})";
  return sidecar;
}

TEST(RestHash, IsTheFnv1aHashOfTheFloatBytes) {
  EXPECT_EQ(rest_hash(FloatPoints(0, 3)), 0xcbf29ce484222325u);  // the offset basis, as published
  // The bytes 00 00 80 3f and eight zeros, hashed by a few lines of Python with whole numbers of any length.
  FloatPoints one(1, 3);
  one << 1, 0, 0;
  EXPECT_EQ(rest_hash(one), 0xf15182ea2c8c1298u);
  FloatPoints other = one;
  other(0, 2) = -0.0f;  // another bit, another hash
  EXPECT_NE(rest_hash(other), rest_hash(one));
}

TEST(SidecarJson, SaysWhatAReaderOfTheCacheNeeds) {
  const auto json = nlohmann::json::parse(sidecar_json(example()));
  EXPECT_EQ(json["generator"], "sinew 1.2.3");
  EXPECT_EQ(json["vertex_count"], 3);
  EXPECT_EQ(json["rest_hash"]["value"].get<std::string>().size(), 16u);
  EXPECT_EQ(json["fps"], 24.0);
  EXPECT_EQ(json["clip_start_s"], 10.5);
  EXPECT_EQ(json["first_frame"], 5);
  EXPECT_EQ(json["frame_count"], 9);
  EXPECT_EQ(json["units"]["metres_per_unit"], 0.01);
  EXPECT_EQ(json["axes"]["up"], "Z");
  EXPECT_EQ(json["vertex_order"]["source"], "importer");
  EXPECT_EQ(json["parts"][1]["first_vertex"], 2);
  EXPECT_EQ(json["settings"]["step"], 0.01);
  EXPECT_FALSE(json.contains("error_estimate"));  // not estimated, so not claimed
}

TEST(SidecarJson, GivesTheErrorOnlyWhereItWasEstimated) {
  Sidecar sidecar = example();
  sidecar.error_estimate = 1e-3;
  EXPECT_EQ(nlohmann::json::parse(sidecar_json(sidecar))["error_estimate"]["value"], 1e-3);
}

TEST(SidecarJson, RefusesCountsThatDoNotFitAndSettingsThatAreNoObject) {
  Sidecar sidecar = example();
  sidecar.parts.pop_back();
  EXPECT_THROW(sidecar_json(sidecar), std::invalid_argument);
  sidecar = example();
  sidecar.settings_json = "[1";
  EXPECT_THROW(sidecar_json(sidecar), std::invalid_argument);
  sidecar = example();
  sidecar.fps = 0.0;
  EXPECT_THROW(sidecar_json(sidecar), std::invalid_argument);
}

TEST(SidecarJson, TakesFileNamesThatAreNotUtf8) {
  Sidecar sidecar = example();
  sidecar.rig_file = "caf\xe9.glb";
  EXPECT_NO_THROW(nlohmann::json::parse(sidecar_json(sidecar)));
}

}  // namespace
}  // namespace sinew::assets
