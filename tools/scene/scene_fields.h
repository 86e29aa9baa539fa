#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "tools/scene/scene.h"

/// The one table from which flags, keys, ranges, help texts and printed scenes are made.
namespace sinew::tools {

/// A file name; other than plain text it is relative to the scene file it stands in.
struct PathMember {
  std::string Scene::*path;
};

/// The name of a model of the flesh (fem/models/model.h).
struct ModelMember {
  std::string Scene::*name;
};

using SceneMember =
    std::variant<bool Scene::*, int Scene::*, double Scene::*, std::optional<double> Scene::*,
                 std::string Scene::*, PathMember, ModelMember, std::vector<std::string> Scene::*,
                 std::vector<int> Scene::*, Switch Scene::*, Eigen::Vector3d Scene::*,
                 std::optional<FrameRange> Scene::*, Integrator Scene::*, std::optional<Precision> Scene::*,
                 OutputSpace Scene::*>;

/// An interval of numbers.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool open = false;  ///< the ends do not belong to it.

  bool contains(double value) const {
    return open ? min < value && value < max : min <= value && value <= max;
  }
};

/// One flag and key.
struct SceneField {
  std::string_view key;  ///< the flag is the same with - for _.
  SceneMember member;
  std::string_view help;         ///< for --help and the comment in a printed scene.
  std::string_view symbol = {};  ///< numbers: what the range in a message is about.
  Range range = {};
  std::string_view unit = {};
  std::string_view hint = {};  ///< a value that is right for most.
};

/// A key of [[material]] and its range.
struct MaterialValue {
  const SceneField* field = nullptr;
  std::optional<double> BoneMaterial::*member = nullptr;
};
std::vector<MaterialValue> material_values();

/// The key `factor` of [[size]].
const SceneField& size_factor_field();
/// The keys `radius` and `stiffness` of [[material]].
const SceneField& pull_radius_field();
const SceneField& pull_stiffness_field();

/// In the order of a printed scene.
std::span<const SceneField> scene_fields();

/// nullptr where there is none.
const SceneField* find_scene_field(std::string_view key);

/// "damping_frequency" -> "--damping-frequency".
std::string flag_name(const SceneField& field);

/// The text with every `key` of a scene in backquotes, as the libraries write it, as its flag: `soft_bones`
/// becomes --soft-bones. Other words in backquotes stay.
std::string with_flags(std::string_view text);

/// For --help and the comment in a printed scene: what it is, the names or the range allowed.
std::string help_text(const SceneField& field);

/// "-1 < nu < 0.5", "1e-06 <= h <= 0.1 s".
std::string range_text(const SceneField& field);

/// A number, all of the text, or a fraction of two: "1/120", "24000/1001". nullopt for anything else,
/// overflow included. Does not depend on the locale.
std::optional<double> parse_number(std::string_view text);

/// Throws assets::ConfigError "<where>: got <value>, expected <range>; hint: <hint>" where `value` is out of
/// range.
void check_number(const SceneField& field, double value, const std::string& where);

/// Checks the field's value in the scene; `where` opens the message.
void check_field(const Scene& scene, const SceneField& field, const std::string& where);

/// Sets the field from the text of a flag (or from a string in a scene file, where the key takes one) and
/// checks it. Throws as check_number.
void set_from_text(Scene& scene, const SceneField& field, std::string_view text, const std::string& where);

/// One warning for every setting outside of the envelope in which every rung is tested (fem/time/envelope.h),
/// those of single materials included.
std::vector<std::string> outside_envelope(const Scene& scene);

/// The value as a flag takes it; empty where it is unset.
std::string flag_text(const Scene& scene, const SceneField& field);

/// The value as TOML; empty where it is unset.
std::string toml_value(const Scene& scene, const SceneField& field);

}  // namespace sinew::tools
