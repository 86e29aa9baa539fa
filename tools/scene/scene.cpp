#include "tools/scene/scene.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/scene/scene_fields.h"
#include "tools/scene/toml_text.h"
#include "tools/support/suggest.h"

namespace sinew::tools {
namespace {

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

std::string print_material(const BoneMaterial& material) {
  std::string text = "\n[[material]]\n";
  if (!material.bones.empty()) text += fmt::format("bones = {}\n", toml_quoted(material.bones, "bones"));
  if (!material.regions.empty())
    text += fmt::format("regions = {}\n", toml_quoted(material.regions, "regions"));
  if (!material.region.empty()) text += fmt::format("region = {}\n", toml_quoted(material.region, "region"));
  for (const auto& [field, member] : material_values()) {
    if (material.*member) text += fmt::format("{} = {}\n", field->key, *(material.*member));
  }
  return text;
}

std::string print_size(const BoneSize& size) {
  return fmt::format("\n[[size]]\nbones = {}\nfactor = {}\n", toml_quoted(size.bones, "bones"), size.factor);
}

std::string print_role(std::string_view table, const RoleOf& of) {
  return fmt::format("\n[[{}]]\nname = {}\nrole = \"{}\"\n", table, toml_quoted(of.name, "name"),
                     role_name(of.role));
}

/// Keys that say something about a rig; a plain scene has none of them.
bool is_of_characters(std::string_view key) {
  constexpr std::string_view kKeys[] = {
      "rig",           "clip",      "lattice",       "lattice_space", "snap_tolerance", "soft_bones", "cache",
      "cells",         "cell_size", "bones_include", "bones_exclude", "tip_bones",      "symmetry",   "grade",
      "coarsen_rigid", "height",    "output_space",  "output_mesh",   "guard"};
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
  if (!scene.sizes.empty()) {
    throw assets::ConfigError(
        "[[size]]: expected none as the scene is a box without a rig; hint: [lattice] holds its cells");
  }
  if (!scene.part_roles.empty() || !scene.bone_roles.empty()) {
    throw assets::ConfigError(
        "role: expected none as the scene is a box without a rig, which is flesh; hint: leave it out");
  }
  if (!scene.young) {
    throw assets::ConfigError(
        "young: missing, expected Young's modulus in pascal as the scene is a box without a rig; "
        "hint: young = 1e5");
  }
}

/// A lattice that is read is not built.
void check_no_builder_keys(const Scene& scene) {
  const Scene defaults;
  for (const char* key : {"cell_size", "bones_include", "bones_exclude", "grade", "coarsen_rigid"}) {
    const SceneField& field = *find_scene_field(key);
    if (flag_text(scene, field) == flag_text(defaults, field)) continue;
    throw assets::ConfigError(
        fmt::format("{}: got {}, expected nothing as the lattice is read from {}; hint: leave one "
                    "of the two out",
                    key, flag_text(scene, field), scene.lattice));
  }
  if (!scene.sizes.empty()) {
    throw assets::ConfigError(
        fmt::format("[[size]]: expected none as the lattice is read from {}; hint: leave one of the two out",
                    scene.lattice));
  }
}

/// Flesh without inertia has no energy to keep and no velocity to be exact about.
void check_integrator(const Scene& scene) {
  if (fem::find_model(scene.model)->dynamic) return;
  if (scene.integrator == Integrator::Bdf2 || scene.integrator == Integrator::BackwardEuler) return;
  const SceneField& field = *find_scene_field("integrator");
  throw assets::ConfigError(fmt::format(
      "{}: got {}, expected nothing as the model {} stands where the pose puts it; hint: leave it out",
      field.key, flag_text(scene, field), scene.model));
}

}  // namespace

std::vector<MaterialValue> material_values() {
  return {{find_scene_field("young"), &BoneMaterial::young},
          {find_scene_field("poisson"), &BoneMaterial::poisson},
          {find_scene_field("density"), &BoneMaterial::density},
          {&pull_radius_field(), &BoneMaterial::radius},
          {&pull_stiffness_field(), &BoneMaterial::stiffness}};
}

namespace {

void check_material(const Scene& scene, const BoneMaterial& material, const std::string& where) {
  if (material.bones.empty() && material.regions.empty())
    throw assets::ConfigError(where + ": no bones, expected at least one name");
  for (const auto& [field, member] : material_values()) {
    if (material.*member) check_number(*field, *(material.*member), fmt::format("{}: {}", where, field->key));
  }
  if (material.regions.empty()) return;
  if (!material.bones.empty() || material.radius || material.stiffness || !material.region.empty())
    throw assets::ConfigError(where +
                              ": regions of a lattice, expected no bones, radius, stiffness or region with "
                              "them; hint: two materials");
  if (scene.lattice.empty())
    throw assets::ConfigError((scene.source.path.empty() ? "" : scene.source.path + ": ") + where +
                              ": regions, expected none as a lattice that is built has none; hint: bones, or "
                              "a lattice of your own");
}

}  // namespace

void Scene::validate() const {
  for (const SceneField& field : scene_fields()) check_field(*this, field, std::string(field.key));
  if (plain) check_plain(*this);
  check_integrator(*this);
  if (!lattice.empty()) check_no_builder_keys(*this);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const std::string where = fmt::format("size {}", i + 1);
    if (sizes[i].bones.empty()) throw assets::ConfigError(where + ": no bones, expected at least one name");
    check_number(size_factor_field(), sizes[i].factor, where + ": factor");
  }
  for (const RoleOf& part : part_roles)
    if (part.name.empty()) throw assets::ConfigError("part: no name, expected one or a pattern");
  for (const RoleOf& bone : bone_roles)
    if (bone.name.empty()) throw assets::ConfigError("bone: no name, expected one or a pattern");
  for (std::size_t i = 0; i < materials.size(); ++i) {
    check_material(*this, materials[i], fmt::format("material {}", i + 1));
  }
}

