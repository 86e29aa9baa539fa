#include "tools/scene/detail/plain_scene_toml.h"

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::tools::detail {
namespace {

using assets::ConfigError;
using Entry = TomlReader::Entry;

Entry vector_entry(const TomlReader& reader, const char* key, Eigen::Vector3d& value) {
  return {key, [&](const toml::node& node, const std::string& where) { value = reader.vector(node, where); }};
}

/// Reads a key and notes that it was there.
Entry noted_vector(const TomlReader& reader, const char* key, Eigen::Vector3d& value, bool& has) {
  return {key, [&](const toml::node& node, const std::string& where) {
            value = reader.vector(node, where);
            has = true;
          }};
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

[[noreturn]] void refuse_missing(const TomlReader& reader, const toml::table& table, const std::string& where,
                                 const std::string& what) {
  throw ConfigError(fmt::format("{}: {}: {}", reader.place(table), where, what));
}

void read_box(const TomlReader& reader, const toml::table& table, PlainBox& box) {
  bool has_size = false;
  reader.read_table(table, "lattice",
                    {noted_vector(reader, "box", box.size, has_size),
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
  reader.read_table(
      table, where,
      {string_entry(reader, "name", bone.name),
       string_entry(reader, "parent", bone.parent),
       noted_vector(reader, "start", bone.start, has_start),
       noted_vector(reader, "end", bone.end, has_end),
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

PlainPointLoad read_point_load(const TomlReader& reader, const toml::table& table, const std::string& where) {
  PlainPointLoad load;
  bool has_at = false, has_force = false;
  reader.read_table(
      table, where,
      {noted_vector(reader, "at", load.at, has_at), noted_vector(reader, "force", load.force, has_force)});
  if (!has_at) refuse_missing(reader, table, where, "at: missing, expected three coordinates in metres");
  if (!has_force) refuse_missing(reader, table, where, "force: missing, expected three numbers in newtons");
  return load;
}

PlainBodyLoad read_body_load(const TomlReader& reader, const toml::table& table, const std::string& where) {
  PlainBodyLoad load;
  bool has_density = false, has_acceleration = false;
  reader.read_table(table, where,
                    {noted_vector(reader, "density", load.density, has_density),
                     noted_vector(reader, "acceleration", load.acceleration, has_acceleration)});
  if (!has_density && !has_acceleration)
    refuse_missing(reader, table, where,
                   "no load, expected density (N/m^3) or acceleration (m/s^2); hint: density = [0, -100, 0]");
  return load;
}

PlainFaceLoad read_face_load(const TomlReader& reader, const toml::table& table, const std::string& where) {
  PlainFaceLoad load;
  std::optional<BoxFace> face;
  bool has_pressure = false, has_traction = false;
  reader.read_table(table, where,
                    {face_entry(reader, face),
                     {"pressure",
                      [&](const toml::node& node, const std::string& at) {
                        load.pressure = reader.number(node, at);
                        has_pressure = true;
                      }},
                     noted_vector(reader, "traction", load.traction, has_traction)});
  if (!face)
    refuse_missing(reader, table, where, "face: missing, expected a side of the box; hint: face = \"x-max\"");
  if (!has_pressure && !has_traction)
    refuse_missing(reader, table, where,
                   "no load, expected pressure (turns with the surface) or traction (keeps its direction) in "
                   "pascal; hint: pressure = 100");
  load.face = *face;
  return load;
}

PlainVelocity read_velocity(const TomlReader& reader, const toml::table& table) {
  PlainVelocity velocity;
  bool has_linear = false, has_spin = false;
  reader.read_table(table, "velocity",
                    {noted_vector(reader, "linear", velocity.linear, has_linear),
                     noted_vector(reader, "spin", velocity.spin, has_spin),
                     {"about", [&](const toml::node& node, const std::string& at) {
                        velocity.about = reader.vector(node, at);
                      }}});
  if (!has_linear && !has_spin)
    refuse_missing(reader, table, "velocity",
                   "no velocity, expected linear (m/s) or spin (degrees/s); hint: linear = [0, 1, 0]");
  return velocity;
}

}  // namespace

std::vector<std::string> plain_scene_keys() {
  return {"body_load", "bone", "face_load", "fixed", "lattice", "point_load", "velocity"};
}

void read_plain_scene(const TomlReader& reader, const std::string& key, const toml::node& node,
                      PlainScene& plain) {
  const auto read_all = [&](auto& list, const auto& read) {
    reader.read_tables(node, key, [&](const toml::table& table, const std::string& where) {
      list.push_back(read(reader, table, where));
    });
  };
  if (key == "lattice") {
    read_box(reader, reader.table(node, reader.place(node) + ": lattice"), plain.box);
  } else if (key == "bone") {
    read_all(plain.bones, read_bone);
  } else if (key == "fixed") {
    read_all(plain.fixed, read_fixed);
  } else if (key == "point_load") {
    read_all(plain.point_loads, read_point_load);
  } else if (key == "body_load") {
    read_all(plain.body_loads, read_body_load);
  } else if (key == "face_load") {
    read_all(plain.face_loads, read_face_load);
  } else if (key == "velocity") {
    plain.velocity = read_velocity(reader, reader.table(node, reader.place(node) + ": velocity"));
  }
}

}  // namespace sinew::tools::detail
