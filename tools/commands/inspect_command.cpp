#include "tools/commands/inspect_command.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <iostream>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/error.h"
#include "assets/islands.h"
#include "assets/lattice_input.h"
#include "lattice/build.h"
#include "tools/commands/command.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/roles.h"
#include "tools/session/thin_limbs.h"
#include "tools/support/text.h"
#include "tools/terminal/exit_code.h"

namespace sinew::tools {
namespace {

using assets::Finding;
using assets::Part;
using assets::PartRole;
using nlohmann::ordered_json;

const char* word(PartRole role) {
  switch (role) {
    case PartRole::Simulated:
      return "simulated";
    case PartRole::Skinned:
      return "skinned";
    case PartRole::Riding:
      return "riding";
    default:
      return "rigid";
  }
}

const char* word(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::Error:
      return "error";
    case Finding::Severity::Warning:
      return "warning";
    default:
      return "info";
  }
}

char word(assets::UpAxis axis) { return "XYZ"[static_cast<int>(axis)]; }

void weigh_joints(Inspection& result) {
  double total = 0.0;
  for (const Part& part : result.rig.parts) {
    if (part.role != PartRole::Simulated) continue;
    for (const auto& influences : part.weights) {
      for (const lattice::Influence& influence : influences) {
        result.joints[static_cast<std::size_t>(influence.frame)].weight_share += influence.weight;
        total += influence.weight;
      }
    }
  }
  if (total <= 0.0) return;
  for (JointUse& use : result.joints) use.weight_share /= total;
}

void find_bones(Inspection& result) {
  assets::set_roles(result.rig, assets::find_islands(result.rig));
  const assets::LatticeInput input = assets::lattice_input(result.rig);
  lattice::BuildResult built;
  try {
    built = lattice::build(input.skin.surface, input.joints);
  } catch (const std::invalid_argument& e) {
    result.rig.findings.push_back({Finding::Severity::Error, "no-lattice", "", e.what(),
                                   "check that the mesh has a volume and is bound to its skeleton"});
    return;
  }
  if (const auto thin = find_thin_limb(built.lattice, input.skin.surface, input.joints.names))
    result.rig.findings.push_back(
        {Finding::Severity::Info, "thin-limbs", thin->joint, thin->message(), thin->remedy()});
  result.bones = std::move(built.lattice.bones);
  result.changes = std::move(built.lattice.changes);
  for (const lattice::LatticeBone& bone : result.bones) {
    if (bone.frame >= 0) result.joints[static_cast<std::size_t>(bone.frame)].bones.push_back(bone.name);
  }
  for (const lattice::SoftFrame& frame : built.lattice.soft_frames) {
    if (frame.frame >= 0) result.joints[static_cast<std::size_t>(frame.frame)].bones.push_back("soft frame");
  }
}

void find_reasons(Inspection& result) {
  for (std::size_t j = 0; j < result.joints.size(); ++j) {
    JointUse& use = result.joints[j];
    if (!use.bones.empty()) continue;
    const std::string& name = result.rig.skeleton.joint(static_cast<int>(j)).name;
    const auto change = std::find_if(result.changes.begin(), result.changes.end(),
                                     [&](const lattice::SkeletonChange& c) { return c.joint == name; });
    if (change != result.changes.end()) {
      use.reason = change->what + ": " + change->reason;
    } else if (use.weight_share <= 0.0) {
      use.reason = "no skin weight hangs on it";
    } else {
      use.reason = "no bone starts here; its skin follows the nearest joint that has one";
    }
  }
}

std::string joint_tree(const Inspection& inspection) {
  const skeleton::Skeleton& skeleton = inspection.rig.skeleton;
  std::vector<int> depth(inspection.joints.size(), 0);
  std::vector<std::string> labels;
  std::size_t width = 0;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const skeleton::Joint& joint = skeleton.joint(j);
    int& d = depth[static_cast<std::size_t>(j)];
    d = joint.parent < 0 ? 0 : depth[static_cast<std::size_t>(joint.parent)] + 1;
    // Deep chains would run off the page; beyond this the level is not drawn any more.
    labels.push_back(std::string(static_cast<std::size_t>(2 * std::min(d, 20)), ' ') + joint.name);
    width = std::max(width, labels.back().size());
  }
  width = std::min<std::size_t>(width, 60);
  std::string text;
  for (std::size_t j = 0; j < labels.size(); ++j) {
    const JointUse& use = inspection.joints[j];
    const std::string share =
        use.weight_share > 0.0 ? fmt::format("{:5.1f} %", 100.0 * use.weight_share) : "      -";
    text += fmt::format(
        "  {:<{}}  {}  {}\n", labels[j], width, share,
        use.bones.empty() ? "no bone: " + use.reason : fmt::format("{}", fmt::join(use.bones, ", ")));
  }
  return text;
}

