#include "tools/scene.h"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene_fields.h"

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
  // Bone names come through the same writer as the other strings: one place knows how TOML quotes.
  static const SceneField& field = *find_scene_field("clip");
  std::string list;
  for (const std::string& text : texts) {
    Scene scratch;
    scratch.clip = text;
    list += (list.empty() ? "" : ", ") + toml_value(scratch, field);
  }
  return "[" + list + "]";
}

std::string print_material(const BoneMaterial& material) {
  std::string text = "\n[[material]]\nbones = " + toml_strings(material.bones) + "\n";
  for (const auto& [key, member] : kMaterialValues) {
    if (material.*member) text += fmt::format("{} = {}\n", key, *(material.*member));
  }
  return text;
}

}  // namespace

void Scene::validate() const {
  for (const SceneField& field : scene_fields()) check_field(*this, field, std::string(field.key));
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
    const std::string value = toml_value(scene, field);
    text += fmt::format(
        "\n# {}\n{}", help_text(field),
        value.empty() ? fmt::format("# {} =\n", field.key) : fmt::format("{} = {}\n", field.key, value));
  }
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