std::string_view role_name(assets::PartRole role) {
  switch (role) {
    case assets::PartRole::Skinned:
      return "skinned";
    case assets::PartRole::Rigid:
      return "rigid";
    case assets::PartRole::Riding:
      return "riding";
    default:
      return "flesh";
  }
}

bool is_scene_file(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  for (char& letter : extension) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return extension == ".toml";
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
  for (const BoneSize& size : scene.sizes) text += print_size(size);
  for (const BoneMaterial& material : scene.materials) text += print_material(material);
  for (const RoleOf& part : scene.part_roles) text += print_role("part", part);
  for (const RoleOf& bone : scene.bone_roles) text += print_role("bone", bone);
  return text;
}

std::vector<int> matching(const std::string& pattern, const std::vector<std::string>& names) {
  std::vector<int> found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (matches(pattern, names[i])) found.push_back(static_cast<int>(i));
  }
  return found;
}

std::string no_such_bone(const std::string& pattern, const std::vector<std::string>& names) {
  return no_such("bone", pattern, names);
}

std::string no_such(const std::string& thing, const std::string& pattern,
                    const std::vector<std::string>& names) {
  std::string letters = pattern;
  std::erase_if(letters, [](char letter) { return letter == '*' || letter == '?'; });
  const bool open_ended = pattern.ends_with('*');
  std::vector<std::string> candidates = names;  // of "tial*" the beginnings count
  for (std::string& name : candidates) {
    if (open_ended) name = name.substr(0, letters.size());
  }
  std::string guess = nearest(letters, candidates);
  if (!guess.empty() && open_ended) guess += '*';
  if (!guess.empty())
    return fmt::format("no {} is named '{}'; hint: did you mean {}?", thing, pattern, guess);
  constexpr std::size_t kMost = 20;
  const std::size_t shown = std::min(names.size(), kMost);
  return fmt::format("no {} is named '{}', expected one of {}{}", thing, pattern,
                     fmt::join(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                     names.size() > shown ? fmt::format(" and {} more", names.size() - shown) : "");
}

std::vector<int> joints_of(const std::vector<std::string>& patterns, const std::vector<std::string>& names,
                           const std::string& where) {
  std::vector<int> joints;
  for (const std::string& pattern : patterns) {
    const std::vector<int> found = matching(pattern, names);
    if (found.empty()) throw assets::ConfigError(where + ": " + no_such_bone(pattern, names));
    joints.insert(joints.end(), found.begin(), found.end());
  }
  std::sort(joints.begin(), joints.end());
  joints.erase(std::unique(joints.begin(), joints.end()), joints.end());
  return joints;
}

std::vector<std::vector<int>> bones_of_materials(const Scene& scene, const std::string& rig_file,
                                                 const std::vector<std::string>& bone_names,
                                                 const std::vector<MergedJoint>& merged,
                                                 const std::function<void(const std::string&)>& say) {
  std::vector<std::string> merged_names;
  for (const MergedJoint& joint : merged) merged_names.push_back(joint.name);
  std::vector<std::vector<int>> bones;
  for (std::size_t m = 0; m < scene.materials.size(); ++m) {
    std::set<int> chosen;
    for (const std::string& pattern : scene.materials[m].bones) {
      const std::vector<int> found = matching(pattern, bone_names);
      chosen.insert(found.begin(), found.end());
      if (!found.empty()) continue;
      const std::vector<int> joints = matching(pattern, merged_names);
      if (joints.empty())
        throw assets::InputError(rig_file,
                                 fmt::format("material {}: {}", m + 1, no_such_bone(pattern, bone_names)));
      for (const int j : joints) {
        const MergedJoint& joint = merged[static_cast<std::size_t>(j)];
        chosen.insert(joint.bones.begin(), joint.bones.end());
        if (say)
          say(fmt::format(
              "material {}: the lattice has no bone for joint '{}'; the flesh of '{}' is meant, into "
              "which it was merged",
              m + 1, joint.name, joint.into));
      }
    }
    bones.emplace_back(chosen.begin(), chosen.end());
  }
  return bones;
}

}  // namespace sinew::tools
