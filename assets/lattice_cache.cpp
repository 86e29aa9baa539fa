#include "assets/lattice_cache.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <filesystem>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/atomic_output.h"
#include "assets/detail/file_bytes.h"
#include "assets/detail/lattice_json.h"
#include "assets/error.h"
#include "assets/gmsh.h"
#include "lattice/builder_version.h"

namespace sinew::assets {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kMagic = "sinew lattice cache 1";
constexpr const char* kExtension = ".lattice";
constexpr std::size_t kMostFiles = 16;

/// 128 bits of everything it is fed: two chains that mix 64-bit words with the finaliser of SplitMix64 and
/// start apart. For telling inputs and damage apart, not against attackers.
class Hash {
 public:
  void add(std::uint64_t word) {
    a_ = mix(a_ ^ word);
    b_ = mix(b_ + word + 0x9e3779b97f4a7c15ull);
  }
  void add(std::int64_t value) { add(static_cast<std::uint64_t>(value)); }
  void add(int value) { add(static_cast<std::int64_t>(value)); }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(std::string_view text) {
    add(static_cast<std::uint64_t>(text.size()));
    for (std::size_t i = 0; i < text.size(); i += 8) {
      std::uint64_t word = 0;
      for (std::size_t k = i; k < std::min(i + 8, text.size()); ++k)
        word = word << 8 | static_cast<unsigned char>(text[k]);
      add(word);
    }
  }
  std::string text() const { return fmt::format("{:016x}{:016x}", a_, b_); }

 private:
  static std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    return x ^ (x >> 31);
  }
  std::uint64_t a_ = 0x243f6a8885a308d3ull, b_ = 0x13198a2e03707344ull;  // digits of pi
};

std::string hash_of(std::string_view text) {
  Hash hash;
  hash.add(text);
  return hash.text();
}

void add_options(Hash& hash, const lattice::BuildOptions& options) {
  // Fails to compile where a field is added: add it here, too.
  const auto& [cells, cell_size, size_factors, coarsen_rigid, grade, include, exclude, tip_bones, symmetry,
               construction, max_retries, min_dihedral_degrees, min_scaled_jacobian, poll] = options;
  static_cast<void>(poll);  // makes no difference to what is built
  hash.add(cells);
  hash.add(cell_size ? 1 : 0);
  hash.add(cell_size.value_or(0.0));
  hash.add(static_cast<int>(size_factors.size()));
  for (const lattice::SizeFactor& size : size_factors) {
    hash.add(size.joint);
    hash.add(size.factor);
  }
  hash.add(static_cast<int>(coarsen_rigid));
  hash.add(static_cast<int>(grade));
  for (const std::vector<int>* joints : {&include, &exclude}) {
    hash.add(static_cast<int>(joints->size()));
    for (int joint : *joints) hash.add(joint);
  }
  hash.add(static_cast<int>(tip_bones));
  hash.add(static_cast<int>(symmetry));
  hash.add(static_cast<int>(construction));
  hash.add(max_retries);
  hash.add(min_dihedral_degrees);
  hash.add(min_scaled_jacobian);
}

Json to_json(const std::vector<lattice::GateFailure>& failures) {
  Json json = Json::array();
  for (const lattice::GateFailure& failure : failures)
    json.push_back(Json::array({failure.what, failure.tolerable}));
  return json;
}

std::vector<lattice::GateFailure> failures_from(const Json& json) {
  std::vector<lattice::GateFailure> failures;
  for (const Json& failure : json) failures.push_back({failure.at(0), failure.at(1)});
  return failures;
}

/// What the file of the lattice does not hold.
std::string facts_of(const lattice::BuildResult& result) {
  const lattice::LatticeQuality& q = result.lattice.quality;
  const auto& [dihedral, jacobian, volume, ratio, vertices, triangles, exact, components, floating] = q;
  Json json;
  json["quality"] = {dihedral, jacobian, volume, ratio, vertices, triangles, exact, components, floating};
  json["failures"] = to_json(result.failures);
  json["refused"] = Json::array();
  for (const lattice::RefusedAttempt& attempt : result.refused)
    json["refused"].push_back(Json::array({attempt.name, to_json(attempt.failures)}));
  json["no_mirror"] = result.no_mirror;
  json["idle_sizes"] = result.idle_sizes;
  if (result.mirror) {
    const Eigen::Vector3d& n = result.mirror->normal;
    json["mirror"] = {n.x(), n.y(), n.z(), result.mirror->offset};
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void take_facts(const std::string& text, lattice::BuildResult& result) {
  const Json json = Json::parse(text);
  lattice::LatticeQuality& q = result.lattice.quality;
  auto& [dihedral, jacobian, volume, ratio, vertices, triangles, exact, components, floating] = q;
  const Json& values = json.at("quality");
  dihedral = values.at(0);
  jacobian = values.at(1);
  volume = values.at(2);
  ratio = values.at(3);
  vertices = values.at(4);
  triangles = values.at(5);
  exact = values.at(6);
  components = values.at(7);
  floating = values.at(8);
  result.failures = failures_from(json.at("failures"));
  for (const Json& attempt : json.at("refused"))
    result.refused.push_back({attempt.at(0).get<std::string>(), failures_from(attempt.at(1))});
  result.no_mirror = json.at("no_mirror").get<std::string>();
  result.idle_sizes = json.at("idle_sizes").get<std::vector<int>>();
  if (json.contains("mirror")) {
    const Json& plane = json.at("mirror");
    const auto number = [&](std::size_t i) { return plane.at(i).get<double>(); };
    result.mirror = lattice::MirrorPlane{Eigen::Vector3d(number(0), number(1), number(2)), number(3)};
  }
}

std::string file_of(const std::string& folder, const std::string& key) {
  return (fs::path(folder) / (key + kExtension)).string();
}

/// Removes all but the files that were written last.
void prune(const std::string& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == kExtension) files.emplace_back(entry.last_write_time(), entry.path());
  std::sort(files.rbegin(), files.rend());
  for (std::size_t i = kMostFiles; i < files.size(); ++i) fs::remove(files[i].second);
}

std::string take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) throw InputError("cache", "ends in the middle");
  std::string line(text.substr(0, end));
  text.remove_prefix(end + 1);
  return line;
}

}  // namespace

