#include "tools/commands/lattice_command.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/error.h"
#include "assets/lattice_cache.h"
#include "assets/lattice_files.h"
#include "assets/lattice_input.h"
#include "assets/lattice_picture.h"
#include "assets/rig.h"
#include "tools/commands/command.h"
#include "tools/commands/scene_flags.h"
#include "tools/scene/scene_fields.h"
#include "tools/session/body_fields.h"
#include "tools/session/character.h"
#include "tools/session/flesh_settings.h"
#include "tools/session/lattice_memory.h"
#include "tools/session/lattice_settings.h"
#include "tools/session/roles.h"
#include "tools/session/thin_limbs.h"
#include "tools/support/errors.h"
#include "tools/support/text.h"
#include "tools/terminal/caller.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Keys of a scene that this command knows.
constexpr std::string_view kKeys[] = {
    "output",         "overwrite",  "json",     "preview", "lattice",       "lattice_space",
    "snap_tolerance", "soft_bones", "cache",    "cells",   "cell_size",     "bones_include",
    "bones_exclude",  "tip_bones",  "symmetry", "grade",   "coarsen_rigid", "height"};

Json to_json(const Eigen::Vector3d& p) { return Json::array({p.x(), p.y(), p.z()}); }

std::string picture_name(const LatticeRequest& request) { return request.scene.output + ".png"; }

void check_request(const LatticeRequest& request) {
  const Scene& scene = request.scene;
  scene.validate();
  if (scene.plain)
    throw assets::ConfigError(
        scene.source.path +
        ": is a box without a rig, expected a rig; hint: sinew simulate writes the lattice");
  if (scene.rig.empty())
    throw assets::ConfigError(scene.source.path + ": rig is missing; hint: rig = \"character.glb\"");
  if (scene.output.empty())
    throw assets::ConfigError("--output: missing, expected a lattice file to write; hint: -o character.vtu");
  assets::lattice_format(scene.output, request.format);
  std::vector<std::string> files = assets::lattice_file_names(scene.output);
  if (scene.preview == Switch::On) files.push_back(picture_name(request));
  for (const std::string& file : files) {
    std::error_code ignored;
    if (!scene.overwrite && std::filesystem::exists(std::filesystem::symlink_status(file, ignored)))
      throw assets::BusyError(file + ": is there already; hint: give --overwrite or another name");
  }
}

/// One line for the failures of the gate, the worst first.
std::string gate_message(const std::string& rig, const lattice::BuildResult& result) {
  const auto& failures = result.failures;
  const auto worst =
      std::find_if(failures.begin(), failures.end(), [](const auto& f) { return !f.tolerable; });
  const lattice::GateFailure& shown = worst == failures.end() ? failures.front() : *worst;
  const std::string more = failures.size() > 1 ? fmt::format(" (and {} more)", failures.size() - 1) : "";
  return fmt::format(
      "{}: lattice: {}{}, after {} retries; hint: try another number of cells, for example --cells {}", rig,
      shown.what, more, result.lattice.retries, 2 * result.lattice.complex.cells.size());
}

