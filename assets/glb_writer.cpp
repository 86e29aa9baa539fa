#include "assets/glb_writer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace sinew::assets {
namespace {

using Json = nlohmann::ordered_json;

// glTF 2.0, section 3.6.2.2 and 5.1: component types and targets.
constexpr int kUnsignedByte = 5121, kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr std::size_t kMaxInfluences = 4;
constexpr int kWeightSum = 65535;

/// Collects the binary chunk and the accessors that look into it.
class Buffer {
 public:
  /// Appends one accessor over `values` with `width` components per element; returns its index.
  template <class T>
  int add(const std::vector<T>& values, int width, const char* type, int component, int target = 0) {
    while (bytes_.size() % 4 != 0) bytes_.push_back('\0');
    Json view = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (target != 0) view["target"] = target;
    const std::size_t offset = bytes_.size();
    bytes_.resize(offset + values.size() * sizeof(T));
    if (!values.empty()) std::memcpy(bytes_.data() + offset, values.data(), values.size() * sizeof(T));
    accessors.push_back({{"bufferView", views.size()},
                         {"componentType", component},
                         {"count", values.size() / static_cast<std::size_t>(width)},
                         {"type", type}});
    views.push_back(view);
    return static_cast<int>(accessors.size()) - 1;
  }

  /// Adds the smallest and largest value of each component to the newest accessor.
  void add_bounds(const std::vector<float>& values, int width) {
    std::vector<float> low(values.begin(), values.begin() + width), high = low;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t c = i % static_cast<std::size_t>(width);
      low[c] = std::min(low[c], values[i]);
      high[c] = std::max(high[c], values[i]);
    }
    accessors.back()["min"] = low;
    accessors.back()["max"] = high;
  }

  std::string take_bytes() {
    while (bytes_.size() % 4 != 0) bytes_.push_back('\0');
    return std::move(bytes_);
  }

  Json views = Json::array(), accessors = Json::array();

 private:
  std::string bytes_;
};

std::vector<float> to_floats(const lattice::Points& points) {
  std::vector<float> values;
  values.reserve(static_cast<std::size_t>(points.size()));
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(points(i, c)));
  return values;
}

/// Shares of kWeightSum by largest remainder, so that the stored weights sum to 1 exactly.
std::array<std::uint16_t, kMaxInfluences> quantise(const std::vector<lattice::Influence>& influences) {
  std::array<std::uint16_t, kMaxInfluences> shares{};
  std::array<double, kMaxInfluences> remainder{};
  double sum = 0.0;
  for (const auto& influence : influences) sum += influence.weight;
  int left = kWeightSum;
  for (std::size_t k = 0; k < influences.size(); ++k) {
    const double share = influences[k].weight / sum * kWeightSum;
    shares[k] = static_cast<std::uint16_t>(std::floor(share));
    remainder[k] = share - std::floor(share);
    left -= shares[k];
  }
  for (; left > 0; --left) {
    const auto largest = std::max_element(remainder.begin(), remainder.end()) - remainder.begin();
    ++shares[static_cast<std::size_t>(largest)];
    remainder[static_cast<std::size_t>(largest)] = -1.0;
  }
  return shares;
}

void add_weights(const GlbPrimitive& primitive, const std::string& mesh, Buffer& buffer, Json& attributes) {
  std::vector<std::uint8_t> joints;
  std::vector<std::uint16_t> weights;
  for (std::size_t v = 0; v < primitive.weights.size(); ++v) {
    const auto& influences = primitive.weights[v];
    if (influences.empty() || influences.size() > kMaxInfluences)
      throw std::invalid_argument("mesh '" + mesh + "': vertex " + std::to_string(v) + " has " +
                                  std::to_string(influences.size()) + " influences, expected 1 to 4");
    if (!std::all_of(influences.begin(), influences.end(), [](const auto& i) { return i.weight > 0.0; }))
      throw std::invalid_argument("mesh '" + mesh + "': vertex " + std::to_string(v) +
                                  " has a weight that is not positive");
    const auto shares = quantise(influences);
    for (std::size_t k = 0; k < kMaxInfluences; ++k) {
      // An unused slot names joint 0: glTF asks for a valid index even where the weight is 0.
      const bool used = k < influences.size() && shares[k] > 0;
      if (used && (influences[k].frame < 0 || influences[k].frame > 255))
        throw std::invalid_argument("mesh '" + mesh + "': joint " + std::to_string(influences[k].frame) +
                                    ", expected 0 to 255");
      joints.push_back(used ? static_cast<std::uint8_t>(influences[k].frame) : std::uint8_t{0});
      weights.push_back(shares[k]);
    }
  }
  attributes["JOINTS_0"] = buffer.add(joints, 4, "VEC4", kUnsignedByte, kArrayBuffer);
  attributes["WEIGHTS_0"] = buffer.add(weights, 4, "VEC4", kUnsignedShort, kArrayBuffer);
  buffer.accessors.back()["normalized"] = true;
}