ordered_json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json parts_json(const Inspection& inspection) {
  ordered_json list = ordered_json::array();
  for (const Part& part : inspection.rig.parts) {
    ordered_json item{{"name", part.name},
                      {"role", word(part.role)},
                      {"vertices", part.points.rows()},
                      {"triangles", part.triangles.rows()}};
    item["follows"] =
        part.joint < 0 ? ordered_json() : ordered_json(inspection.rig.skeleton.joint(part.joint).name);
    list.push_back(std::move(item));
  }
  return list;
}

ordered_json props_json(const assets::Rig& rig) {
  ordered_json list = ordered_json::array();
  for (const assets::Prop& prop : rig.props) {
    ordered_json item{{"name", prop.name},
                      {"role", word(prop.role)},
                      {"vertices", prop.vertices.size()},
                      {"reason", prop.reason}};
    item["joint"] = prop.joint < 0 ? ordered_json() : ordered_json(rig.skeleton.joint(prop.joint).name);
    list.push_back(std::move(item));
  }
  return list;
}

ordered_json joints_json(const Inspection& inspection) {
  ordered_json list = ordered_json::array();
  for (std::size_t j = 0; j < inspection.joints.size(); ++j) {
    const skeleton::Joint& joint = inspection.rig.skeleton.joint(static_cast<int>(j));
    const JointUse& use = inspection.joints[j];
    ordered_json item{{"name", joint.name}};
    item["parent"] =
        joint.parent < 0 ? ordered_json() : ordered_json(inspection.rig.skeleton.joint(joint.parent).name);
    item["rest_position_m"] = vector_json(joint.rest_from_joint.translation());
    item["weight_share"] = use.weight_share;
    item["bones"] = use.bones;
    item["reason_for_no_bone"] = use.bones.empty() ? ordered_json(use.reason) : ordered_json();
    list.push_back(std::move(item));
  }
  return list;
}

ordered_json bones_json(const Inspection& inspection) {
  ordered_json list = ordered_json::array();
  for (const lattice::LatticeBone& bone : inspection.bones) {
    list.push_back({{"name", bone.name},
                    {"joint", inspection.rig.skeleton.joint(bone.frame).name},
                    {"start_m", vector_json(bone.rest_start)},
                    {"end_m", vector_json(bone.rest_end)},
                    {"soft", bone.soft},
                    {"tip", bone.tip}});
  }
  return list;
}

ordered_json clips_json(const Inspection& inspection) {
  ordered_json list = ordered_json::array();
  for (std::size_t c = 0; c < inspection.rig.clips.size(); ++c) {
    const skeleton::Clip& clip = inspection.rig.clips[c];
    list.push_back({{"name", clip.name},
                    {"start_s", clip.start},
                    {"end_s", clip.end},
                    {"duration_s", clip.duration()},
                    {"keys", clip.num_keys},
                    {"channels", clip.channels.size()},
                    {"taken", static_cast<int>(c) == inspection.clip}});
  }
  return list;
}

