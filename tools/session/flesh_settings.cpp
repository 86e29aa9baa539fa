#include "tools/session/flesh_settings.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "assets/collapse.h"
#include "assets/error.h"
#include "fem/material/default_material.h"
#include "lattice/mirror_map.h"
#include "tools/support/suggest.h"

namespace sinew::tools {

std::vector<std::vector<Eigen::Affine3d>> sample_poses(const Character& c) {
  std::vector<std::vector<Eigen::Affine3d>> poses;
  if (c.clip < 0) {
    poses.emplace_back(static_cast<std::size_t>(c.rig.skeleton.num_joints()), Eigen::Affine3d::Identity());
    return poses;
  }
  const double duration = std::min(c.the_clip().duration(), 3600.0);  // an hour shows what a clip does
  // What is scaled to nothing tells nothing about how the flesh bends; the frames before and after it do.
  const double start = c.the_clip().start;
  const bool whole = !assets::first_collapse(c.rig, c.the_clip(), start, c.the_clip().end);
  const auto add = [&](double time) {
    if (whole || !assets::first_collapse(c.rig, c.the_clip(), time, time)) poses.push_back(c.pose(time));
  };
  for (int k = 0; k * kPoseSpacing < duration; ++k) add(start + k * kPoseSpacing);
  add(c.the_clip().end);
  if (poses.empty())
    poses.emplace_back(static_cast<std::size_t>(c.rig.skeleton.num_joints()), Eigen::Affine3d::Identity());
  return poses;
}

namespace {

fem::DefaultMaterials default_materials(const Scene& scene, const Character& c) {
  // The sag rule speaks of the gravity that the flesh is built for: the Earth's where the scene has none.
  constexpr double kEarth = 9.81;
  const std::vector<std::vector<Eigen::Affine3d>> poses = sample_poses(c);
  const lattice::Points& skin = c.input.skin.surface.points;
  fem::DefaultMaterialInput input{c.input.skin.surface, c.rig.skeleton, poses};
  input.spacing = kPoseSpacing;
  if (const auto mirror = lattice::find_mirror_map(c.lattice.lattice, c.input.skin.surface))
    input.partners = mirror->frames;
  input.size = (skin.colwise().maxCoeff() - skin.colwise().minCoeff()).maxCoeff();
  input.density = scene.density;
  input.poisson = scene.poisson;
  input.gravity = scene.gravity.norm() > 0.0 ? scene.gravity.norm() : kEarth;
  return fem::default_materials(input);
}

/// The material of a joint's flesh so far.
fem::Material material_of(const fem::BodyOptions& body, int joint) {
  fem::Material material = body.material;
  for (const fem::JointMaterial& of_joint : body.materials)
    if (of_joint.joint == joint) material = of_joint.material;  // the last one counts
  return material;
}

/// A pull must reach some flesh, and soft bones are held by nothing else.
void check_pull(const Character& c, const lattice::LatticeBone& bone, const BoneMaterial& material,
                const std::string& where) {
  const double least = fem::smallest_radius(bone, c.lattice.lattice.edge_length);
  if (material.radius && *material.radius < least) {
    throw assets::ConfigError(
        fmt::format("{}: radius: got {}, expected at least {:.3g} m, a quarter of the lattice's edge, at "
                    "bone '{}'; hint: more cells",
                    where, *material.radius, least, bone.name));
  }
  if (bone.soft && material.stiffness && !(*material.stiffness > 0.0)) {
    throw assets::ConfigError(fmt::format(
        "{}: stiffness: got 0, expected more as bone '{}' is soft and held by it alone", where, bone.name));
  }
}

/// The joints of one named region: every bone but the topmost hangs on another one of it.
void add_group(const Character& c, const std::vector<int>& bones, const std::string& where,
               std::vector<std::vector<int>>& groups) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  const fem::FrameTree tree = fem::frame_tree(lattice, c.rig.skeleton);
  std::set<int> frames;
  for (const int b : bones)
    frames.insert(
        tree.frame_of_joint[static_cast<std::size_t>(lattice.bones[static_cast<std::size_t>(b)].frame)]);
  std::vector<int> joints;
  for (const int f : frames) {
    const fem::Frame& frame = tree.frames[static_cast<std::size_t>(f)];
    joints.push_back(frame.joint);
    if (f != *frames.begin() && !frames.contains(frame.parent)) {
      throw assets::ConfigError(fmt::format(
          "{}: region: bone '{}' hangs on none of the others, expected bones that hang together; hint: "
          "regions of their own",
          where, frame.name));
    }
  }
  for (std::vector<int>& group : groups)
    std::erase_if(group,
                  [&](int joint) { return std::find(joints.begin(), joints.end(), joint) != joints.end(); });
  groups.push_back(joints);
}

/// Joints that own no bone, with the bones of the frame that their flesh follows.
std::vector<MergedJoint> merged_joints(const Character& c) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::map<int, std::vector<int>> bones_of_frame;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b)
    bones_of_frame[lattice.bones[b].frame].push_back(static_cast<int>(b));
  std::vector<MergedJoint> merged;
  for (std::size_t j = 0; j < lattice.frame_of_joint.size(); ++j) {
    const int frame = lattice.frame_of_joint[j];
    if (frame == static_cast<int>(j) || !bones_of_frame.contains(frame)) continue;
    merged.push_back({c.rig.skeleton.joint(static_cast<int>(j)).name, c.rig.skeleton.joint(frame).name,
                      bones_of_frame[frame]});
  }
  return merged;
}

