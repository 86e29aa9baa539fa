#include "tools/detail/plain_scene_toml.h"

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::tools::detail {
namespace {

using assets::ConfigError;
using Entry = TomlReader::Entry;

Entry vector_entry(const TomlReader& reader, const char* key, Eigen::Vector3d& value) {
  return {key, [&](const toml::node& node, const std::string& where) { value = reader.vector(node, where); }};
}

Entry number_entry(const TomlReader& reader, const char* key, double& value) {
  return {key, [&](const toml::node& node, const std::string& where) { value = reader.number(node, where); }};
}

Entry string_entry(const TomlReader& reader, const char* key, std::string& value) {
  return {key, [&](const toml::node& node, const std::string& where) { value = reader.string(node, where); }};
}

Eigen::Vector3i counts(const TomlReader& reader, const toml::node& node, const std::string& where) {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != 3)
    reader.refuse_type(node, where, "an array of three whole numbers");
  Eigen::Vector3i value;
  for (int i = 0; i < 3; ++i) {
    const std::int64_t count = reader.integer((*array)[static_cast<std::size_t>(i)], where);
    if (count < 1 || count > 1'000'000)
      throw ConfigError(fmt::format("{}: got {}, expected 1 ... 1000000 blocks", where, count));
    value[i] = static_cast<int>(count);
  }
  return value;
}

Entry face_entry(const TomlReader& reader, std::optional<BoxFace>& face) {
  return {"face", [&](const toml::node& node, const std::string& where) {
            const std::string name = reader.string(node, where);
            face = find_face(name);
            if (!face) {
              throw ConfigError(fmt::format(
                  "{}: got '{}', expected x-min, x-max, y-min, y-max, z-min or z-max", where, name));
            }
          }};
}

void read_box(const TomlReader& reader, const toml::table& table, PlainBox& box) {
  bool has_size = false;
  reader.read_table(table, "lattice",
                    {{"box",
                      [&](const toml::node& node, const std::string& where) {
                        box.size = reader.vector(node, where);
                        has_size = true;
                      }},
                     vector_entry(reader, "corner", box.corner),
                     {"cells", [&](const toml::node& node,
                                   const std::string& where) { box.cells = counts(reader, node, where); }},
                     {"type", [&](const toml::node& node, const std::string& where) {
                        const std::string name = reader.string(node, where);
                        const auto type = find_cell_type(name);
                        if (!type) {
                          throw ConfigError(fmt::format(
                              "{}: got '{}', expected hexahedra, wedges or tetrahedra", where, name));
                        }
                        box.type = *type;
                      }}});
  if (!has_size) {
    throw ConfigError(reader.place(table) +
                      ": lattice: box: missing, expected its size in metres; hint: box = [1, 0.2, 0.2]");
  }
}

PlainKey read_key(const TomlReader& reader, const toml::table& table, const std::string& where) {
  PlainKey key;
  bool has_time = false;
  reader.read_table(table, where,
                    {{"time",
                      [&](const toml::node& node, const std::string& at) {
                        key.time = reader.number(node, at);
                        has_time = true;
                      }},
                     vector_entry(reader, "move", key.move),
                     vector_entry(reader, "axis", key.axis),
                     number_entry(reader, "angle", key.angle)});
  if (!has_time)
    throw ConfigError(fmt::format("{}: {}: time: missing, expected seconds", reader.place(table), where));
  return key;
}

PlainBone read_bone(const TomlReader& reader, const toml::table& table, const std::string& where) {
  PlainBone bone;
  bool has_start = false, has_end = false;
  const auto point = [&](Eigen::Vector3d& value, bool& has) {
    return [&reader, &value, &has](const toml::node& node, const std::string& at) {
      value = reader.vector(node, at);
      has = true;
    };
  };
  reader.read_table(
      table, where,
      {string_entry(reader, "name", bone.name),
       string_entry(reader, "parent", bone.parent),
       {"start", point(bone.start, has_start)},
       {"end", point(bone.end, has_end)},
       {"soft", [&](const toml::node& node, const std::string& at) { bone.soft = reader.boolean(node, at); }},
       {"keys", [&](const toml::node& node, const std::string& at) {
          const toml::array* keys = node.as_array();
          if (keys == nullptr)
            reader.refuse_type(node, at, "an array of tables; hint: keys = [{ time = 0, angle = 60 }]");
          for (const toml::node& entry : *keys) {
            const std::string key = fmt::format("{}: key {}", where, bone.keys.size() + 1);
            bone.keys.push_back(read_key(reader, reader.table(entry, reader.place(entry) + ": " + key), key));
          }
        }}});
  if (!has_start || !has_end)
    throw ConfigError(fmt::format("{}: {}: {}: missing, expected three coordinates in metres",
                                  reader.place(table), where, has_start ? "end" : "start"));
  return bone;
}

FixedFace read_fixed(const TomlReader& reader, const toml::table& table, const std::string& where) {
  std::optional<BoxFace> face;
  FixedFace fixed;
  reader.read_table(table, where, {face_entry(reader, face), string_entry(reader, "bone", fixed.bone)});
  if (!face) {
    throw ConfigError(fmt::format("{}: {}: face: missing, expected a side of the box; hint: face = \"x-min\"",
                                  reader.place(table), where));
  }
  fixed.face = *face;
  return fixed;
}

}  // namespace

std::vector<std::string> plain_scene_keys() { return {"bone", "fixed", "lattice"}; }

void read_plain_scene(const TomlReader& reader, const std::string& key, const toml::node& node,
                      PlainScene& plain) {
  const auto tables = [&](const auto& read) {
    reader.read_tables(node, key,
                       [&](const toml::table& table, const std::string& where) { read(table, where); });
  };
  if (key == "lattice") {
    read_box(reader, reader.table(node, reader.place(node) + ": lattice"), plain.box);
  } else if (key == "bone") {
    tables([&](const auto& table, const auto& where) {
      plain.bones.push_back(read_bone(reader, table, where));
    });
  } else if (key == "fixed") {
    tables([&](const auto& table, const auto& where) {
      plain.fixed.push_back(read_fixed(reader, table, where));
    });
  }
}

}  // namespace sinew::tools::detail
