// Reading scene files.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene/detail/plain_scene_toml.h"
#include "tools/scene/detail/toml_reader.h"
#include "tools/scene/scene.h"
#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

using assets::ConfigError;
namespace fs = std::filesystem;

constexpr std::size_t kMaxFileSize = 1 << 20;  // bytes; a scene is a page of text

std::string read_text(const std::string& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) {
    throw assets::IoError(fmt::format("{}: not found ({})", file, fs::absolute(file, error).string()));
  }
  // A device or a pipe might never end.
  if (!fs::is_regular_file(status)) throw assets::IoError(fmt::format("{}: not a regular file", file));
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw assets::IoError(fmt::format("{}: cannot be opened for reading", file));
  std::string text(kMaxFileSize + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) throw assets::IoError(fmt::format("{}: reading failed", file));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > kMaxFileSize) {
    throw ConfigError(fmt::format("{}: longer than {} bytes, expected a scene in TOML", file, kMaxFileSize));
  }
  return text;
}

class SceneReader : public detail::TomlReader {
 public:
  explicit SceneReader(const std::string& file)
      : TomlReader(file), file_(file), directory_(fs::path(file).parent_path()) {}

  Scene read() {
    const std::string text = read_text(file_);
    toml::table table;
    try {
      table = toml::parse(text, file_);
    } catch (const toml::parse_error& e) {
      const auto place = e.source().begin;
      throw ConfigError(
          fmt::format("{}:{}:{}: not valid TOML: {}", file_, place.line, place.column, e.description()));
    }
    for (const auto& [key, node] : detail::in_file_order(table)) read_entry(key, *node);
    check_plain(table);
    scene_.source.path = file_;
    return std::move(scene_);
  }

 private:
  void read_entry(const std::string& key, const toml::node& node) {
    const std::vector<std::string> plain_keys = detail::plain_scene_keys();
    if (key == "material") {
      read_tables(node, key, [&](const toml::table& table, const std::string& where) {
        scene_.materials.push_back(material(table, where));
      });
    } else if (key == "size") {
      read_tables(node, key, [&](const toml::table& table, const std::string& where) {
        scene_.sizes.push_back(size(table, where));
      });
    } else if (key == "part" || (key == "bone" && gives_roles(node))) {
      std::vector<RoleOf>& list = key == "part" ? scene_.part_roles : scene_.bone_roles;
      read_tables(node, key, [&](const toml::table& table, const std::string& where) {
        list.push_back(role_of(table, where));
      });
    } else if (std::find(plain_keys.begin(), plain_keys.end(), key) != plain_keys.end() &&
               (key != "lattice" || node.is_table())) {
      if (!scene_.plain) scene_.plain.emplace();
      detail::read_plain_scene(*this, key, node, *scene_.plain);
    } else {
      read_field(key, node);
    }
  }

  /// That a plain scene has a box, and its values.
  void check_plain(const toml::table& table) const {
    if (!scene_.plain) return;
    const toml::node* lattice = table.get("lattice");
    if (lattice != nullptr && lattice->is_table()) {
      try {
        return scene_.plain->validate();
      } catch (const ConfigError& e) {
        throw ConfigError(file_ + ": " + e.what());
      }
    }
    throw ConfigError(
        file_ +
        ": [lattice]: missing, expected a box; hint: bones, fixed faces, loads and velocities belong to "
        "scenes without a rig, whose flesh is a box");
  }

  int integer_in(const SceneField& field, const toml::node& node, const std::string& where) const {
    const auto value = node.value_exact<std::int64_t>();
    if (!value) refuse_type(node, where, "a whole number, " + range_text(field));
    check_number(field, static_cast<double>(*value), where);
    return static_cast<int>(*value);
  }

  void read_field(const std::string& key, const toml::node& node) {
    const SceneField* field = find_scene_field(key);
    if (field == nullptr) {
      std::vector<std::string> keys = detail::plain_scene_keys();
      keys.emplace_back("material");
      keys.emplace_back("part");
      keys.emplace_back("size");
      for (const SceneField& known : scene_fields()) keys.emplace_back(known.key);
      std::sort(keys.begin(), keys.end());
      keys.erase(std::unique(keys.begin(), keys.end()), keys.end());  // a lattice is a file or a box
      refuse_key(key, node, keys);
    }
    const std::string where = place(node) + ": " + key;
    std::visit([&](auto member) { read_member(*field, member, node, where); }, field->member);
    check_field(scene_, *field, where);
  }

