#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <toml++/toml.h>

namespace sinew::tools::detail {

/// Reading values of a TOML file strictly: types are not converted, unknown keys are errors that name the
/// nearest valid one. Every error is an assets::ConfigError that opens with file and line.
class TomlReader {
 public:
  explicit TomlReader(std::string file) : file_(std::move(file)) {}

  /// "<file>:<line>".
  std::string place(const toml::node& node) const;
  [[noreturn]] void refuse_type(const toml::node& node, const std::string& where,
                                const std::string& expected) const;
  [[noreturn]] void refuse_key(const std::string& key, const toml::node& node,
                               const std::vector<std::string>& keys) const;

  std::string string(const toml::node& node, const std::string& where) const;
  bool boolean(const toml::node& node, const std::string& where) const;
  /// A number as such, or a fraction as a string: "1/120". `range` is named in messages, not checked.
  double number(const toml::node& node, const std::string& where, const std::string& range = "") const;
  std::int64_t integer(const toml::node& node, const std::string& where) const;
  Eigen::Vector3d vector(const toml::node& node, const std::string& where,
                         const std::string& range = "") const;
  std::vector<std::string> strings(const toml::node& node, const std::string& where) const;
  const toml::table& table(const toml::node& node, const std::string& where) const;

  /// A key that may stand in a table and what reads it; `where` opens messages about its value.
  struct Entry {
    std::string key;
    std::function<void(const toml::node&, const std::string& where)> read;
  };
  /// Reads all keys of a table in the file's order; one that no entry names is refused. `where` opens
  /// `where`s.
  void read_table(const toml::table& table, const std::string& where,
                  const std::vector<Entry>& entries) const;
  /// Every table of an array of tables [[name]].
  void read_tables(const toml::node& node, const std::string& name,
                   const std::function<void(const toml::table&, const std::string& where)>& read) const;

 private:
  std::string file_;
};

/// Keys and values of a table in the file's order.
std::vector<std::pair<std::string, const toml::node*>> in_file_order(const toml::table& table);

}  // namespace sinew::tools::detail
