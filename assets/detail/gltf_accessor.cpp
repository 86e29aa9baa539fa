#include "assets/detail/gltf_accessor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

/// Accessors without a view are all zeros and cost the file nothing; more than this many is no rig.
constexpr std::uint64_t kMaxViewlessElements = 1u << 24;

template <typename T>
double load(const unsigned char* bytes) {
  T value{};
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

double load_component(int component_type, const unsigned char* bytes) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return load<std::int8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<std::uint8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return load<std::int16_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load<std::uint32_t>(bytes);
    default:
      return load<float>(bytes);
  }
}

/// glTF 2.0, section 3.11: f = c / 255, max(c / 127, -1), c / 65535, max(c / 32767, -1).
double normalised(int component_type, double c) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return std::max(c / 127.0, -1.0);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return c / 255.0;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return std::max(c / 32767.0, -1.0);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return c / 65535.0;
    default:
      return c;
  }
}

std::uint64_t component_bytes(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

std::uint64_t num_components(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
    case TINYGLTF_TYPE_MAT2:
      return 4;
    case TINYGLTF_TYPE_MAT3:
      return 9;
    case TINYGLTF_TYPE_MAT4:
      return 16;
    default:
      return 0;
  }
}

std::string type_name(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return "SCALAR";
    case TINYGLTF_TYPE_VEC2:
      return "VEC2";
    case TINYGLTF_TYPE_VEC3:
      return "VEC3";
    case TINYGLTF_TYPE_VEC4:
      return "VEC4";
    case TINYGLTF_TYPE_MAT2:
      return "MAT2";
    case TINYGLTF_TYPE_MAT3:
      return "MAT3";
    case TINYGLTF_TYPE_MAT4:
      return "MAT4";
    default:
      return "unknown";
  }
}

std::string accessor_path(std::size_t accessor) { return "/accessors/" + std::to_string(accessor); }

bool is_index_type(int component_type) {
  return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

/// Distance between elements: the view's own, or none between them.
std::uint64_t stride_of(const tinygltf::BufferView& view, std::uint64_t bytes_each) {
  return view.byteStride != 0 ? view.byteStride : bytes_each;
}

}  // namespace

void GltfAccessors::check_all() const {
  for (std::size_t v = 0; v < model_.bufferViews.size(); ++v) check_view(v);
  for (std::size_t a = 0; a < model_.accessors.size(); ++a) check_accessor(a);
}

void GltfAccessors::check_view(std::size_t view) const {
  const tinygltf::BufferView& v = model_.bufferViews[view];
  const std::string thing = "/bufferViews/" + std::to_string(view);
  if (v.buffer < 0 || static_cast<std::size_t>(v.buffer) >= model_.buffers.size()) {
    throw InputError(file_, thing + ": buffer index, got " + std::to_string(v.buffer) + ", expected 0 to " +
                                std::to_string(static_cast<long>(model_.buffers.size()) - 1));
  }
  const std::uint64_t size = model_.buffers[static_cast<std::size_t>(v.buffer)].data.size();
  // Written without a sum, which could wrap.
  if (v.byteOffset > size || v.byteLength > size - v.byteOffset) {
    throw InputError(file_, thing + ": reaches beyond its buffer, got " + std::to_string(v.byteLength) +
                                " bytes from offset " + std::to_string(v.byteOffset) + ", expected at most " +
                                std::to_string(size) + " bytes in all; hint: copy or export the file again");
  }
}

void GltfAccessors::check_fits(const std::string& thing, int view, std::uint64_t offset, std::uint64_t stride,
                               std::uint64_t bytes_each, std::uint64_t count) const {
  if (view < 0 || static_cast<std::size_t>(view) >= model_.bufferViews.size()) {
    throw InputError(file_, thing + ": buffer view index, got " + std::to_string(view) + ", expected 0 to " +
                                std::to_string(static_cast<long>(model_.bufferViews.size()) - 1));
  }
  const std::uint64_t size = model_.bufferViews[static_cast<std::size_t>(view)].byteLength;
  const std::uint64_t left = offset > size ? 0 : size - offset;
  if (bytes_each <= left && (count - 1) <= (left - bytes_each) / stride) return;
  // For the message only; it may round, but it cannot wrap: count <= 2^53 and stride <= 252.
  const std::uint64_t needed = (count - 1) * stride + bytes_each;
  throw InputError(file_, thing + ": more elements than data, needs " + std::to_string(needed) +
                              " bytes from offset " + std::to_string(offset) + ", got " +
                              std::to_string(left) + " in view " + std::to_string(view) +
                              "; hint: copy or export the file again");
}

void GltfAccessors::check_accessor(std::size_t accessor) const {
  const tinygltf::Accessor& a = model_.accessors[accessor];
  const std::string thing = accessor_path(accessor);
  const std::uint64_t bytes_each = component_bytes(a.componentType) * num_components(a.type);
  if (bytes_each == 0) {
    throw InputError(file_, thing + ": unknown type, got component type " + std::to_string(a.componentType) +
                                " and type " + type_name(a.type) + ", expected those of glTF 2.0");
  }
  if (a.count == 0) throw InputError(file_, thing + ": count, got 0, expected at least 1");
  if (a.bufferView >= 0) {
    const bool known = static_cast<std::size_t>(a.bufferView) < model_.bufferViews.size();
    const std::uint64_t stride =
        known ? stride_of(model_.bufferViews[static_cast<std::size_t>(a.bufferView)], bytes_each)
              : bytes_each;
    check_fits(thing, a.bufferView, a.byteOffset, stride, bytes_each, a.count);
  } else if (a.count > kMaxViewlessElements) {
    throw InputError(file_, thing + ": elements without data, got " + std::to_string(a.count) +
                                ", expected at most " + std::to_string(kMaxViewlessElements));
  }
  if (a.sparse.isSparse) check_sparse(accessor);
}

