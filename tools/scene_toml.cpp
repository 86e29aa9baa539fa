// Reading scene files.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "assets/error.h"
#include "tools/scene.h"
#include "tools/scene_fields.h"
#include "tools/suggest.h"

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

std::string type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "a whole number";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "a boolean";
    default:
      return "a date or time";
  }
}

std::vector<std::pair<std::string, const toml::node*>> in_file_order(const toml::table& table) {
  std::vector<std::pair<std::string, const toml::node*>> entries;
  for (const auto& [key, node] : table) entries.emplace_back(std::string(key.str()), &node);
  std::stable_sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return a.second->source().begin < b.second->source().begin;
  });
  return entries;
}

class SceneReader {
 public:
  explicit SceneReader(const std::string& file) : file_(file), directory_(fs::path(file).parent_path()) {}

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
    for (const auto& [key, node] : in_file_order(table)) {
      if (key == "material") {
        read_materials(*node);
      } else {
        read_field(key, *node);
      }
    }
    return std::move(scene_);
  }

 private:
  std::string place(const toml::node& node) const {
    return fmt::format("{}:{}", file_, node.source().begin.line);
  }

  [[noreturn]] void refuse_type(const toml::node& node, const std::string& where,
                                const std::string& expected) const {
    throw ConfigError(fmt::format("{}: got {}, expected {}", where, type_name(node), expected));
  }

  [[noreturn]] void refuse_key(const std::string& key, const toml::node& node,
                               const std::vector<std::string>& keys) const {
    const std::string guess = nearest(key, keys);
    throw ConfigError(fmt::format("{}: {}: unknown key; hint: {}", place(node), key,
                                  guess.empty() ? fmt::format("known are {}", fmt::join(keys, ", "))
                                                : fmt::format("did you mean {}?", guess)));
  }

  std::string string(const toml::node& node, const std::string& where) const {
    const auto value = node.value_exact<std::string>();
    if (!value) refuse_type(node, where, "a string");
    return *value;
  }

  /// A number as such, or a fraction as a string: step = "1/120".
  double number(const SceneField& field, const toml::node& node, const std::string& where) const {
    if (const auto integer = node.value_exact<std::int64_t>()) return static_cast<double>(*integer);
    if (const auto real = node.value_exact<double>()) return *real;
    const auto text = node.value_exact<std::string>();
    if (!text) refuse_type(node, where, "a number, " + range_text(field));
    if (text->find('/') == std::string::npos) {
      throw ConfigError(
          fmt::format("{}: got the string '{}', expected a number, {}; hint: no quotes and no unit", where,
                      *text, range_text(field)));
    }
    const auto value = parse_number(*text);
    if (!value) {
      throw ConfigError(fmt::format("{}: got '{}', expected a number or a fraction of two, {}", where, *text,
                                    range_text(field)));
    }
    return *value;
  }

  int integer(const SceneField& field, const toml::node& node, const std::string& where) const {
    const auto value = node.value_exact<std::int64_t>();
    if (!value) refuse_type(node, where, "a whole number, " + range_text(field));
    check_number(field, static_cast<double>(*value), where);
    return static_cast<int>(*value);
  }

  Eigen::Vector3d vector(const SceneField& field, const toml::node& node, const std::string& where) const {
    const toml::array* array = node.as_array();
    if (array == nullptr || array->size() != 3) refuse_type(node, where, "an array of three numbers");
    Eigen::Vector3d value;
    for (int i = 0; i < 3; ++i) value[i] = number(field, (*array)[static_cast<std::size_t>(i)], where);
    return value;
  }

  void read_field(const std::string& key, const toml::node& node) {
    const SceneField* field = find_scene_field(key);
    if (field == nullptr) {
      std::vector<std::string> keys{"material"};
      for (const SceneField& known : scene_fields()) keys.emplace_back(known.key);
      std::sort(keys.begin(), keys.end());
      refuse_key(key, node, keys);
    }
    const std::string where = place(node) + ": " + key;
    std::visit([&](auto member) { read_member(*field, member, node, where); }, field->member);
    check_field(scene_, *field, where);
  }

  void read_member(const SceneField&, bool Scene::*member, const toml::node& node, const std::string& where) {
    const auto value = node.value_exact<bool>();
    if (!value) refuse_type(node, where, "true or false");
    scene_.*member = *value;
  }
  void read_member(const SceneField& field, int Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = integer(field, node, where);
  }
  void read_member(const SceneField& field, double Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = number(field, node, where);
  }
  void read_member(const SceneField& field, std::optional<double> Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = number(field, node, where);
  }
  void read_member(const SceneField&, std::string Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = string(node, where);
  }
  void read_member(const SceneField&, PathMember member, const toml::node& node, const std::string& where) {
    const std::string path = string(node, where);
    scene_.*(member.path) = path.empty() ? "" : (directory_ / path).string();
  }
  void read_member(const SceneField& field, Eigen::Vector3d Scene::*member, const toml::node& node,
                   const std::string& where) {
    scene_.*member = vector(field, node, where);
  }
  /// Frames and names of choices are text in the file as on the command line.
  template <class Member>
  void read_member(const SceneField& field, Member, const toml::node& node, const std::string& where) {
    set_from_text(scene_, field, string(node, where), where);
  }

  void read_materials(const toml::node& node) {
    const toml::array* tables = node.as_array();
    if (tables == nullptr) refuse_type(node, place(node) + ": material", "tables, [[material]]");
    for (const toml::node& entry : *tables) {
      const std::string where = fmt::format("{}: material {}", place(entry), scene_.materials.size() + 1);
      if (entry.as_table() == nullptr) refuse_type(entry, where, "a table, [[material]]");
      scene_.materials.push_back(material(*entry.as_table(), where));
    }
  }

  BoneMaterial material(const toml::table& table, const std::string& where) const {
    BoneMaterial material;
    for (const auto& [key, node] : in_file_order(table)) {
      const std::string value_where = place(*node) + ": material " + key;
      const auto value = [&] {
        const SceneField& field = *find_scene_field(key);
        const double number = this->number(field, *node, value_where);
        check_number(field, number, value_where);
        return number;
      };
      if (key == "bones") {
        material.bones = patterns(*node, value_where);
      } else if (key == "young") {
        material.young = value();
      } else if (key == "poisson") {
        material.poisson = value();
      } else if (key == "density") {
        material.density = value();
      } else {
        refuse_key(key, *node, {"bones", "density", "poisson", "young"});
      }
    }
    if (material.bones.empty()) {
      throw ConfigError(where +
                        ": no bones, expected at least one name or pattern; hint: bones = [\"tail*\"]");
    }
    return material;
  }

  std::vector<std::string> patterns(const toml::node& node, const std::string& where) const {
    const toml::array* array = node.as_array();
    if (array == nullptr) refuse_type(node, where, "an array of strings");
    std::vector<std::string> result;
    for (const toml::node& entry : *array) result.push_back(string(entry, where));
    return result;
  }

  std::string file_;
  fs::path directory_;
  Scene scene_;
};

}  // namespace

Scene read_scene(const std::string& file) { return SceneReader(file).read(); }

}  // namespace sinew::tools