std::string counted(std::size_t count, const std::string& thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

std::string parts_text(const assets::Rig& rig) {
  std::size_t width = 4;
  for (const Part& part : rig.parts) width = std::max(width, std::min<std::size_t>(part.name.size(), 40));
  std::string text = fmt::format("\nParts\n  {:<{}}  {:<9}  {:>8}  {:>9}  moves with\n", "name", width,
                                 "role", "vertices", "triangles");
  for (const Part& part : rig.parts) {
    const std::string follows = part.role == PartRole::Simulated ? "its flesh"
                                : part.role == PartRole::Skinned ? "plain skinning"
                                : part.joint < 0                 ? "nothing: it stands still"
                                                 : "joint '" + rig.skeleton.joint(part.joint).name + "'";
    text += fmt::format("  {:<{}}  {:<9}  {:>8}  {:>9}  {}\n", part.name, width, word(part.role),
                        part.points.rows(), part.triangles.rows(), follows);
  }
  return text;
}

std::string props_text(const assets::Rig& rig) {
  std::string text = "\nProps: pieces that keep their shape ([[part]] name, role in a scene changes it)\n";
  for (const assets::Prop& prop : rig.props) text += "  " + prop_line(rig, prop) + "\n";
  return text;
}

std::string clips_text(const Inspection& inspection) {
  const assets::Rig& rig = inspection.rig;
  std::size_t width = 4;
  for (const skeleton::Clip& clip : rig.clips)
    width = std::max(width, std::min<std::size_t>(clip.name.size(), 40));
  std::string text = "\nClips (* is taken when none is named)\n";
  for (std::size_t c = 0; c < rig.clips.size(); ++c) {
    const skeleton::Clip& clip = rig.clips[c];
    text += fmt::format("{} {:<{}}  {:7.3f} s, from {:.3f} to {:.3f} s, {} keys\n",
                        static_cast<int>(c) == inspection.clip ? " *" : "  ", clip.name, width,
                        clip.duration(), clip.start, clip.end, clip.num_keys);
  }
  return text;
}

std::string bones_text(const Inspection& inspection) {
  const auto count = [&](auto&& test) {
    return std::count_if(inspection.bones.begin(), inspection.bones.end(), test);
  };
  const auto soft = count([](const lattice::LatticeBone& bone) { return bone.soft; });
  const auto tips = count([](const lattice::LatticeBone& bone) { return bone.tip; });
  std::string text =
      fmt::format("\nBones of a lattice of default size: {}, of them {} soft and {} tip bones\n",
                  inspection.bones.size(), soft, tips);
  for (const lattice::SkeletonChange& change : inspection.changes) {
    const int joint = inspection.rig.skeleton.find(change.joint);
    // Joints without a bone stand above with their reason.
    if (joint >= 0 && inspection.joints[static_cast<std::size_t>(joint)].bones.empty()) continue;
    text += fmt::format("  '{}' {}: {}\n", change.joint, change.what, change.reason);
  }
  return text;
}

std::string findings_text(const assets::Rig& rig) {
  std::string text = "\nFindings\n";
  for (const Finding& finding : rig.findings) {
    text +=
        fmt::format("  {:<7}  {}{}: {}\n", word(finding.severity), finding.code,
                    finding.where.empty() ? "" : " ('" + finding.where + "')", with_flags(finding.message));
    if (!finding.remedy.empty()) text += fmt::format("           -> {}\n", with_flags(finding.remedy));
  }
  if (rig.findings.empty()) text += "  none\n";
  return text;
}

/// The first reason why a file cannot be simulated, as the one line that an error gets.
std::string refusal(const assets::Rig& rig) {
  for (const Finding& finding : rig.findings) {
    if (finding.severity != Finding::Severity::Error) continue;
    return fmt::format("{}: {}: {}; hint: {}", rig.file, finding.code, finding.message, finding.remedy);
  }
  return "";
}

}  // namespace

Inspection inspect(const std::string& file, const assets::LoadOptions& options) {
  Inspection result;
  result.rig = assets::load_rig(file, options);
  result.joints.resize(static_cast<std::size_t>(result.rig.skeleton.num_joints()));
  weigh_joints(result);
  const bool has_flesh = std::any_of(result.rig.parts.begin(), result.rig.parts.end(),
                                     [](const Part& part) { return part.role == PartRole::Simulated; });
  const bool is_flat = std::any_of(result.rig.findings.begin(), result.rig.findings.end(),
                                   [](const Finding& finding) { return finding.code == "flat-skin"; });
  if (has_flesh && !is_flat) find_bones(result);
  find_reasons(result);
  try {
    result.clip = assets::choose_clip(result.rig, "");
  } catch (const assets::InputError&) {
    result.clip = -1;  // the findings hold it already
  }
  result.usable =
      std::none_of(result.rig.findings.begin(), result.rig.findings.end(),
                   [](const Finding& finding) { return finding.severity == Finding::Severity::Error; });
  return result;
}

