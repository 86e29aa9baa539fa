#include "tools/session/pose.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/atomic_output.h"
#include "assets/error.h"
#include "assets/obj.h"
#include "assets/riding.h"
#include "assets/vtu.h"
#include "fem/report/cell_report.h"
#include "fem/time/equilibrium.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/character.h"
#include "tools/session/frame_guard.h"
#include "tools/session/plain_loads.h"
#include "tools/session/run_settings.h"
#include "tools/session/skin_json.h"
#include "tools/session/skin_report.h"
#include "tools/session/whole_skin.h"
#include "tools/support/errors.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
using lattice::Points;

/// Everything that a run may write into its folder.
const std::vector<std::string> kPoseOutputs{"pose.json", "pose.vtu", "skin.obj"};

/// rotation times stretch of an affine map's linear part.
struct Parts {
  Eigen::Vector3d translation;
  Eigen::Quaterniond rotation;
  Eigen::Matrix3d stretch;
};

Parts parts_of(const Eigen::Affine3d& map) {
  const Eigen::Matrix3d rotation = fem::polar_rotation(map.linear());
  return {map.translation(), Eigen::Quaterniond(rotation), rotation.transpose() * map.linear()};
}

/// From the rest pose to the wanted one: every joint turns against its parent by slerp, so that no bone is
/// squeezed on the way.
fem::PosePath path_to(const skeleton::Skeleton& skeleton, const skeleton::Pose& wanted) {
  std::vector<Parts> rest, posed;
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const int parent = skeleton.joint(j).parent;
    const auto local = [&](const Eigen::Affine3d& own, const Eigen::Affine3d& above) {
      return parts_of(parent < 0 ? own : Eigen::Affine3d(above.inverse() * own));
    };
    const auto p = static_cast<std::size_t>(std::max(parent, 0));
    rest.push_back(
        local(skeleton.joint(j).rest_from_joint, skeleton.joint(std::max(parent, 0)).rest_from_joint));
    posed.push_back(local(wanted.world_from_joint[static_cast<std::size_t>(j)], wanted.world_from_joint[p]));
  }
  return [&skeleton, rest, posed](double factor) {
    std::vector<Eigen::Affine3d> locals;
    for (std::size_t j = 0; j < rest.size(); ++j) {
      Eigen::Affine3d local = Eigen::Affine3d::Identity();
      local.linear() = rest[j].rotation.slerp(factor, posed[j].rotation).normalized().toRotationMatrix() *
                       ((1.0 - factor) * rest[j].stretch + factor * posed[j].stretch);
      local.translation() = (1.0 - factor) * rest[j].translation + factor * posed[j].translation;
      locals.push_back(local);
    }
    return skeleton::pose_from_rest(skeleton, skeleton::pose_from_local(skeleton, locals));
  };
}

/// The leaf cells at rest with what the pose does to them.
std::string pose_vtu(const fem::Body& body, const Points& x, const std::vector<fem::CellReport>& cells) {
  assets::VtuGrid grid;
  grid.points = body.mesh.points;
  for (const lattice::HexVertices& hex : body.mesh.cells) {
    lattice::Cell cell;
    cell.type = lattice::CellType::Hexahedron;
    std::copy(hex.begin(), hex.end(), cell.vertices.begin());
    grid.cells.push_back(cell);
  }
  const Points displacement = x - body.mesh.points;
  grid.point_arrays.push_back(
      {"displacement", 3,
       std::vector<double>(displacement.data(), displacement.data() + displacement.size())});
  std::vector<double> strain, stress, von_mises, energy;
  for (const fem::CellReport& cell : cells) {
    strain.insert(strain.end(), cell.strain.data(), cell.strain.data() + 9);  // symmetric: either order
    stress.insert(stress.end(), cell.stress.data(), cell.stress.data() + 9);
    von_mises.push_back(cell.von_mises);
    energy.push_back(cell.energy);
  }
  grid.cell_arrays = {
      {"strain", 9, strain}, {"stress", 9, stress}, {"von_mises", 1, von_mises}, {"energy", 1, energy}};
  return assets::format_vtu(grid);
}

/// The whole skin: the flesh where it is, mended, and props on it; everything else as `skinned` has it.
Points whole_skin(const Scene& scene, const Character& c, const fem::Body& body, const Points& x,
                  const std::vector<Eigen::Affine3d>& pose, const Points& skinned) {
  Points all = with_flesh(c.input.skin, skinned, body.skin_rows * x);
  FrameGuard(scene, c).mend(skinned, all);
  assets::PropMotion(c.rig).place(pose, skinned, all);
  return all;
}

std::string skin_obj(const Scene& scene, const Character& c, Points all) {
  if (scene.output_space == OutputSpace::File) {
    const Eigen::Affine3d file_from_rig = c.rig.rig_from_file.inverse();
    for (Eigen::Index i = 0; i < all.rows(); ++i)
      all.row(i) = (file_from_rig * all.row(i).transpose()).transpose();
  }
  std::vector<assets::NamedMesh> parts;
  Eigen::Index next = 0;
  for (const assets::Part& part : c.rig.parts) {
    parts.push_back({part.name, all.middleRows(next, part.points.rows()), part.triangles});
    next += part.points.rows();
  }
  return assets::obj_text(parts);
}

/// The skin of a pose against plain skinning.
struct PosedSkin {
  fem::SkinFrame measures;
  SkinFinding finding;
};