/// What the scene says of single bones, one material after the other.
void paint_bones(const Scene& scene, const Talk& talk, Character& c) {
  fem::BodyOptions& body = c.body_options;
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::vector<std::string> names;
  for (const auto& bone : lattice.bones) names.push_back(bone.name);
  const std::vector<std::vector<int>> bones =
      bones_of_materials(scene, c.rig.file, names, merged_joints(c), talk);
  std::map<std::string, std::vector<int>> of_region;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const BoneMaterial& m = scene.materials[i];
    const std::string where = fmt::format("material {}", i + 1);
    for (const int b : bones[i]) {
      const lattice::LatticeBone& bone = lattice.bones[static_cast<std::size_t>(b)];
      check_pull(c, bone, m, where);
      const fem::RegionMaterial own{0, m.young, m.poisson, m.density};
      body.materials.push_back({bone.frame, own.applied_to(material_of(body, bone.frame))});
      if (!m.radius && !m.stiffness) continue;
      fem::JointTie tie;
      for (const fem::JointTie& earlier : body.ties.joints)
        if (earlier.joint == bone.frame) tie = earlier;
      tie.joint = bone.frame;
      if (m.radius) tie.radius = m.radius;
      if (m.stiffness) tie.stiffness = m.stiffness;
      body.ties.joints.push_back(tie);
    }
    if (m.region.empty()) continue;
    // Bones that several materials put into one region belong together.
    std::vector<int>& all = of_region[m.region];
    all.insert(all.end(), bones[i].begin(), bones[i].end());
    add_group(c, all, where, body.regions.groups);
  }
}

/// What the scene says of regions of the user's lattice.
void paint_regions(const Scene& scene, Character& c) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  std::map<std::string, int> numbers;
  for (const int region : lattice.regions) numbers[std::to_string(region)] = region;
  for (const lattice::RegionName& region : lattice.region_names) numbers[region.name] = region.number;
  std::vector<std::string> names;
  for (const auto& [name, number] : numbers) names.push_back(name);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const BoneMaterial& m = scene.materials[i];
    for (const std::string& region : m.regions) {
      const auto found = numbers.find(region);
      if (found == numbers.end()) {
        const std::string guess = nearest(region, names);
        throw assets::InputError(
            scene.lattice,
            fmt::format("material {}: no region is named '{}', expected one of {}{}", i + 1, region,
                        names.empty() ? "none, as the file has no regions"
                                      : fmt::format("{}", fmt::join(names, ", ")),
                        guess.empty() ? "" : fmt::format("; hint: did you mean {}?", guess)));
      }
      c.body_options.region_materials.push_back({found->second, m.young, m.poisson, m.density});
    }
  }
}

/// The scene's materials: E by the scene or by default, then what the scene says of single bones.
void settle_materials(const Scene& scene, const Talk& talk, Character& c) {
  fem::BodyOptions& body = c.body_options;
  if (!scene.plain) {
    const fem::DefaultMaterials defaults = default_materials(scene, c);
    c.limb_thickness = defaults.thickness;
    body.material = defaults.base;
    c.swing = defaults.frequency;
    // Of joints that the lattice made one the stiffest counts.
    std::map<int, double> of_frames;
    for (const fem::JointYoung& joint : defaults.of_joints) {
      const int merged = c.lattice.lattice.frame_of_joint[static_cast<std::size_t>(joint.joint)];
      double& young = of_frames[merged >= 0 ? merged : joint.joint];
      young = std::max(young, joint.young);
    }
    for (const auto& [joint, young] : of_frames)
      body.materials.push_back({joint, {young, body.material.poisson, body.material.density}});
  }
  if (scene.young) {
    body.material.young = *scene.young;
    body.materials.clear();
  }
  paint_bones(scene, talk, c);
  paint_regions(scene, c);
}

}  // namespace

void settle_flesh(const Scene& scene, Character& c, const Talk& talk) {
  fem::BodyOptions& body = c.body_options;
  body.levels = scene.levels;
  body.material.poisson = scene.poisson;
  body.material.density = scene.density;
  body.damping = {scene.damping, scene.damping_frequency};
  settle_materials(scene, talk, c);
}

}  // namespace sinew::tools
