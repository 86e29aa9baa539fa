#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/temporary_path.h"

namespace sinew::assets {

/// A glTF small enough to break one thing at a time: a tetrahedron on two joints with one clip. Change
/// `document` and `binary`, then write.
struct TinyGltf {
  nlohmann::json document;
  std::string binary;

  /// Indices of the accessors below.
  enum Accessor { kPosition, kIndices, kJoints, kWeights, kBind, kTimes, kRotations };

  TinyGltf() {
    document = nlohmann::json::parse(R"({
      "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
      "nodes": [{"name": "hip", "children": [1]}, {"name": "head", "translation": [0, 0.5, 0]},
                {"name": "body", "mesh": 0, "skin": 0}],
      "meshes": [{"name": "skin", "primitives": [{"indices": 1,
                  "attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}}]}],
      "skins": [{"joints": [0, 1], "inverseBindMatrices": 4}],
      "animations": [{"name": "nod", "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}],
                      "samplers": [{"input": 5, "output": 6}]}],
      "bufferViews": [], "accessors": []})");
    add<float>("VEC3", 5126, {0, 0, 0, 0.5, 0, 0, 0, 1, 0, 0, 0, 0.5}, 3);
    add<std::uint16_t>("SCALAR", 5123, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}, 1);
    add<std::uint8_t>("VEC4", 5121, {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, 4);
    add<float>("VEC4", 5126, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5, 0.5, 0, 0}, 4);
    add<float>("MAT4", 5126, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,    0, 1,
                              1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.5, 0, 1},
               16);
    add<float>("SCALAR", 5126, {0, 1}, 1);
    const float half = 0.70710678F;
    add<float>("VEC4", 5126, {0, 0, 0, 1, 0, 0, half, half}, 4);
  }

  /// Appends an accessor with a view of its own; gives its index.
  template <typename T>
  int add(const std::string& type, int component_type, const std::vector<T>& values, int components) {
    while (binary.size() % 4 != 0) binary.push_back('\0');
    const std::size_t bytes = values.size() * sizeof(T);
    document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes}});
    document["accessors"].push_back({{"bufferView", document["bufferViews"].size() - 1},
                                     {"componentType", component_type},
                                     {"type", type},
                                     {"count", values.size() / static_cast<std::size_t>(components)}});
    binary.append(reinterpret_cast<const char*>(values.data()), bytes);
    return static_cast<int>(document["accessors"].size()) - 1;
  }

  /// Overwrites one value of an accessor that add() made.
  template <typename T>
  void set(int accessor, std::size_t index, T value) {
    const auto view =
        document["accessors"][static_cast<std::size_t>(accessor)]["bufferView"].get<std::size_t>();
    const auto offset = document["bufferViews"][view]["byteOffset"].get<std::size_t>();
    std::memcpy(binary.data() + offset + index * sizeof(T), &value, sizeof(T));
  }

  nlohmann::json& primitive() { return document["meshes"][0]["primitives"][0]; }

  static void append_u32(std::string& bytes, std::size_t value) {
    for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>((value >> shift) & 0xFF));
  }

  std::string glb() const {
    nlohmann::json whole = document;
    std::string data = binary;
    while (data.size() % 4 != 0) data.push_back('\0');
    if (!whole.contains("buffers")) whole["buffers"] = {{{"byteLength", data.size()}}};
    std::string text = whole.dump();
    while (text.size() % 4 != 0) text.push_back(' ');
    std::string bytes = "glTF";
    append_u32(bytes, 2);
    append_u32(bytes, 12 + 8 + text.size() + 8 + data.size());
    append_u32(bytes, text.size());
    bytes += "JSON" + text;
    append_u32(bytes, data.size());
    bytes += std::string("BIN\0", 4) + data;
    return bytes;
  }
};

/// A folder of this process alone (tests run side by side), removed at its end; with a slash behind it.
inline const std::string& test_folder() {
  static const struct Folder {
    std::string path = tests::temporary_path("files/");
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  } folder;
  return folder.path;
}

/// Writes bytes into that folder and gives the path.
inline std::string write_file(const std::string& name, std::string_view bytes) {
  const std::string path = test_folder() + name;
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  EXPECT_TRUE(out.good()) << path;
  return path;
}

}  // namespace sinew::assets