std::optional<PosedSkin> judge_skin(const Scene& scene, const Character& c, const fem::Body& body,
                                    const Points& flesh, const Points& skinned, double time) {
  if (scene.plain) return std::nullopt;
  auto judge = make_skin_judge(c, {time});
  if (!judge) return std::nullopt;
  PosedSkin skin;
  skin.measures = judge->measure(flesh, skinned, fem::FrameKind::First);
  skin.finding = find_fault(scene, c, body, skin.measures, time);
  return skin;
}

std::string pose_json(const Scene& scene, double time, const assets::Rig& rig, const fem::Body& body,
                      const fem::Equilibrium& found, const std::vector<fem::CellReport>& cells,
                      const std::optional<PosedSkin>& skin) {
  Eigen::Index farthest = 0;
  const double moved = (found.x - body.mesh.points).rowwise().norm().maxCoeff(&farthest);
  double energy = 0.0;
  std::size_t worst = 0;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    energy += cells[c].energy;
    if (cells[c].von_mises > cells[worst].von_mises) worst = c;
  }
  Json json{{"sinew", SINEW_VERSION},
            {"model", scene.model},
            {"time_s", time},
            {"load_factor", found.load_factor},
            {"load_steps", found.load_steps},
            {"iterations", found.report.iterations},
            {"residual", found.report.residual},
            {"leaf_cells", cells.size()},
            {"largest_displacement_m", moved},
            {"largest_displacement_vertex", farthest},
            {"elastic_J", energy},
            {"largest_von_mises_Pa", cells[worst].von_mises},
            {"largest_von_mises_cell", worst},
            {"settings_toml", print_scene(scene)}};
  if (skin) {
    json["skin"] = detail::skin_json(skin->measures, rig);
    json["skin"]["verdict"] = fem::name(skin->finding.verdict);
    json["skin"]["line"] = skin->finding.line;
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

double pose_time(const PoseRequest& request, const Scene& scene, const skeleton::Clip& clip) {
  return request.time.value_or(clip.start + (scene.frames ? scene.frames->first : 0) / scene.fps);
}

}  // namespace

std::string pose(const PoseRequest& request, const Scene& scene, const Caller& caller) {
  const Talk talk = caller.words();
  if (scene.plain && !scene.plain->is_held())
    throw assets::ConfigError(
        scene.source.path +
        ": bone: none and no fixed side, expected something that holds the flesh at rest; hint: [[fixed]] "
        "face = \"x-min\"");
  if (scene.plain && scene.plain->velocity) talk("warning: a pose is at rest: the velocity does nothing");
  for (const std::string& warning : outside_envelope(scene)) talk("warning: " + warning);
  assets::OutputDirectory out(
      scene.output, scene.overwrite ? assets::Overwrite::Replace : assets::Overwrite::Refuse, kPoseOutputs);
  const Character character = make_character(scene, caller);
  const skeleton::Clip& clip = character.the_clip();
  const double time = pose_time(request, scene, clip);
  if (clip.num_keys > 0 && std::abs(time - std::clamp(time, clip.start, clip.end)) > 1e-9)
    talk(fmt::format(
        "warning: --time: {:g} s is outside of the clip, {:g} to {:g} s; the pose at its {} is taken", time,
        clip.start, clip.end, time < clip.start ? "start" : "end"));
  const fem::Body body = make_body(character);
  caller.stop_if_asked("before the equilibrium");
  fem::EquilibriumOptions options;
  options.model = scene.model;
  options.gravity = scene.gravity;
  options.steps = request.load_steps;
  options.solver = simulation_options(scene).solver;
  if (scene.plain) options.loads = loads_of(*scene.plain);
  const skeleton::Skeleton& skeleton = character.rig.skeleton;
  const skeleton::Pose wanted = skeleton::sample(skeleton, character.the_clip(), time);
  constexpr int kParts = 1000;
  options.before_step = [&](double factor) {
    caller.stop_if_asked(fmt::format("at load factor {:.3g}", factor));
    caller.report("posing", static_cast<int>(kParts * factor), kParts);
  };
  const fem::Equilibrium found = fem::find_equilibrium(body, path_to(skeleton, wanted), options);
  caller.report("posing", kParts, kParts);
  if (!found.report.ok())
    throw NumericalError(fmt::format("{}: {}", character.rig.file, found.report.message));
  const std::unique_ptr<fem::Model> model = fem::find_model(scene.model)->make(body, options.solver);
  const std::vector<fem::CellReport> cells = fem::report_cells(body, *model, found.x, found.pose);
  const Points skinned = assets::skin(character.rig, found.pose.joints);
  const Points flesh = whole_skin(scene, character, body, found.x, found.pose.joints, skinned);
  const std::optional<PosedSkin> skin = judge_skin(scene, character, body, flesh, skinned, time);
  if (skin && scene.strict) refuse_torn(skin->finding);
  const std::string json = pose_json(scene, time, character.rig, body, found, cells, skin);
  out.write("pose.vtu", pose_vtu(body, found.x, cells));
  out.write("skin.obj", skin_obj(scene, character, flesh));
  out.write("pose.json", json);
  caller.stop_if_asked("before the results were in place");
  out.commit();
  talk(fmt::format("{} in {} load steps; wrote {}/pose.vtu, {}/skin.obj and {}/pose.json", scene.model,
                   found.load_steps, scene.output, scene.output, scene.output));
  if (skin) tell(skin->finding, talk);
  return json;
}

}  // namespace sinew::tools