void GltfAccessors::check_sparse(std::size_t accessor) const {
  const tinygltf::Accessor& a = model_.accessors[accessor];
  const auto& sparse = a.sparse;
  const std::string thing = accessor_path(accessor) + "/sparse";
  if (sparse.count < 1 || static_cast<std::uint64_t>(sparse.count) > a.count) {
    throw InputError(file_, thing + ": count, got " + std::to_string(sparse.count) + ", expected 1 to " +
                                std::to_string(a.count));
  }
  if (!is_index_type(sparse.indices.componentType)) {
    throw InputError(file_, thing + "/indices: component type, got " +
                                std::to_string(sparse.indices.componentType) +
                                ", expected an unsigned integer");
  }
  if (sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
    throw InputError(file_, thing + ": byteOffset, got a negative number, expected at least 0");
  }
  const std::uint64_t index_bytes = component_bytes(sparse.indices.componentType);
  const std::uint64_t value_bytes = component_bytes(a.componentType) * num_components(a.type);
  const auto count = static_cast<std::uint64_t>(sparse.count);
  check_fits(thing + "/indices", sparse.indices.bufferView,
             static_cast<std::uint64_t>(sparse.indices.byteOffset), index_bytes, index_bytes, count);
  check_fits(thing + "/values", sparse.values.bufferView,
             static_cast<std::uint64_t>(sparse.values.byteOffset), value_bytes, value_bytes, count);
}

const unsigned char* GltfAccessors::bytes_of(int view, std::uint64_t offset) const {
  const tinygltf::BufferView& v = model_.bufferViews[static_cast<std::size_t>(view)];
  return model_.buffers[static_cast<std::size_t>(v.buffer)].data.data() + v.byteOffset + offset;
}

std::size_t GltfAccessors::count(int accessor, const std::string& user) const {
  if (accessor < 0 || static_cast<std::size_t>(accessor) >= model_.accessors.size()) {
    throw InputError(file_, user + ": accessor index, got " + std::to_string(accessor) + ", expected 0 to " +
                                std::to_string(static_cast<long>(model_.accessors.size()) - 1));
  }
  return model_.accessors[static_cast<std::size_t>(accessor)].count;
}

std::vector<double> GltfAccessors::read(int accessor, const std::string& type,
                                        const std::string& user) const {
  const std::size_t n = count(accessor, user);
  const tinygltf::Accessor& a = model_.accessors[static_cast<std::size_t>(accessor)];
  if (type_name(a.type) != type) {
    throw InputError(file_, user + ": type of accessor " + std::to_string(accessor) + ", got " +
                                type_name(a.type) + ", expected " + type);
  }
  const std::uint64_t each = num_components(a.type);
  const std::uint64_t step = component_bytes(a.componentType);
  const auto decode = [&](const unsigned char* bytes, std::size_t element, std::vector<double>& values) {
    for (std::uint64_t c = 0; c < each; ++c) {
      const double raw = load_component(a.componentType, bytes + c * step);
      values[element * each + c] = a.normalized ? normalised(a.componentType, raw) : raw;
    }
  };
  std::vector<double> values(n * each, 0.0);
  if (a.bufferView >= 0) {
    const std::uint64_t stride =
        stride_of(model_.bufferViews[static_cast<std::size_t>(a.bufferView)], each * step);
    const unsigned char* bytes = bytes_of(a.bufferView, a.byteOffset);
    for (std::size_t i = 0; i < n; ++i) decode(bytes + i * stride, i, values);
  }
  if (!a.sparse.isSparse) return values;
  const auto& sparse = a.sparse;
  const unsigned char* indices =
      bytes_of(sparse.indices.bufferView, static_cast<std::uint64_t>(sparse.indices.byteOffset));
  const unsigned char* replaced =
      bytes_of(sparse.values.bufferView, static_cast<std::uint64_t>(sparse.values.byteOffset));
  const std::uint64_t index_bytes = component_bytes(sparse.indices.componentType);
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(sparse.count); ++i) {
    const double element = load_component(sparse.indices.componentType, indices + i * index_bytes);
    if (element >= static_cast<double>(n)) {
      throw InputError(file_, accessor_path(static_cast<std::size_t>(accessor)) +
                                  "/sparse/indices: element " + std::to_string(i) + ", got " +
                                  std::to_string(static_cast<std::uint32_t>(element)) + ", expected 0 to " +
                                  std::to_string(n - 1));
    }
    decode(replaced + i * each * step, static_cast<std::size_t>(element), values);
  }
  return values;
}

std::vector<std::uint32_t> GltfAccessors::read_indices(int accessor, std::size_t num_vertices,
                                                       const std::string& user) const {
  const std::vector<double> values = read(accessor, "SCALAR", user);
  const tinygltf::Accessor& a = model_.accessors[static_cast<std::size_t>(accessor)];
  if (!is_index_type(a.componentType) || a.normalized) {
    throw InputError(file_, user + ": component type of accessor " + std::to_string(accessor) + ", got " +
                                std::to_string(a.componentType) + ", expected an unsigned integer");
  }
  std::vector<std::uint32_t> indices(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] >= static_cast<double>(num_vertices)) {
      throw InputError(file_, accessor_path(static_cast<std::size_t>(accessor)) + ": element " +
                                  std::to_string(i) + " points past the last vertex, got " +
                                  std::to_string(static_cast<std::uint32_t>(values[i])) + ", expected 0 to " +
                                  std::to_string(static_cast<long>(num_vertices) - 1) +
                                  "; hint: export the file again");
    }
    indices[i] = static_cast<std::uint32_t>(values[i]);
  }
  return indices;
}

}  // namespace sinew::assets::detail