std::string inspection_text(const Inspection& inspection) {
  const assets::Rig& rig = inspection.rig;
  Eigen::Index num_triangles = 0;
  for (const Part& part : rig.parts) num_triangles += part.triangles.rows();
  const auto weighted = std::count_if(inspection.joints.begin(), inspection.joints.end(),
                                      [](const JointUse& use) { return use.weight_share > 0.0; });
  std::string text = fmt::format("{} ({})\n", single_line(rig.file), rig.format);
  text += fmt::format("  height    {:.3f} m (1 unit of the file = {:.6g} m), up axis {}\n", rig.height,
                      rig.metres_per_unit, word(rig.up_axis));
  text += fmt::format("  mesh      {}, {} vertices in {} order, {} triangles\n",
                      counted(rig.parts.size(), "part"), assets::num_vertices(rig),
                      rig.file_vertex_order ? "the file's" : "the importer's", num_triangles);
  text += fmt::format("  skeleton  {}, {} with skin weight\n", counted(inspection.joints.size(), "joint"),
                      weighted);
  text += inspection.clip < 0
              ? std::string("  motion    none\n")
              : fmt::format("  motion    {}; '{}' is taken\n", counted(rig.clips.size(), "clip"),
                            rig.clips[static_cast<std::size_t>(inspection.clip)].name);
  if (!rig.parts.empty()) text += parts_text(rig);
  if (!rig.props.empty()) text += props_text(rig);
  if (!inspection.joints.empty()) {
    text += "\nJoints (share of the skin's weight, bones of the lattice)\n" + joint_tree(inspection);
  }
  if (!inspection.bones.empty()) text += bones_text(inspection);
  if (!rig.clips.empty()) text += clips_text(inspection);
  text += findings_text(rig);
  text += fmt::format("\nCan be simulated: {}\n", inspection.usable ? "yes" : "no");
  return text;
}

std::string inspection_json(const Inspection& inspection) {
  const assets::Rig& rig = inspection.rig;
  ordered_json changes = ordered_json::array(), findings = ordered_json::array();
  for (const lattice::SkeletonChange& change : inspection.changes) {
    changes.push_back({{"joint", change.joint}, {"what", change.what}, {"reason", change.reason}});
  }
  for (const Finding& finding : rig.findings) {
    findings.push_back({{"severity", word(finding.severity)},
                        {"code", finding.code},
                        {"where", finding.where},
                        {"message", with_flags(finding.message)},
                        {"remedy", with_flags(finding.remedy)}});
  }
  ordered_json document{{"file", single_line(rig.file)},
                        {"format", rig.format},
                        {"usable", inspection.usable},
                        {"height_m", rig.height},
                        {"metres_per_unit", rig.metres_per_unit},
                        {"up_axis", std::string(1, word(rig.up_axis))},
                        {"vertex_order", rig.file_vertex_order ? "file" : "importer"},
                        {"vertices", assets::num_vertices(rig)}};
  document["parts"] = parts_json(inspection);
  document["props"] = props_json(rig);
  document["joints"] = joints_json(inspection);
  document["bones"] = bones_json(inspection);
  document["skeleton_changes"] = std::move(changes);
  document["clips"] = clips_json(inspection);
  document["clip_taken"] = inspection.clip < 0
                               ? ordered_json()
                               : ordered_json(rig.clips[static_cast<std::size_t>(inspection.clip)].name);
  document["findings"] = std::move(findings);
  // Names may hold bytes that are no UTF-8 only if printable() let them through, which it does not.
  return document.dump(2) + "\n";
}

void add_inspect_command(CLI::App& app, CommandContext& context) {
  struct Arguments {
    std::string file;
    double height = 0.0;
    bool json = false;
  };
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("inspect", "Say what a rig holds, and whether it can be simulated");
  command->add_option("FILE", arguments->file, "A rig: glTF, FBX, Collada, BVH, ...")->required();
  command->add_option("--height", arguments->height,
                      "Height of the character [m]; default: guessed from the units");
  command->add_flag("--json", arguments->json, "Print one JSON object instead of text");
  command->footer("Exit code 0: sinew simulate can use the file; 3: it cannot, and the last line says why.");
  command->callback([command, arguments, &context] {
    if (command->count("--height") > 0 && !(arguments->height > 0.0)) {
      throw assets::ConfigError(
          fmt::format("--height: got {}, expected a length in metres > 0", arguments->height));
    }
    assets::LoadOptions options;
    options.height = arguments->height;
    const Inspection inspection = inspect(arguments->file, options);
    std::cout << (arguments->json ? inspection_json(inspection) : inspection_text(inspection));
    if (inspection.usable) return;
    std::cout.flush();
    std::fprintf(stderr, "sinew: %s\n", single_line(with_flags(refusal(inspection.rig))).c_str());
    context.exit_code = exit_code::kInput;
  });
}

}  // namespace sinew::tools