std::string lattice_key(const lattice::Surface& skin, const lattice::JointTree& joints,
                        const lattice::BuildOptions& options) {
  Hash hash;
  hash.add(std::string_view(lattice::builder_version()));
  hash.add(static_cast<std::int64_t>(skin.points.rows()));
  for (Eigen::Index i = 0; i < skin.points.size(); ++i) hash.add(skin.points.data()[i]);
  hash.add(static_cast<std::int64_t>(skin.triangles.rows()));
  for (Eigen::Index i = 0; i < skin.triangles.size(); ++i) hash.add(skin.triangles.data()[i]);
  for (const auto& influences : skin.weights) {
    hash.add(static_cast<int>(influences.size()));
    for (const lattice::Influence& influence : influences) {
      hash.add(influence.frame);
      hash.add(influence.weight);
    }
  }
  hash.add(static_cast<std::int64_t>(joints.positions.rows()));
  for (Eigen::Index i = 0; i < joints.positions.size(); ++i) hash.add(joints.positions.data()[i]);
  for (int parent : joints.parents) hash.add(parent);
  for (const std::string& name : joints.names) hash.add(std::string_view(name));
  add_options(hash, options);
  return hash.text();
}

std::string cache_folder(const std::string& output) {
  fs::path path = fs::path(output).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "out/"
  return (path.parent_path() / ".sinew-cache").string();
}

std::optional<lattice::BuildResult> find_lattice(const std::string& folder, const std::string& key,
                                                 const lattice::JointTree& joints) {
  try {
    const std::string file = file_of(folder, key), bytes = detail::read_whole(file);
    std::string_view rest = bytes;
    if (take_line(rest) != kMagic || take_line(rest) != key) return std::nullopt;
    const std::string checksum = take_line(rest);
    if (checksum != hash_of(rest)) return std::nullopt;
    lattice::BuildResult result;
    const std::string facts = take_line(rest);
    VolumeMesh mesh = parse_gmsh(file, std::string(rest));
    result.lattice.complex = std::move(mesh.complex);
    detail::lattice_from_json(file, mesh.annotation, joints, result.lattice);
    lattice::validate(result.lattice);
    take_facts(facts, result);
    return result;
  } catch (const std::exception&) {
    return std::nullopt;  // whatever is wrong with the file, the lattice can be built
  }
}

bool keep_lattice(const std::string& folder, const std::string& key, const lattice::BuildResult& result,
                  const lattice::JointTree& joints) {
  const bool usable = std::all_of(result.failures.begin(), result.failures.end(),
                                  [](const lattice::GateFailure& failure) { return failure.tolerable; });
  if (!usable) return false;
  try {
    VolumeMesh mesh;
    mesh.complex = result.lattice.complex;
    mesh.annotation = detail::lattice_to_json(result.lattice, joints);
    const std::string body = facts_of(result) + '\n' + format_gmsh(mesh, GmshVersion::V41, Encoding::Binary);
    fs::create_directory(folder);
    write_file(file_of(folder, key), fmt::format("{}\n{}\n{}\n{}", kMagic, key, hash_of(body), body),
               Overwrite::Replace);
    prune(folder);
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

CachedBuild build_lattice(const std::string& folder, const lattice::Surface& skin,
                          const lattice::JointTree& joints, const lattice::BuildOptions& options) {
  if (folder.empty()) return {lattice::build(skin, joints, options), CacheUse::Off, ""};
  options.validate();
  const std::string key = lattice_key(skin, joints, options);
  if (auto found = find_lattice(folder, key, joints)) return {std::move(*found), CacheUse::Hit, key};
  return {lattice::build(skin, joints, options), CacheUse::Built, key};
}

}  // namespace sinew::assets
