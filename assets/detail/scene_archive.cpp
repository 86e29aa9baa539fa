#include "assets/detail/scene_archive.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <vector>

namespace sinew::assets::detail {

namespace {

constexpr std::array<char, 8> kMagic{'S', 'I', 'N', 'E', 'W', 'S', 'C', '1'};

/// Appends values to a string, in the byte order of the machine: both ends are the same machine.
class Writer {
 public:
  template <typename T>
  void numbers(T* data, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(data), count * sizeof(T));
  }
  template <typename T>
  std::size_t count(const T& container, std::size_t /*bytes_each*/) {
    std::uint64_t n = container.size();
    numbers(&n, 1);
    return n;
  }
  Eigen::Index rows(Eigen::Index current, std::size_t /*bytes_each*/) {
    auto n = static_cast<std::uint64_t>(current);
    numbers(&n, 1);
    return current;
  }
  bool presence(bool present) {
    std::uint8_t flag = present ? 1 : 0;
    numbers(&flag, 1);
    return present;
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  void numbers(T* data, std::size_t count) {
    if (count > bytes_.size() / sizeof(T)) throw std::runtime_error("the importer's answer ends too early");
    std::memcpy(data, bytes_.data(), count * sizeof(T));
    bytes_.remove_prefix(count * sizeof(T));
  }
  template <typename T>
  std::size_t count(const T& /*container*/, std::size_t bytes_each) {
    std::uint64_t n = 0;
    numbers(&n, 1);
    if (n > bytes_.size() / bytes_each) throw std::runtime_error("the importer's answer holds a wrong count");
    return static_cast<std::size_t>(n);
  }
  Eigen::Index rows(Eigen::Index /*current*/, std::size_t bytes_each) {
    return static_cast<Eigen::Index>(count(bytes_, bytes_each));
  }
  bool presence(bool /*present*/) {
    std::uint8_t flag = 0;
    numbers(&flag, 1);
    if (flag > 1) throw std::runtime_error("the importer's answer holds a wrong flag");
    return flag == 1;
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
};

// One description for both directions: `A` is Writer (values are read) or Reader (values are overwritten).

template <typename A>
void exchange(A& a, int& v) {
  a.numbers(&v, 1);
}
template <typename A>
void exchange(A& a, double& v) {
  a.numbers(&v, 1);
}
template <typename A>
void exchange(A& a, bool& v) {
  v = a.presence(v);
}

template <typename A, typename E>
void exchange_enum(A& a, E& v, E last) {
  auto code = static_cast<int>(v);
  exchange(a, code);
  if (code < 0 || code > static_cast<int>(last)) {
    throw std::runtime_error("the importer's answer holds an unknown code");
  }
  v = static_cast<E>(code);
}

template <typename A>
void exchange(A& a, std::string& v) {
  v.resize(a.count(v, 1));
  a.numbers(v.data(), v.size());
}
template <typename A>
void exchange(A& a, Eigen::Vector3d& v) {
  a.numbers(v.data(), 3);
}
template <typename A>
void exchange(A& a, Eigen::Vector4d& v) {
  a.numbers(v.data(), 4);
}
template <typename A>
void exchange(A& a, Eigen::Quaterniond& v) {
  a.numbers(v.coeffs().data(), 4);
}
template <typename A>
void exchange(A& a, Eigen::Affine3d& v) {
  a.numbers(v.matrix().data(), 16);
}

template <typename A>
void exchange(A& a, lattice::Influence& v) {
  exchange(a, v.frame);
  exchange(a, v.weight);
}

/// Any sequence; an element takes at least one byte, which bounds what a wrong count can allocate.
template <typename A, typename T>
void exchange(A& a, std::vector<T>& v) {
  v.resize(a.count(v, std::is_arithmetic_v<T> ? sizeof(T) : 1));
  for (T& item : v) exchange(a, item);
}

template <typename A, typename Scalar>
void exchange(A& a, Eigen::Matrix<Scalar, Eigen::Dynamic, 3, Eigen::RowMajor>& v) {
  v.resize(a.rows(v.rows(), 3 * sizeof(Scalar)), 3);
  a.numbers(v.data(), static_cast<std::size_t>(v.size()));
}

template <typename A>
void exchange(A& a, skeleton::LocalTransform& v) {
  exchange(a, v.translation);
  exchange(a, v.rotation);
  exchange(a, v.scale);
}

template <typename A, typename Track>
void exchange(A& a, std::optional<Track>& v) {
  if (!a.presence(v.has_value())) return;
  if (!v) v.emplace();
  exchange_enum(a, v->interpolation, skeleton::Interpolation::CubicSpline);
  exchange(a, v->times);
  exchange(a, v->values);
  exchange(a, v->in_tangents);
  exchange(a, v->out_tangents);
}

template <typename A>
void exchange(A& a, skeleton::Channel& v) {
  exchange(a, v.joint);
  exchange(a, v.translation);
  exchange(a, v.rotation);
  exchange(a, v.scale);
}

template <typename A>
void exchange(A& a, skeleton::Clip& v) {
  exchange(a, v.name);
  exchange(a, v.channels);
}

template <typename A>
void exchange(A& a, ImportedNode& v) {
  exchange(a, v.name);
  exchange(a, v.parent);
  exchange(a, v.parent_from_node);
  exchange(a, v.local);
  exchange(a, v.helper);
}

template <typename A>
void exchange(A& a, ImportedSkin& v) {
  exchange(a, v.joints);
  exchange(a, v.joint_from_mesh);
  if (!a.presence(v.world_from_mesh.has_value())) return;
  if (!v.world_from_mesh) v.world_from_mesh.emplace();
  exchange(a, *v.world_from_mesh);
}

template <typename A>
void exchange(A& a, ImportedMesh& v) {
  exchange(a, v.name);
  exchange(a, v.points);
  exchange(a, v.triangles);
  exchange(a, v.weights);
}

template <typename A>
void exchange(A& a, ImportedInstance& v) {
  exchange(a, v.node);
  exchange(a, v.mesh);
  exchange(a, v.skin);
}

template <typename A>
void exchange(A& a, Finding& v) {
  exchange_enum(a, v.severity, Finding::Severity::Error);
  exchange(a, v.code);
  exchange(a, v.where);
  exchange(a, v.message);
  exchange(a, v.remedy);
}

template <typename A>
void exchange(A& a, FaultyClip& v) {
  exchange(a, v.name);
  exchange(a, v.reason);
  exchange(a, v.index);
}

template <typename A>
void exchange(A& a, ImportedScene& v) {
  exchange(a, v.format);
  exchange(a, v.metres_per_unit);
  exchange(a, v.unit_by_standard);
  exchange_enum(a, v.up_axis, UpAxis::Z);
  exchange(a, v.file_vertex_order);
  exchange(a, v.nodes);
  exchange(a, v.skins);
  exchange(a, v.meshes);
  exchange(a, v.instances);
  exchange(a, v.clips);
  exchange(a, v.faulty_clips);
  exchange(a, v.findings);
}

}  // namespace

std::string write_scene(const ImportedScene& scene) {
  Writer writer;
  std::array<char, 8> magic = kMagic;
  writer.numbers(magic.data(), magic.size());
  ImportedScene copy = scene;  // exchange() takes what it may also overwrite
  exchange(writer, copy);
  return writer.take();
}

ImportedScene read_scene(std::string_view bytes) {
  Reader reader(bytes);
  std::array<char, 8> magic{};
  reader.numbers(magic.data(), magic.size());
  if (magic != kMagic) throw std::runtime_error("the importer's answer is not a scene");
  ImportedScene scene;
  exchange(reader, scene);
  if (!reader.at_end()) throw std::runtime_error("the importer's answer goes on after its end");
  return scene;
}

}  // namespace sinew::assets::detail
