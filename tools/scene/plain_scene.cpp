#include "tools/scene/plain_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "assets/error.h"
#include "tools/scene/toml_text.h"
#include "tools/support/suggest.h"

namespace sinew::tools {
namespace {

using assets::ConfigError;

constexpr double kMaxBlocks = 1e6;      // as many as `cells` allows
constexpr double kMaxCoordinate = 1e6;  // [m]
constexpr double kMinSize = 1e-9;       // [m]
constexpr double kMaxTime = 1e6;        // [s]
constexpr double kMaxTurn = 3.6e6;      // [degrees], [degrees/s]: ten thousand turns
constexpr double kMaxLoad = 1e12;       // [N], [Pa], [N/m^3], [m/s^2]: the stiffest flesh has 1e12 Pa
constexpr double kMaxSpeed = 1e4;       // [m/s]
constexpr std::array<const char*, 3> kTypeNames{"tetrahedra", "wedges", "hexahedra"};  // in the enum's order

std::string text_of(const Eigen::Vector3d& v) { return fmt::format("[{}, {}, {}]", v[0], v[1], v[2]); }

void require(bool holds, const std::string& where, const std::string& value, const std::string& expected) {
  if (!holds) throw ConfigError(fmt::format("{}: got {}, expected {}", where, value, expected));
}

void require_point(const Eigen::Vector3d& point, const std::string& where) {
  require(point.allFinite() && point.cwiseAbs().maxCoeff() <= kMaxCoordinate, where, text_of(point),
          fmt::format("three numbers within {:g} m", kMaxCoordinate));
}

void validate_box(const PlainBox& box) {
  require(box.size.allFinite() && box.size.minCoeff() >= kMinSize && box.size.maxCoeff() <= kMaxCoordinate,
          "lattice: box", text_of(box.size),
          fmt::format("three sizes of {:g} to {:g} m", kMinSize, kMaxCoordinate));
  require_point(box.corner, "lattice: corner");
  const std::string cells = fmt::format("[{}, {}, {}]", box.cells[0], box.cells[1], box.cells[2]);
  require(box.cells.minCoeff() >= 1, "lattice: cells", cells, "three numbers of at least 1");
  if (box.cells.cast<double>().prod() > kMaxBlocks) {
    throw assets::LimitError(
        fmt::format("lattice: cells: got {}, the limit is {:g} cells", cells, kMaxBlocks));
  }
}

void validate_keys(const PlainBone& bone, const std::string& where) {
  double before = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < bone.keys.size(); ++k) {
    const PlainKey& key = bone.keys[k];
    const std::string at = fmt::format("{}: key {}", where, k + 1);
    require(std::abs(key.time) <= kMaxTime, at + ": time", fmt::format("{}", key.time),
            fmt::format("a number of seconds within {:g}", kMaxTime));
    require(key.time > before, at + ": time", fmt::format("{}", key.time),
            fmt::format("more than {} s, the key before", before));
    require_point(key.move, at + ": move");
    require(key.axis.allFinite() && key.axis.norm() > 0.0, at + ": axis", text_of(key.axis), "a direction");
    require(std::abs(key.angle) <= kMaxTurn, at + ": angle", fmt::format("{}", key.angle),
            fmt::format("degrees within {:g}", kMaxTurn));
    before = key.time;
  }
}

void require_bone(const std::string& name, const std::vector<std::string>& known, const std::string& where) {
  if (std::find(known.begin(), known.end(), name) != known.end()) return;
  const std::string guess = nearest(name, known);
  throw ConfigError(
      fmt::format("{}: got '{}', expected a bone that stands above it{}{}", where, name,
                  known.empty() ? ", there is none" : fmt::format(": {}", fmt::join(known, ", ")),
                  guess.empty() ? "" : fmt::format("; hint: did you mean {}?", guess)));
}

void require_vector(const Eigen::Vector3d& value, double largest, const std::string& where,
                    const std::string& unit) {
  require(value.allFinite() && value.cwiseAbs().maxCoeff() <= largest, where, text_of(value),
          fmt::format("three numbers within {:g} {}", largest, unit));
}

void validate_loads(const PlainScene& plain) {
  const Eigen::Array3d slack = 1e-9 * plain.box.size.array();
  const Eigen::Array3d lowest = plain.box.corner.array() - slack,
                       highest = (plain.box.corner + plain.box.size).array() + slack;
  for (std::size_t i = 0; i < plain.point_loads.size(); ++i) {
    const PlainPointLoad& load = plain.point_loads[i];
    const std::string where = fmt::format("point_load {}", i + 1);
    require((load.at.array() >= lowest).all() && (load.at.array() <= highest).all(), where + ": at",
            text_of(load.at), "a point of the box");
    require_vector(load.force, kMaxLoad, where + ": force", "N");
  }
  for (std::size_t i = 0; i < plain.body_loads.size(); ++i) {
    const std::string where = fmt::format("body_load {}", i + 1);
    require_vector(plain.body_loads[i].density, kMaxLoad, where + ": density", "N/m^3");
    require_vector(plain.body_loads[i].acceleration, kMaxLoad, where + ": acceleration", "m/s^2");
  }
  for (std::size_t i = 0; i < plain.face_loads.size(); ++i) {
    const PlainFaceLoad& load = plain.face_loads[i];
    const std::string where = fmt::format("face_load {}", i + 1);
    require(std::abs(load.pressure) <= kMaxLoad, where + ": pressure", fmt::format("{}", load.pressure),
            fmt::format("a number within {:g} Pa", kMaxLoad));
    require_vector(load.traction, kMaxLoad, where + ": traction", "Pa");
  }
  if (!plain.velocity) return;
  require_vector(plain.velocity->linear, kMaxSpeed, "velocity: linear", "m/s");
  require_vector(plain.velocity->spin, kMaxTurn, "velocity: spin", "degrees/s");
  if (plain.velocity->about) require_point(*plain.velocity->about, "velocity: about");
}

std::string print_loads(const PlainScene& plain) {
  std::string text;
  for (const PlainPointLoad& load : plain.point_loads)
    text += fmt::format("\n[[point_load]]\nat = {}\nforce = {}\n", text_of(load.at), text_of(load.force));
  for (const PlainBodyLoad& load : plain.body_loads) {
    text += fmt::format("\n[[body_load]]\ndensity = {}\nacceleration = {}\n", text_of(load.density),
                        text_of(load.acceleration));
  }
  for (const PlainFaceLoad& load : plain.face_loads) {
    text += fmt::format("\n[[face_load]]\nface = \"{}\"\npressure = {}\ntraction = {}\n",
                        face_name(load.face), load.pressure, text_of(load.traction));
  }
  if (!plain.velocity) return text;
  text += fmt::format("\n[velocity]\nlinear = {}\nspin = {}\n", text_of(plain.velocity->linear),
                      text_of(plain.velocity->spin));
  if (plain.velocity->about) text += fmt::format("about = {}\n", text_of(*plain.velocity->about));
  return text;
}

std::string print_bone(const PlainBone& bone) {
  std::string text = "\n[[bone]]\nname = " + toml_quoted(bone.name, "bone") + "\n";
  if (!bone.parent.empty()) text += "parent = " + toml_quoted(bone.parent, "parent") + "\n";
  text += fmt::format("start = {}\nend = {}\n", text_of(bone.start), text_of(bone.end));
  if (bone.soft) text += "soft = true\n";
  if (bone.keys.empty()) return text;
  text += "keys = [\n";
  for (const PlainKey& key : bone.keys) {
    text += fmt::format("  {{ time = {}, move = {}, axis = {}, angle = {} }},\n", key.time, text_of(key.move),
                        text_of(key.axis), key.angle);
  }
  return text + "]\n";
}

}  // namespace