void print_summary(const std::string& output, const Character& character, double seconds) {
  const lattice::BuildResult& result = character.lattice;
  const lattice::ControlLattice& lattice = result.lattice;
  const lattice::LatticeQuality& q = lattice.quality;
  int hard = 0, tips = 0, soft = 0;
  for (const lattice::LatticeBone& bone : lattice.bones) {
    ++(bone.soft ? soft : hard);
    tips += bone.tip;
  }
  fmt::print(stderr, "{}: {} cells, {} vertices, edges of about {:.3g} m, in {:.2f} s\n", output,
             lattice.complex.cells.size(), lattice.complex.points.rows(), lattice.edge_length, seconds);
  if (lattice.is_grid && !result.refused.empty()) {
    fmt::print(stderr, "  a plain grid of cubes with soft bones, as with bones on edges {}\n",
               result.refused.front().failures.front().what);
  }
  fmt::print(stderr, "  bones: {} on edges ({} of them tip bones), {} soft, {} soft frames\n", hard, tips,
             soft, lattice.soft_frames.size());
  fmt::print(
      stderr,
      "  quality: smallest dihedral angle {:.1f} degrees, smallest scaled Jacobian {:.3f}, volume {:.2f} of "
      "the skin's, {} component{}, {} retries\n",
      q.min_dihedral_degrees, q.min_scaled_jacobian, q.volume_ratio, q.components,
      q.components == 1 ? "" : "s", lattice.retries);
  if (!lattice.copies.empty()) {
    std::set<int> places;
    for (const lattice::CellCopy& copy : lattice.copies) places.insert(copy.place);
    fmt::print(stderr, "  limbs: {} places are shared and have a cell for each limb, {} in all\n",
               places.size(), lattice.copies.size());
  }
  const std::vector<std::string>& joints = character.input.joints.names;
  if (const auto thin = find_thin_limb(lattice, character.input.skin.surface, joints))
    fmt::print(stderr, "  size: {}; hint: {}\n", single_line(thin->message()), thin->remedy());
  if (result.mirror) {
    const Eigen::Vector3d& n = result.mirror->normal;
    fmt::print(stderr, "  symmetry: mirrored in a plane with the normal ({:.3g}, {:.3g}, {:.3g})\n", n.x(),
               n.y(), n.z());
  } else if (!result.no_mirror.empty()) {
    fmt::print(stderr, "  symmetry: none, as {}\n", single_line(result.no_mirror));
  }
  for (const lattice::SkeletonChange& change : lattice.changes)
    fmt::print(stderr, "  {}: {}: {}\n", single_line(change.joint), change.what, single_line(change.reason));
}

}  // namespace