int add_indices(const GlbPrimitive& primitive, const std::string& mesh, Buffer& buffer) {
  for (Eigen::Index i = 0; i < primitive.triangles.size(); ++i)
    if (primitive.triangles.data()[i] < 0 || primitive.triangles.data()[i] >= primitive.points.rows())
      throw std::invalid_argument("mesh '" + mesh + "': a triangle names vertex " +
                                  std::to_string(primitive.triangles.data()[i]) + " of " +
                                  std::to_string(primitive.points.rows()));
  const int* begin = primitive.triangles.data();
  const int* end = begin + primitive.triangles.size();
  // 65535 itself is the primitive restart value and not allowed.
  if (primitive.points.rows() <= 65535)
    return buffer.add(std::vector<std::uint16_t>(begin, end), 1, "SCALAR", kUnsignedShort,
                      kElementArrayBuffer);
  return buffer.add(std::vector<std::uint32_t>(begin, end), 1, "SCALAR", kUnsignedInt, kElementArrayBuffer);
}

Json primitive_json(const GlbPrimitive& primitive, const std::string& mesh, Buffer& buffer) {
  if (primitive.points.rows() == 0 || primitive.triangles.rows() == 0)
    throw std::invalid_argument("mesh '" + mesh + "': no triangles");
  if (primitive.normals.rows() != primitive.points.rows())
    throw std::invalid_argument("mesh '" + mesh + "': one normal per vertex expected");
  Json attributes;
  const std::vector<float> positions = to_floats(primitive.points);
  attributes["POSITION"] = buffer.add(positions, 3, "VEC3", kFloat, kArrayBuffer);
  buffer.add_bounds(positions, 3);
  attributes["NORMAL"] = buffer.add(to_floats(primitive.normals), 3, "VEC3", kFloat, kArrayBuffer);
  if (!primitive.colours.empty()) {
    std::vector<std::uint8_t> colours;
    for (const auto& colour : primitive.colours) colours.insert(colours.end(), colour.begin(), colour.end());
    attributes["COLOR_0"] = buffer.add(colours, 4, "VEC4", kUnsignedByte, kArrayBuffer);
    buffer.accessors.back()["normalized"] = true;
  }
  if (!primitive.weights.empty()) add_weights(primitive, mesh, buffer, attributes);
  Json json = {{"attributes", attributes}, {"indices", add_indices(primitive, mesh, buffer)}};
  if (primitive.material >= 0) json["material"] = primitive.material;
  return json;
}

/// One accessor per distinct list of key times, shared by all samplers that use it.
class TimeAccessors {
 public:
  explicit TimeAccessors(Buffer& buffer) : buffer_(buffer) {}
  int add(const std::vector<double>& times) {
    for (const auto& [known, accessor] : known_)
      if (known == times) return accessor;
    const std::vector<float> values(times.begin(), times.end());
    known_.emplace_back(times, buffer_.add(values, 1, "SCALAR", kFloat));
    buffer_.add_bounds(values, 1);
    return known_.back().second;
  }

 private:
  Buffer& buffer_;
  std::vector<std::pair<std::vector<double>, int>> known_;
};

const char* interpolation_name(skeleton::Interpolation interpolation, const std::string& clip) {
  if (interpolation == skeleton::Interpolation::CubicSpline)
    throw std::invalid_argument("clip '" + clip + "': only linear and stepped keys can be written");
  return interpolation == skeleton::Interpolation::Step ? "STEP" : "LINEAR";
}