void PlainScene::validate() const {
  validate_box(box);
  std::vector<std::string> names;
  for (const PlainBone& bone : bones) {
    const std::string where = fmt::format("bone '{}'", bone.name);
    require(!bone.name.empty(), fmt::format("bone {}: name", names.size() + 1), "none", "a name");
    require(std::find(names.begin(), names.end(), bone.name) == names.end(), where, "the name twice",
            "names that differ");
    if (!bone.parent.empty()) require_bone(bone.parent, names, where + ": parent");
    require_point(bone.start, where + ": start");
    require_point(bone.end, where + ": end");
    require((bone.end - bone.start).norm() > 1e-9 * box.size.norm(), where + ": end", text_of(bone.end),
            "another point than its start");
    validate_keys(bone, where);
    names.push_back(bone.name);
  }
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (!fixed[i].bone.empty()) require_bone(fixed[i].bone, names, fmt::format("fixed {}: bone", i + 1));
  }
  validate_loads(*this);
}

std::string face_name(const BoxFace& face) {
  return std::string(1, static_cast<char>('x' + face.axis)) + (face.high ? "-max" : "-min");
}

std::optional<BoxFace> find_face(const std::string& name) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool high : {false, true}) {
      if (face_name({axis, high}) == name) return BoxFace{axis, high};
    }
  }
  return std::nullopt;
}

std::string cell_type_name(lattice::CellType type) { return kTypeNames[static_cast<std::size_t>(type)]; }

std::optional<lattice::CellType> find_cell_type(const std::string& name) {
  const auto found = std::find(kTypeNames.begin(), kTypeNames.end(), name);
  if (found == kTypeNames.end()) return std::nullopt;
  return static_cast<lattice::CellType>(found - kTypeNames.begin());
}

std::string print_plain_scene(const PlainScene& plain) {
  const PlainBox& box = plain.box;
  std::string text = fmt::format("\n[lattice]\nbox = {}\ncorner = {}\ncells = [{}, {}, {}]\ntype = \"{}\"\n",
                                 text_of(box.size), text_of(box.corner), box.cells[0], box.cells[1],
                                 box.cells[2], cell_type_name(box.type));
  for (const PlainBone& bone : plain.bones) text += print_bone(bone);
  for (const FixedFace& f : plain.fixed) {
    text += fmt::format("\n[[fixed]]\nface = \"{}\"\n", face_name(f.face));
    if (!f.bone.empty()) text += "bone = " + toml_quoted(f.bone, "fixed") + "\n";
  }
  return text + print_loads(plain);
}

}  // namespace sinew::tools