std::string lattice_report(const lattice::BuildResult& result, const lattice::JointTree& joints) {
  const lattice::ControlLattice& lattice = result.lattice;
  Json json;
  json["vertices"] = Json::array();
  for (Eigen::Index v = 0; v < lattice.complex.points.rows(); ++v)
    json["vertices"].push_back(to_json(lattice.complex.points.row(v).transpose()));
  json["cells"] = Json::array();
  for (const lattice::Cell& cell : lattice.complex.cells)
    json["cells"].push_back(
        std::vector<int>(cell.vertices.begin(), cell.vertices.begin() + num_corners(cell.type)));
  json["edge_length"] = lattice.edge_length;
  json["grid"] = lattice.is_grid;
  json["bones"] = Json::array();
  json["tip_bones"] = Json::array();
  json["soft_bones"] = Json::array();
  for (const lattice::LatticeBone& bone : lattice.bones) {
    json["bones"].push_back({{"name", bone.name},
                             {"frame", joints.names[bone.frame]},
                             {"chain", bone.chain},
                             {"soft", bone.soft},
                             {"tip", bone.tip},
                             {"start", to_json(bone.rest_start)},
                             {"end", to_json(bone.rest_end)}});
    if (bone.tip) json["tip_bones"].push_back(bone.name);
    if (bone.soft) json["soft_bones"].push_back(bone.name);
  }
  json["soft_frames"] = Json::array();
  for (const lattice::SoftFrame& frame : lattice.soft_frames)
    json["soft_frames"].push_back(
        {{"frame", joints.names[frame.frame]}, {"position", to_json(frame.position)}});
  json["copies"] = Json::array();
  std::set<int> places;
  for (const lattice::CellCopy& copy : lattice.copies) {
    Json frames = Json::array();
    for (int frame : copy.frames) frames.push_back(joints.names[frame]);
    json["copies"].push_back({{"cell", copy.cell}, {"place", copy.place}, {"frames", frames}});
    places.insert(copy.place);
  }
  json["separation"] = {{"shared_places", places.size()}, {"cells_in_them", lattice.copies.size()}};
  json["symmetry"] = {{"mirrored", result.mirror.has_value()}, {"why_not", result.no_mirror}};
  if (result.mirror)
    json["symmetry"]["plane"] = {{"normal", to_json(result.mirror->normal)},
                                 {"offset", result.mirror->offset}};
  json["changes"] = Json::array();
  for (const lattice::SkeletonChange& change : lattice.changes)
    json["changes"].push_back({{"joint", change.joint}, {"what", change.what}, {"reason", change.reason}});
  const lattice::LatticeQuality& q = lattice.quality;
  json["quality"] = {{"min_dihedral_degrees", q.min_dihedral_degrees},
                     {"min_scaled_jacobian", q.min_scaled_jacobian},
                     {"min_volume", q.min_volume},
                     {"volume_ratio", q.volume_ratio},
                     {"skin_vertices_outside", q.skin_vertices_outside},
                     {"skin_triangles_outside", q.skin_triangles_outside},
                     {"exact_chains", q.exact_chains},
                     {"components", q.components},
                     {"components_without_bone", q.components_without_bone},
                     {"retries", lattice.retries}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

namespace {

void say(const std::string& line) { fmt::print(stderr, "{}\n", with_flags(single_line(line))); }

/// The user's lattice, or one that is built or found in the cache.
assets::CachedBuild make_lattice(const Scene& scene, const assets::Rig& rig,
                                 const assets::LatticeInput& input, const Caller& caller) {
  lattice::BuildOptions options = build_options(scene, input.joints.names, caller);
  hang_idle_sizes(input, say, options);
  assets::CachedBuild built;
  if (!scene.lattice.empty()) {
    built.result.lattice = assets::read_lattice(scene.lattice, input, read_options(scene, rig));
    for (const lattice::GateFailure& failure :
         lattice::check_gate(built.result.lattice, input.skin.surface, options))
      fmt::print(stderr, "warning: {}: {}\n", scene.lattice, failure.what);
    return built;
  }
  try {
    const std::string folder = scene.cache == Switch::Off ? "" : assets::cache_folder(scene.output);
    built = assets::build_lattice(folder, input.skin.surface, input.joints, options);
    if (built.use == assets::CacheUse::Hit)
      fmt::print(stderr, "lattice: nothing changed, taken from {}\n", single_line(folder));
    warn_of_idle_sizes(built.result, input.joints.names, say);
  } catch (const std::invalid_argument& error) {
    throw assets::InputError(scene.rig, error.what());
  }
  if (!built.result.failures.empty()) throw NumericalError(gate_message(scene.rig, built.result));
  return built;
}

/// The rig's clip where it has one that moves: how its joints turn decides on the regions.
int clip_of(const Scene& scene, const assets::Rig& rig) {
  try {
    return assets::choose_clip(rig, scene.clip);
  } catch (const assets::InputError&) {
    return -1;
  }
}

/// What a simulation would make of the lattice, to look at: fill, materials and weights of the regions.
assets::LatticeFields fields_to_see(const Scene& scene, Character& character) {
  const lattice::ControlLattice& lattice = character.lattice.lattice;
  settle_flesh(scene, character, say);
  if (lattice.complex.cells.size() > kMostPaintedCells) {
    fmt::print(stderr, "  the file holds no materials and regions, as there are more than {} cells\n",
               kMostPaintedCells);
    return assets::skin_fields(lattice, character.input.skin.surface);
  }
  try {
    assets::LatticeFields fields = body_fields(paint_body(character));
    const std::vector<std::int64_t> undivided(lattice.complex.cells.size(), 0);
    for (assets::VtuArray& field : fields.cells)
      if (field.name == "level") field.values = undivided;
    return fields;
  } catch (const assets::InputError& error) {
    fmt::print(stderr, "warning: no materials and regions in the file: {}\n", single_line(error.what()));
    return assets::skin_fields(lattice, character.input.skin.surface);
  }
}

/// The picture first: the lattice under its name means that all is done.
void write_outputs(const LatticeRequest& request, Character& character, const Caller& caller) {
  const Scene& scene = request.scene;
  const lattice::ControlLattice& lattice = character.lattice.lattice;
  const bool has_picture = scene.preview == Switch::On;
  const assets::Overwrite overwrite =
      scene.overwrite ? assets::Overwrite::Replace : assets::Overwrite::Refuse;
  const bool has_fields = std::filesystem::path(scene.output).extension().string().starts_with(".vt");
  const assets::LatticeFields fields = has_fields ? fields_to_see(scene, character) : assets::LatticeFields{};
  if (has_picture) {
    assets::LatticePictureOptions picture;
    picture.caption = fmt::format("{}: lattice of {} cells", std::filesystem::path(scene.rig).stem().string(),
                                  lattice.complex.cells.size());
    caller.stop_if_asked("before drawing the lattice");
    const assets::Image image = assets::render_lattice(lattice, character.input.skin.surface, picture);
    caller.stop_if_asked("before writing the lattice");
    assets::write_file(picture_name(request), assets::png_bytes(image), overwrite);
  }
  try {
    assets::write_lattice(scene.output, lattice, character.input.joints, overwrite, fields, request.format);
  } catch (...) {
    std::error_code ignored;
    if (has_picture) std::filesystem::remove(picture_name(request), ignored);
    throw;
  }
}

}  // namespace

void run_lattice(const LatticeRequest& request) {
  check_request(request);
  const Caller caller = terminal_caller();
  const Scene& scene = request.scene;
  const auto start = std::chrono::steady_clock::now();
  assets::LoadOptions load;
  load.height = scene.height.value_or(0.0);
  Character character;
  character.rig = assets::load_rig(scene.rig, load);
  character.clip = clip_of(scene, character.rig);
  settle_roles(scene, character.rig, caller.words());
  character.input = assets::lattice_input(character.rig);
  const lattice::JointTree& joints = character.input.joints;
  caller.stop_if_asked("before building the lattice");
  if (scene.lattice.empty()) check_lattice_memory(scene, character.input.skin.surface, say);
  assets::CachedBuild built = make_lattice(scene, character.rig, character.input, caller);
  character.lattice = std::move(built.result);
  caller.stop_if_asked("after building the lattice");
  write_outputs(request, character, caller);
  if (built.use == assets::CacheUse::Built)
    assets::keep_lattice(assets::cache_folder(scene.output), built.key, character.lattice, joints);
  if (scene.json) std::cout << lattice_report(character.lattice, joints);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  print_summary(scene.output, character, elapsed.count());
}

void add_lattice_command(CLI::App& app, CommandContext&) {
  auto request = std::make_shared<LatticeRequest>();
  auto flags = std::make_shared<SceneFlags>();
  CLI::App* command =
      app.add_subcommand("lattice", "Build, check or convert the control lattice of a rig and look at it.");
  auto file = std::make_shared<std::string>();
  command
      ->add_option("input", *file, "the character: glTF, FBX, Collada, ..., or a scene file (.toml) about it")
      ->type_name("SCENE.toml|RIG")
      ->required();
  flags->add_to(*command, kKeys);
  command->add_option(
      "--format", request->format,
      "vtk, vtk-binary, msh41, msh41-binary, msh22 or msh22-binary, where the extension of the "
      "output (.vtu, .vtk, .msh, .mesh, .node, .ele, .veg) leaves a choice");
  command->callback([request, flags, file] {
    if (is_scene_file(*file)) {
      request->scene = read_scene(*file);
      request->scene.output.clear();  // there it is the folder of a run
    } else {
      request->scene.rig = *file;
    }
    flags->apply(request->scene);
    run_lattice(*request);
  });
}

}  // namespace sinew::tools