Json clip_json(const skeleton::Clip& clip, Buffer& buffer, TimeAccessors& times) {
  Json channels = Json::array(), samplers = Json::array();
  const auto add = [&](int node, const char* path, const auto& track, const std::vector<float>& values,
                       int width) {
    const int input = times.add(track.times);
    const int output = buffer.add(values, width, width == 3 ? "VEC3" : "VEC4", kFloat);
    channels.push_back({{"sampler", samplers.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers.push_back({{"input", input},
                        {"output", output},
                        {"interpolation", interpolation_name(track.interpolation, clip.name)}});
  };
  const auto vectors = [](const skeleton::VectorTrack& track) {
    std::vector<float> values;
    for (const Eigen::Vector3d& v : track.values)
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(v[c]));
    return values;
  };
  for (const skeleton::Channel& channel : clip.channels) {
    if (channel.translation)
      add(channel.joint, "translation", *channel.translation, vectors(*channel.translation), 3);
    if (channel.rotation) {
      std::vector<float> values;
      for (const Eigen::Quaterniond& q : channel.rotation->values)
        for (int c = 0; c < 4; ++c) values.push_back(static_cast<float>(q.coeffs()[c]));
      add(channel.joint, "rotation", *channel.rotation, values, 4);
    }
    if (channel.scale) add(channel.joint, "scale", *channel.scale, vectors(*channel.scale), 3);
  }
  return {{"name", clip.name}, {"channels", channels}, {"samplers", samplers}};
}

Json nodes_json(const GlbScene& scene) {
  Json nodes = Json::array();
  std::vector<std::vector<int>> children(scene.nodes.size());
  for (std::size_t n = 0; n < scene.nodes.size(); ++n) {
    const int parent = scene.nodes[n].parent;
    if (parent >= static_cast<int>(n))
      throw std::invalid_argument("node '" + scene.nodes[n].name + "': its parent must come before it");
    if (parent >= 0) children[static_cast<std::size_t>(parent)].push_back(static_cast<int>(n));
  }
  for (std::size_t n = 0; n < scene.nodes.size(); ++n) {
    const GlbNode& node = scene.nodes[n];
    const skeleton::LocalTransform& local = node.local;
    Json json = {{"name", node.name}};
    if (local.translation != Eigen::Vector3d::Zero())
      json["translation"] = {local.translation.x(), local.translation.y(), local.translation.z()};
    if (local.rotation.coeffs() != Eigen::Quaterniond::Identity().coeffs())
      json["rotation"] = {local.rotation.x(), local.rotation.y(), local.rotation.z(), local.rotation.w()};
    if (local.scale != Eigen::Vector3d::Ones())
      json["scale"] = {local.scale.x(), local.scale.y(), local.scale.z()};
    if (node.mesh >= 0) json["mesh"] = node.mesh;
    if (node.skinned) json["skin"] = 0;
    if (!children[n].empty()) json["children"] = children[n];
    nodes.push_back(json);
  }
  return nodes;
}

Json materials_json(const std::vector<GlbMaterial>& materials) {
  Json list = Json::array();
  for (const GlbMaterial& m : materials) {
    Json json = {{"name", m.name},
                 {"pbrMetallicRoughness",
                  {{"baseColorFactor", {m.base_colour.x(), m.base_colour.y(), m.base_colour.z(), 1.0}},
                   {"metallicFactor", 0.0},
                   {"roughnessFactor", m.roughness}}}};
    if (m.double_sided) json["doubleSided"] = true;
    list.push_back(json);
  }
  return list;
}

int add_inverse_bind_matrices(const GlbScene& scene, Buffer& buffer) {
  if (scene.joint_from_rest.size() != scene.joints.size())
    throw std::invalid_argument("skin: one inverse bind matrix per joint expected");
  std::vector<float> values;
  for (const Eigen::Affine3d& m : scene.joint_from_rest)
    for (int i = 0; i < 16; ++i) values.push_back(static_cast<float>(m.matrix().data()[i]));  // by columns
  return buffer.add(values, 16, "MAT4", kFloat);
}

void append_u32(std::string& bytes, std::size_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>((value >> shift) & 0xff));
}

/// Header and the two chunks of GLB 2.0 (glTF 2.0, section 4).
std::string container(std::string json, const std::string& binary) {
  while (json.size() % 4 != 0) json.push_back(' ');
  std::string bytes = "glTF";
  append_u32(bytes, 2);
  append_u32(bytes, 12 + 8 + json.size() + 8 + binary.size());
  append_u32(bytes, json.size());
  bytes += "JSON" + json;
  append_u32(bytes, binary.size());
  bytes += "BIN";
  bytes.push_back('\0');
  return bytes + binary;
}

}  // namespace

std::string glb_bytes(const GlbScene& scene) {
  Buffer buffer;
  TimeAccessors times(buffer);
  Json roots = Json::array(), meshes = Json::array(), animations = Json::array();
  for (std::size_t n = 0; n < scene.nodes.size(); ++n)
    if (scene.nodes[n].parent < 0) roots.push_back(n);
  for (const GlbMesh& mesh : scene.meshes) {
    Json primitives = Json::array();
    for (const GlbPrimitive& primitive : mesh.primitives)
      primitives.push_back(primitive_json(primitive, mesh.name, buffer));
    meshes.push_back({{"name", mesh.name}, {"primitives", primitives}});
  }
  Json json = {{"asset", {{"version", "2.0"}, {"generator", "sinew"}}},
               {"scene", 0},
               {"scenes", Json::array({{{"nodes", roots}}})},
               {"nodes", nodes_json(scene)},
               {"meshes", meshes}};
  if (!scene.materials.empty()) json["materials"] = materials_json(scene.materials);
  if (!scene.joints.empty())
    json["skins"] = Json::array(
        {{{"joints", scene.joints}, {"inverseBindMatrices", add_inverse_bind_matrices(scene, buffer)}}});
  for (const skeleton::Clip& clip : scene.clips) animations.push_back(clip_json(clip, buffer, times));
  if (!animations.empty()) json["animations"] = animations;
  const std::string binary = buffer.take_bytes();
  json["accessors"] = buffer.accessors;
  json["bufferViews"] = buffer.views;
  json["buffers"] = Json::array({{{"byteLength", binary.size()}}});
  return container(json.dump(), binary);
}

}  // namespace sinew::assets
