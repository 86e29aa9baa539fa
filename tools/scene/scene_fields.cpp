#include "tools/scene/scene_fields.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "assets/error.h"
#include "fem/time/envelope.h"
#include "tools/scene/toml_text.h"
#include "tools/support/suggest.h"

namespace sinew::tools {
namespace {

using assets::ConfigError;

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;  // clang 14 does not deduce aggregates by itself

constexpr int kMaxFrame = 10'000'000;
constexpr int kMaxCells = 1'000'000;

// Ranges: what the method can take, wide enough for an insect and for a whale; fem/time/envelope.h is
// narrower. A NaN is in no range.
constexpr auto kFields = std::to_array<SceneField>({
    {"rig", PathMember{&Scene::rig}, "the character: glTF, GLB, FBX, Collada, ..."},
    {"output", PathMember{&Scene::output}, "directory that the results go to"},
    {"overwrite", &Scene::overwrite, "replace the run that the output holds already"},
    {"json", &Scene::json, "print the report as JSON on standard output"},
    {"clip", &Scene::clip, "name of the clip; left out: the first with at least two keys"},
    {"lattice", PathMember{&Scene::lattice},
     "lattice file (.vtu, .vtk, .msh, .mesh, .node, .ele, .veg); left out: one is built"},
    {"lattice_space", &Scene::lattice_space, "units and axes of a lattice of yours: file (the rig's) or si"},
    {"snap_tolerance",
     &Scene::snap_tolerance,
     "how far a lattice of yours may miss its bones, as a share of the character's size",
     "tolerance",
     {1e-12, 0.1},
     "",
     "1e-4"},
    {"soft_bones", &Scene::soft_bones, "hold bones that are no edges of a lattice of yours by penalty"},
    {"cache", &Scene::cache, "on or off: take the lattice of an earlier run where nothing changed"},
    {"cells", &Scene::cells, "wanted number of lattice cells", "cells", {20, kMaxCells}, "", "1000"},
    {"cell_size",
     &Scene::cell_size,
     "wanted edge of the lattice's cells instead of their number",
     "cell_size",
     {1e-4, 1e3},
     "m",
     "a quarter of a limb's thickness"},
    {"bones_include", &Scene::bones_include,
     "joints that may have bones (* any letters, ? one); left out: all"},
    {"bones_exclude", &Scene::bones_exclude,
     "joints that have none; what hangs on them hangs on the joint above"},
    {"tip_bones", &Scene::tip_bones, "on or off: bones for weighted joints without children"},
    {"symmetry", &Scene::symmetry, "on or off: a mirror-symmetric lattice for a mirror-symmetric rig"},
    {"grade", &Scene::grade,
     "on or off: smaller cells where limbs are thin, larger ones elsewhere; off where cell_size is given"},
    {"coarsen_rigid", &Scene::coarsen_rigid,
     "on or off: larger cells where the skin follows one bone alone, away from joints"},
    {"levels", &Scene::levels, "finest active level of the hierarchy", "levels", {0, 3}, "", "1"},
    {"young",
     &Scene::young,
     "Young's modulus; left out: by the rig: 7 Hz for 1.8 m, as the root of the size",
     "E",
     {1e-3, 1e12},
     "Pa",
     "leave it out for the automatic value"},
    {"poisson", &Scene::poisson, "Poisson's ratio", "nu", {-1.0, 0.5, true}, "", "0.49"},
    {"density", &Scene::density, "density", "rho", {1.0, 1e5}, "kg/m^3", "1000"},
    {"damping", &Scene::damping, "damping ratio at the damping frequency", "zeta", {0.0, 10.0}, "", "0.1"},
    {"damping_frequency",
     &Scene::damping_frequency,
     "frequency at which the damping ratio holds",
     "f",
     {0.01, 1000.0},
     "Hz",
     "3"},
    {"height",
     &Scene::height,
     "height of the character; left out: the file's units are guessed",
     "height",
     {1e-3, 1e4},
     "m",
     "1.8"},
    {"output_space", &Scene::output_space, "units and axes of the output: file (the input's) or si"},
    {"gravity", &Scene::gravity, "gravity, Y up", "each component", {-1e4, 1e4}, "m/s^2", "0,-9.81,0"},
    {"step", &Scene::step, "time step", "h", {1e-6, 0.1}, "s", "1/120"},
    {"model", ModelMember{&Scene::model}, "model of the flesh, from the cheapest to the most exact"},
    {"integrator", &Scene::integrator,
     "bdf2, backward-euler (more damped, cannot fail), tr-bdf2 (two solves, most exact) or "
     "implicit-midpoint (keeps energy, rings after a jolt)"},
    {"precision", &Scene::precision,
     "of factors that last: double (blended if left out), float (blended-stiffness, corotational) or short "
     "(16 bits, the fastest; blended is off by 1e-4 of what a step changes)"},
    {"fps", &Scene::fps, "output frames per second", "fps", {0.1, 1e4}, "1/s", "30"},
    {"frames", &Scene::frames, "output frames A-B, both included; left out: the whole clip"},
    {"cuts",
     &Scene::cuts,
     "output frames that the character is cut to, besides the cuts that are found: it jumps on the way from "
     "the frame before, and its flesh goes along",
     "frame",
     {1, kMaxFrame},
     "",
     "31"},
    {"settle",
     &Scene::settle,
     "longest time to settle before the first frame",
     "settle",
     {0.0, 3600.0},
     "s",
     "5"},
    {"offset",
     &Scene::offset,
     "the rig's own skinning plus this share of (flesh - its rest in the pose); left out: the flesh itself",
     "offset",
     {0.0, 10.0},
     "",
     "1"},
    {"guard", &Scene::guard,
     "on or off: lay skin back towards plain skinning where it would tear or crease as cells are too coarse"},
    {"preview", &Scene::preview, "on or off: a picture of the result"},
    {"strict", &Scene::strict,
     "refuse flesh that is torn or did not settle: exit code 4, nothing is written"},
    {"threads",
     &Scene::threads,
     "threads, 0 = all; the results do not depend on it",
     "threads",
     {0, 1024},
     "",
     "0"},
    {"output_mesh", PathMember{&Scene::output_mesh},
     "mesh (OBJ, PLY) whose vertex order the output takes over"},
});

/// Of a table; no field of a scene.
constexpr SceneField kSizeFactor{
    "factor", SceneMember{}, "length of the cells' edges there over that elsewhere", "factor", {0.25, 4.0},
    "",       "0.5"};

constexpr SceneField kPullRadius{
    "radius",    SceneMember{}, "how far from its bone flesh is pulled after its turns", "r",
    {1e-6, 1e3}, "m",           "leave it out for a quarter of the limb's radius"};
constexpr SceneField kPullStiffness{"stiffness",
                                    SceneMember{},
                                    "of that pull, in shear moduli",
                                    "c",
                                    {0.0, 1e6},
                                    "",
                                    "10, or 100 for soft bones"};

// In the enum's order.
const std::vector<std::string> kIntegratorNames{"bdf2", "backward-euler", "tr-bdf2", "implicit-midpoint"};
const std::vector<std::string> kPrecisionNames{"double", "float", "short"};  // in the enum's order
const std::vector<std::string> kOutputSpaceNames{"file", "si"};              // in the enum's order

const std::vector<std::string> kSwitchNames{"off", "on"};  // in the enum's order

std::vector<std::string> model_names() {
  std::vector<std::string> names;
  for (const fem::ModelInfo& model : fem::models()) names.emplace_back(model.name);
  return names;
}

/// A finite or infinite number, all of the text; nullopt for anything else, overflow included.
std::optional<double> parse_double(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<int> parse_int(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

[[noreturn]] void refuse(const SceneField& field, std::string_view value, std::string_view expected,
                         const std::string& where) {
  throw ConfigError(fmt::format("{}: got {}, expected {}{}", where, value, expected,
                                field.hint.empty() ? "" : fmt::format("; hint: {}", field.hint)));
}

std::string in_quotes(std::string_view text) { return fmt::format("'{}'", text); }

void check_cells(double value, const std::string& where) {
  if (value <= kMaxCells) return;
  // 3 kB: a tetrahedron's matrices and its share of the factor at level 0, the least that a run can need.
  throw assets::LimitError(
      fmt::format("{}: got {:.0f}, the limit is {} cells; that many would need at least {:.0f} GB "
                  "of memory; hint: 1000 cells suffice for most characters",
                  where, value, kMaxCells, std::ceil(value * 3e3 / 1e9)));
}

template <class Enum>
Enum parse_choice(const std::vector<std::string>& names, std::string_view text, const std::string& where) {
  const auto found = std::find(names.begin(), names.end(), text);
  if (found != names.end()) return static_cast<Enum>(found - names.begin());
  const std::string guess = nearest(text, names);
  const std::string choices =
      fmt::format("{} or {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
  throw ConfigError(fmt::format("{}: got '{}', expected {}; hint: {}", where, text, choices,
                                guess.empty() ? names.front() : guess));
}

void check_model(const std::string& name, const std::string& where) {
  if (fem::find_model(name) != nullptr) return;
  const std::vector<std::string> names = model_names();
  const std::string guess = nearest(name, names);
  throw ConfigError(fmt::format("{}: got '{}', expected one of {}; hint: {}", where, name,
                                fmt::join(names, ", "),
                                guess.empty() ? std::string(fem::kDefaultModel) : guess));
}

/// Names with commas between; nothing: no name.
std::vector<std::string> parse_list(std::string_view text) {
  std::vector<std::string> names;
  while (!text.empty()) {
    const auto comma = text.find(',');
    const std::string_view name = trimmed(text.substr(0, comma));
    if (!name.empty()) names.emplace_back(name);
    text.remove_prefix(comma == std::string_view::npos ? text.size() : comma + 1);
  }
  return names;
}

FrameRange parse_frames(std::string_view text, const std::string& where) {
  const auto dash = text.find('-', 1);  // not at 0: that would be a sign
  const auto first = parse_int(trimmed(text.substr(0, dash)));
  const auto last = dash == std::string_view::npos ? first : parse_int(trimmed(text.substr(dash + 1)));
  if (!first || !last) {
    throw ConfigError(fmt::format("{}: got '{}', expected A-B, two frame numbers; hint: 0-47", where, text));
  }
  return {*first, *last};
}

Eigen::Vector3d parse_vector(const SceneField& field, std::string_view text, const std::string& where) {
  const std::string whole(text);
  Eigen::Vector3d vector;
  for (int i = 0; i < 3; ++i) {
    const auto comma = text.find(',');
    const bool last = i == 2;
    const auto value = parse_number(trimmed(text.substr(0, comma)));
    if (!value || last != (comma == std::string_view::npos)) {
      refuse(field, in_quotes(whole), "three numbers x,y,z", where);
    }
    vector[i] = *value;
    text.remove_prefix(last ? text.size() : comma + 1);
  }
  return vector;
}

/// The shortest text that reads back as the same double: a fraction 1/n where that is exact and shorter.
std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  const double n = std::round(1.0 / value);
  const std::string fraction = fmt::format("1/{:.0f}", n);
  return n > 1.0 && 1.0 / n == value && fraction.size() < text.size() ? fraction : text;
}

/// TOML knows no fractions; as strings they are read again.
std::string toml_number(const std::string& text) {
  return text.find('/') == std::string::npos ? text : '"' + text + '"';
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  const auto slash = text.find('/');
  if (slash == std::string_view::npos) return parse_double(text);
  const auto numerator = parse_double(text.substr(0, slash));
  const auto denominator = parse_double(text.substr(slash + 1));
  if (!numerator || !denominator || *denominator == 0.0) return std::nullopt;
  return *numerator / *denominator;
}

std::span<const SceneField> scene_fields() { return kFields; }

const SceneField& size_factor_field() { return kSizeFactor; }
const SceneField& pull_radius_field() { return kPullRadius; }
const SceneField& pull_stiffness_field() { return kPullStiffness; }

const SceneField* find_scene_field(std::string_view key) {
  const auto found =
      std::find_if(kFields.begin(), kFields.end(), [&](const auto& field) { return field.key == key; });
  return found == kFields.end() ? nullptr : &*found;
}

std::string flag_name(const SceneField& field) {
  std::string name = "--" + std::string(field.key);
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

std::string with_flags(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t open = text.find('`');
    const std::size_t close = open == text.npos ? text.npos : text.find('`', open + 1);
    if (close == text.npos) break;
    const SceneField* field = find_scene_field(text.substr(open + 1, close - open - 1));
    result.append(text.substr(0, open));
    result += field == nullptr ? std::string(text.substr(open, close + 1 - open)) : flag_name(*field);
    text.remove_prefix(close + 1);
  }
  return result.append(text);
}

std::string help_text(const SceneField& field) {
  if (std::holds_alternative<ModelMember>(field.member))
    return fmt::format("{}: {}", field.help, fmt::join(model_names(), ", "));
  return field.symbol.empty() ? std::string(field.help)
                              : fmt::format("{}; {}", field.help, range_text(field));
}

std::string range_text(const SceneField& field) {
  // Long rows of zeros are hard to count.
  const auto text = [](double limit) {
    return limit > 1e7 ? fmt::format("{:g}", limit) : fmt::format("{}", limit);
  };
  const char* sign = field.range.open ? "<" : "<=";
  return fmt::format("{0} {1} {2} {1} {3}{4}{5}", text(field.range.min), sign, field.symbol,
                     text(field.range.max), field.unit.empty() ? "" : " ", field.unit);
}

void check_number(const SceneField& field, double value, const std::string& where) {
  if (field.key == "cells") check_cells(value, where);
  if (!field.range.contains(value)) refuse(field, fmt::format("{}", value), range_text(field), where);
}

void check_field(const Scene& scene, const SceneField& field, const std::string& where) {
  std::visit(
      Overloaded{
          [](bool Scene::*) {},
          [](std::string Scene::*) {},
          [](PathMember) {},
          [&](ModelMember member) { check_model(scene.*(member.name), where); },
          [](std::vector<std::string> Scene::*) {},
          [&](std::vector<int> Scene::*member) {
            for (const int value : scene.*member) check_number(field, value, where);
          },
          [](Switch Scene::*) {},
          [](Integrator Scene::*) {},
          [](std::optional<Precision> Scene::*) {},
          [](OutputSpace Scene::*) {},
          [&](int Scene::*member) { check_number(field, scene.*member, where); },
          [&](double Scene::*member) { check_number(field, scene.*member, where); },
          [&](std::optional<double> Scene::*member) {
            if (scene.*member) check_number(field, *(scene.*member), where);
          },
          [&](Eigen::Vector3d Scene::*member) {
            for (const double component : scene.*member) check_number(field, component, where);
          },
          [&](std::optional<FrameRange> Scene::*member) {
            if (!(scene.*member)) return;
            const auto [first, last] = *(scene.*member);
            if (first >= 0 && first <= last && last <= kMaxFrame) return;
            throw ConfigError(fmt::format("{}: got {}-{}, expected A-B with 0 <= A <= B <= {}; hint: 0-47",
                                          where, first, last, kMaxFrame));
          },
      },
      field.member);
}

std::vector<std::string> outside_envelope(const Scene& scene) {
  std::vector<std::string> warnings;
  const auto look = [&](const fem::TestedRange& range, double value, const std::string& where) {
    if (range.contains(value)) return;
    const SceneField& field = *find_scene_field(range.setting);
    warnings.push_back(
        fmt::format("{}{}: got {:g}{}{}, outside of {:g} ... {:g}, where every model is tested", where,
                    range.setting, value, field.unit.empty() ? "" : " ", field.unit, range.low, range.high));
  };
  for (const fem::TestedRange& range : fem::kEnvelope) {
    const SceneMember& member = find_scene_field(range.setting)->member;
    if (const auto* number = std::get_if<double Scene::*>(&member)) look(range, scene.**number, "");
    const auto* optional = std::get_if<std::optional<double> Scene::*>(&member);
    if (optional != nullptr && scene.**optional) look(range, *(scene.**optional), "");
    for (std::size_t i = 0; i < scene.materials.size(); ++i) {
      for (const MaterialValue& value : material_values()) {
        const auto& of_bones = scene.materials[i].*value.member;
        if (value.field->key == range.setting && of_bones)
          look(range, *of_bones, fmt::format("material {}: ", i + 1));
      }
    }
  }
  return warnings;
}

void set_from_text(Scene& scene, const SceneField& field, std::string_view text, const std::string& where) {
  const auto number = [&] {
    const auto value = parse_number(text);
    if (!value) refuse(field, in_quotes(text), "a number, " + range_text(field), where);
    return *value;
  };
  std::visit(
      Overloaded{
          [&](bool Scene::*member) { scene.*member = true; },
          [&](std::string Scene::*member) { scene.*member = text; },
          [&](PathMember member) { scene.*(member.path) = text; },
          [&](ModelMember member) { scene.*(member.name) = text; },
          [&](std::vector<std::string> Scene::*member) { scene.*member = parse_list(text); },
          [&](std::vector<int> Scene::*member) {
            (scene.*member).clear();
            for (const std::string& entry : parse_list(text)) {
              const auto value = parse_int(entry);
              if (!value)
                refuse(field, in_quotes(entry), "whole numbers with commas, " + range_text(field), where);
              (scene.*member).push_back(*value);
            }
          },
          [&](Switch Scene::*member) { scene.*member = parse_choice<Switch>(kSwitchNames, text, where); },
          [&](int Scene::*member) {
            const auto value = parse_int(text);
            if (!value) refuse(field, in_quotes(text), "a whole number, " + range_text(field), where);
            scene.*member = *value;
          },
          [&](double Scene::*member) { scene.*member = number(); },
          [&](std::optional<double> Scene::*member) { scene.*member = number(); },
          [&](Eigen::Vector3d Scene::*member) { scene.*member = parse_vector(field, text, where); },
          [&](std::optional<FrameRange> Scene::*member) { scene.*member = parse_frames(text, where); },
          [&](Integrator Scene::*member) {
            scene.*member = parse_choice<Integrator>(kIntegratorNames, text, where);
          },
          [&](std::optional<Precision> Scene::*member) {
            scene.*member = parse_choice<Precision>(kPrecisionNames, text, where);
          },
          [&](OutputSpace Scene::*member) {
            scene.*member = parse_choice<OutputSpace>(kOutputSpaceNames, text, where);
          },
      },
      field.member);
  check_field(scene, field, where);
}

std::string flag_text(const Scene& scene, const SceneField& field) {
  const auto choice = [](const std::vector<std::string>& names, auto value) {
    return names[static_cast<std::size_t>(value)];
  };
  return std::visit(
      Overloaded{
          [&](bool Scene::*member) { return std::string(scene.*member ? "true" : "false"); },
          [&](std::string Scene::*member) { return scene.*member; },
          [&](PathMember member) { return scene.*(member.path); },
          [&](ModelMember member) { return scene.*(member.name); },
          [&](std::vector<std::string> Scene::*member) {
            return fmt::format("{}", fmt::join(scene.*member, ","));
          },
          [&](std::vector<int> Scene::*member) { return fmt::format("{}", fmt::join(scene.*member, ",")); },
          [&](Switch Scene::*member) { return choice(kSwitchNames, scene.*member); },
          [&](int Scene::*member) { return fmt::format("{}", scene.*member); },
          [&](double Scene::*member) { return number_text(scene.*member); },
          [&](std::optional<double> Scene::*member) {
            return scene.*member ? number_text(*(scene.*member)) : std::string();
          },
          [&](Eigen::Vector3d Scene::*member) { return fmt::format("{}", fmt::join(scene.*member, ",")); },
          [&](std::optional<FrameRange> Scene::*member) {
            return scene.*member ? fmt::format("{}-{}", (scene.*member)->first, (scene.*member)->last)
                                 : std::string();
          },
          [&](Integrator Scene::*member) { return choice(kIntegratorNames, scene.*member); },
          [&](std::optional<Precision> Scene::*member) {
            return scene.*member ? choice(kPrecisionNames, *(scene.*member)) : std::string();
          },
          [&](OutputSpace Scene::*member) { return choice(kOutputSpaceNames, scene.*member); },
      },
      field.member);
}

std::string toml_value(const Scene& scene, const SceneField& field) {
  const std::string text = flag_text(scene, field);
  if (text.empty()) return text;
  return std::visit(
      Overloaded{
          [&](bool Scene::*) { return text; },
          [&](std::vector<std::string> Scene::*member) { return toml_quoted(scene.*member, field.key); },
          [&](int Scene::*) { return text; },
          [&](std::vector<int> Scene::*member) {
            return fmt::format("[{}]", fmt::join(scene.*member, ", "));
          },
          [&](double Scene::*) { return toml_number(text); },
          [&](std::optional<double> Scene::*) { return toml_number(text); },
          [&](Eigen::Vector3d Scene::*member) { return fmt::format("[{}]", fmt::join(scene.*member, ", ")); },
          [&](auto) { return toml_quoted(text, field.key); },
      },
      field.member);
}

}  // namespace sinew::tools
