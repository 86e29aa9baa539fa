#include "tools/scene.h"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene_fields.h"
#include "tools/toml_text.h"

namespace sinew::tools {
namespace {

struct MaterialValue {
  const char* key;
  std::optional<double> BoneMaterial::*member;
};
constexpr MaterialValue kMaterialValues[] = {{"young", &BoneMaterial::young},
                                             {"poisson", &BoneMaterial::poisson},
                                             {"density", &BoneMaterial::density}};

/// `*` stands for any letters, `?` for one.
bool matches(std::string_view pattern, std::string_view name) {
  // Greedy with one way back: when a letter does not fit, the last * swallows one more.
  std::size_t p = 0, n = 0, after_star = std::string_view::npos, swallowed_to = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      after_star = ++p;
      swallowed_to = n;
    } else if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == name[n])) {
      ++p;
      ++n;
    } else if (after_star != std::string_view::npos) {
      p = after_star;
      n = ++swallowed_to;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

std::string toml_strings(const std::vector<std::string>& texts) {
  std::string list;
  for (const std::string& text : texts) list += (list.empty() ? "" : ", ") + toml_quoted(text, "bones");
  return "[" + list + "]";
}

std::string print_material(const BoneMaterial& material) {
  std::string text = "\n[[material]]\nbones = " + toml_strings(material.bones) + "\n";
  for (const auto& [key, member] : kMaterialValues) {
    if (material.*member) text += fmt::format("{} = {}\n", key, *(material.*member));
  }
  return text;
}

/// Keys that say something about a rig; a plain scene has none of them.
bool is_of_characters(std::string_view key) {
  constexpr std::string_view kKeys[] = {"rig",    "clip",         "lattice",    "cells",
                                        "height", "output_space", "output_mesh"};
  return std::find(std::begin(kKeys), std::end(kKeys), key) != std::end(kKeys);
}

void check_plain(const Scene& scene) {
  scene.plain->validate();
  const Scene defaults;
  for (const SceneField& field : scene_fields()) {
    if (!is_of_characters(field.key) || flag_text(scene, field) == flag_text(defaults, field)) continue;
    throw assets::ConfigError(
        fmt::format("{}: got {}, expected nothing as the scene is a box without a rig; hint: "
                    "[lattice] holds its size and its cells",
                    field.key, flag_text(scene, field)));
  }
  if (!scene.young) {
    throw assets::ConfigError(
        "young: missing, expected Young's modulus in pascal as the scene is a box without a rig; "
        "hint: young = 1e5");
  }
}

}  // namespace

void Scene::validate() const {
  for (const SceneField& field : scene_fields()) check_field(*this, field, std::string(field.key));
  if (plain) check_plain(*this);
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const std::string where = fmt::format("material {}", i + 1);
    if (materials[i].bones.empty())
      throw assets::ConfigError(where + ": no bones, expected at least one name");
    for (const auto& [key, member] : kMaterialValues) {
      if (materials[i].*member)
        check_number(*find_scene_field(key), *(materials[i].*member), where + ": " + key);
    }
  }
}

std::string print_scene(const Scene& scene) {
  std::string text = "# Paths are relative to the directory of this file.\n";
  for (const SceneField& field : scene_fields()) {
    if (scene.plain && is_of_characters(field.key)) continue;
    const std::string value = toml_value(scene, field);
    text += fmt::format(
        "\n# {}\n{}", help_text(field),
        value.empty() ? fmt::format("# {} =\n", field.key) : fmt::format("{} = {}\n", field.key, value));
  }
  if (scene.plain) text += print_plain_scene(*scene.plain);
  for (const BoneMaterial& material : scene.materials) text += print_material(material);
  return text;
}

std::vector<int> material_of_bone(const Scene& scene, const std::string& rig_file,
                                  const std::vector<std::string>& bone_names) {
  std::vector<int> material(bone_names.size(), -1);
  for (std::size_t m = 0; m < scene.materials.size(); ++m) {
    for (const std::string& pattern : scene.materials[m].bones) {
      bool found = false;
      for (std::size_t bone = 0; bone < bone_names.size(); ++bone) {
        if (!matches(pattern, bone_names[bone])) continue;
        material[bone] = static_cast<int>(m);
        found = true;
      }
      if (!found) {
        throw assets::InputError(
            rig_file, fmt::format("material {}: no bone is named '{}', expected one of {}", m + 1, pattern,
                                  fmt::join(bone_names, ", ")));
      }
    }
  }
  return material;
}

}  // namespace sinew::tools