  void read_member(const SceneField&, bool Scene::*member, const toml::node& node, const std::string& where) {
    scene_.*member = boolean(node, where);
  }
  void read_member(const SceneField& field, int Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = integer_in(field, node, where);
  }
  void read_member(const SceneField& field, double Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = number(node, where, range_text(field));
  }
  void read_member(const SceneField& field, std::optional<double> Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = number(node, where, range_text(field));
  }
  void read_member(const SceneField&, std::string Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = string(node, where);
  }
  void read_member(const SceneField&, std::vector<std::string> Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = strings(node, where);
  }
  void read_member(const SceneField& field, std::vector<int> Scene::*member, const toml::node& node,
                   const std::string& where) {
    const toml::array* array = node.as_array();
    if (array == nullptr) refuse_type(node, where, "an array of whole numbers, " + range_text(field));
    (scene_.*member).clear();
    for (const toml::node& entry : *array) (scene_.*member).push_back(integer_in(field, entry, where));
  }
  void read_member(const SceneField&, PathMember member, const toml::node& node, const std::string& where) {
    const std::string path = string(node, where);
    scene_.*(member.path) = path.empty() ? "" : (directory_ / path).string();
  }
  void read_member(const SceneField& field, Eigen::Vector3d Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = vector(node, where, range_text(field));
  }
  /// Frames and names of choices are text in the file as on the command line.
  template <class Member>
  void read_member(const SceneField& field, Member, const toml::node& node, const std::string& where) {
    set_from_text(scene_, field, string(node, where), where);
  }

  /// Regions of a lattice: Gmsh names its groups, Medit numbers them.
  std::vector<std::string> names_or_numbers(const toml::node& node, const std::string& where) const {
    const toml::array* array = node.as_array();
    if (array == nullptr) refuse_type(node, where, "an array of names or numbers of regions");
    std::vector<std::string> names;
    for (const toml::node& entry : *array)
      names.push_back(entry.is_integer() ? std::to_string(integer(entry, where)) : string(entry, where));
    return names;
  }

  BoneMaterial material(const toml::table& table, const std::string& where) const {
    BoneMaterial material;
    std::vector<Entry> entries{
        {"bones", [&](const toml::node& node, const std::string& at) { material.bones = strings(node, at); }},
        {"region",
         [&](const toml::node& node, const std::string& at) { material.region = string(node, at); }},
        {"regions", [&](const toml::node& node, const std::string& at) {
           material.regions = names_or_numbers(node, at);
         }}};
    for (const MaterialValue& value : material_values()) {
      entries.push_back({std::string(value.field->key),
                         [this, value, &material](const toml::node& node, const std::string& at) {
                           material.*value.member = number(node, at, range_text(*value.field));
                           check_number(*value.field, *(material.*value.member), at);
                         }});
    }
    read_table(table, where, entries);
    if (material.bones.empty() && material.regions.empty()) {
      throw ConfigError(
          fmt::format("{}: {}: no bones, expected at least one name or pattern; hint: bones = [\"tail*\"]",
                      place(table), where));
    }
    return material;
  }

  BoneSize size(const toml::table& table, const std::string& where) const {
    BoneSize size;
    bool has_factor = false;
    read_table(
        table, where,
        {{"bones", [&](const toml::node& node, const std::string& at) { size.bones = strings(node, at); }},
         {"factor", [&](const toml::node& node, const std::string& at) {
            size.factor = number(node, at, range_text(size_factor_field()));
            check_number(size_factor_field(), size.factor, at);
            has_factor = true;
          }}});
    if (size.bones.empty() || !has_factor) {
      throw ConfigError(
          fmt::format("{}: {}: no {}, expected bones and a factor; hint: bones = [\"belly*\"], "
                      "factor = 0.5",
                      place(table), where, size.bones.empty() ? "bones" : "factor"));
    }
    return size;
  }

  /// Bones of a rig have roles, those of a box have places.
  static bool gives_roles(const toml::node& bones) {
    const toml::array* array = bones.as_array();
    if (array == nullptr) return false;
    return std::any_of(array->begin(), array->end(), [](const toml::node& bone) {
      return bone.is_table() && bone.as_table()->contains("role");
    });
  }

  assets::PartRole role(const toml::node& node, const std::string& where) const {
    const std::string name = string(node, where);
    for (const assets::PartRole role : {assets::PartRole::Simulated, assets::PartRole::Skinned,
                                        assets::PartRole::Rigid, assets::PartRole::Riding})
      if (role_name(role) == name) return role;
    throw ConfigError(
        fmt::format("{}: got '{}', expected flesh, skinned, rigid or riding; hint: skinned", where, name));
  }

  RoleOf role_of(const toml::table& table, const std::string& where) const {
    RoleOf of;
    bool has_role = false;
    read_table(table, where,
               {{"name", [&](const toml::node& node, const std::string& at) { of.name = string(node, at); }},
                {"role", [&](const toml::node& node, const std::string& at) {
                   of.role = role(node, at);
                   has_role = true;
                 }}});
    if (of.name.empty() || !has_role) {
      throw ConfigError(
          fmt::format("{}: {}: no {}, expected a name and a role; hint: name = \"sword*\", "
                      "role = \"skinned\"",
                      place(table), where, of.name.empty() ? "name" : "role"));
    }
    return of;
  }

  std::string file_;
  fs::path directory_;
  Scene scene_;
};

}  // namespace

Scene read_scene(const std::string& file) { return SceneReader(file).read(); }

}  // namespace sinew::tools
