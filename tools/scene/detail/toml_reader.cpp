#include "tools/scene/detail/toml_reader.h"

#include <algorithm>
#include <cstdint>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene/scene_fields.h"
#include "tools/support/suggest.h"

namespace sinew::tools::detail {
namespace {

using assets::ConfigError;

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

/// ", 0 <= h <= 1 s", or nothing.
std::string in(const std::string& range) { return range.empty() ? "" : ", " + range; }

}  // namespace

std::string TomlReader::place(const toml::node& node) const {
  return fmt::format("{}:{}", file_, node.source().begin.line);
}

void TomlReader::refuse_type(const toml::node& node, const std::string& where,
                             const std::string& expected) const {
  throw ConfigError(fmt::format("{}: got {}, expected {}", where, type_name(node), expected));
}

void TomlReader::refuse_key(const std::string& key, const toml::node& node,
                            const std::vector<std::string>& keys) const {
  const std::string guess = nearest(key, keys);
  throw ConfigError(fmt::format("{}: {}: unknown key; hint: {}", place(node), key,
                                guess.empty() ? fmt::format("known are {}", fmt::join(keys, ", "))
                                              : fmt::format("did you mean {}?", guess)));
}

std::string TomlReader::string(const toml::node& node, const std::string& where) const {
  const auto value = node.value_exact<std::string>();
  if (!value) refuse_type(node, where, "a string");
  return *value;
}

bool TomlReader::boolean(const toml::node& node, const std::string& where) const {
  const auto value = node.value_exact<bool>();
  if (!value) refuse_type(node, where, "true or false");
  return *value;
}

double TomlReader::number(const toml::node& node, const std::string& where, const std::string& range) const {
  if (const auto integer = node.value_exact<std::int64_t>()) return static_cast<double>(*integer);
  if (const auto real = node.value_exact<double>()) return *real;
  const auto text = node.value_exact<std::string>();
  if (!text) refuse_type(node, where, "a number" + in(range));
  if (text->find('/') == std::string::npos) {
    throw ConfigError(fmt::format("{}: got the string '{}', expected a number{}; hint: no quotes and no unit",
                                  where, *text, in(range)));
  }
  const auto value = parse_number(*text);
  if (!value) {
    throw ConfigError(
        fmt::format("{}: got '{}', expected a number or a fraction of two{}", where, *text, in(range)));
  }
  return *value;
}

std::int64_t TomlReader::integer(const toml::node& node, const std::string& where) const {
  const auto value = node.value_exact<std::int64_t>();
  if (!value) refuse_type(node, where, "a whole number");
  return *value;
}

Eigen::Vector3d TomlReader::vector(const toml::node& node, const std::string& where,
                                   const std::string& range) const {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != 3) refuse_type(node, where, "an array of three numbers");
  Eigen::Vector3d value;
  for (int i = 0; i < 3; ++i) value[i] = number((*array)[static_cast<std::size_t>(i)], where, range);
  return value;
}

std::vector<std::string> TomlReader::strings(const toml::node& node, const std::string& where) const {
  const toml::array* array = node.as_array();
  if (array == nullptr) refuse_type(node, where, "an array of strings");
  std::vector<std::string> result;
  for (const toml::node& entry : *array) result.push_back(string(entry, where));
  return result;
}

const toml::table& TomlReader::table(const toml::node& node, const std::string& where) const {
  if (node.as_table() == nullptr) refuse_type(node, where, "a table");
  return *node.as_table();
}

void TomlReader::read_table(const toml::table& table, const std::string& where,
                            const std::vector<Entry>& entries) const {
  for (const auto& [key, node] : in_file_order(table)) {
    const auto found =
        std::find_if(entries.begin(), entries.end(), [&](const Entry& entry) { return entry.key == key; });
    if (found == entries.end()) {
      std::vector<std::string> keys;
      for (const Entry& entry : entries) keys.push_back(entry.key);
      std::sort(keys.begin(), keys.end());
      refuse_key(key, *node, keys);
    }
    found->read(*node, fmt::format("{}: {}: {}", place(*node), where, key));
  }
}

void TomlReader::read_tables(const toml::node& node, const std::string& name,
                             const std::function<void(const toml::table&, const std::string&)>& read) const {
  const std::string expected = fmt::format("tables, [[{}]]", name);
  const toml::array* tables = node.as_array();
  if (tables == nullptr) refuse_type(node, place(node) + ": " + name, expected);
  int number = 0;
  for (const toml::node& entry : *tables) {
    const std::string where = fmt::format("{} {}", name, ++number);
    if (entry.as_table() == nullptr) refuse_type(entry, place(entry) + ": " + where, expected);
    read(*entry.as_table(), where);
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

}  // namespace sinew::tools::detail
