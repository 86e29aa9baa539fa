#include "tools/session/run_report.h"

#include <algorithm>
#include <limits>

#include <nlohmann/json.hpp>

#include "tools/session/skin_json.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

Json frame_json(const FrameReport& f, int active, const assets::Rig& rig) {
  const fem::Measures& m = f.measures;
  Json json{{"frame", f.frame},
            {"time_s", f.time},
            {"steps", f.steps},
            {"active_functions", active},
            {"kinetic_J", m.kinetic},
            {"elastic_J", m.elastic},
            {"potential_J", m.potential},
            {"ties_J", m.ties},
            {"ghost_J", m.ghost},
            {"largest_speed_m_per_s", m.largest_speed},
            {"bone_residual_m", m.bone_residual},
            {"largest_strain", m.largest_strain},
            {"min_det_j", m.min_det},
            {"inverted_cells", m.inverted_cells},
            {"mended_area", f.mended.area},
            {"largest_mended_m", f.mended.largest}};
  if (f.skin) {
    json["flipped_triangles"] = f.skin->flipped;
    json["skin"] = detail::skin_json(*f.skin, rig);
  }
  return json;
}

Json finding_json(const SkinFinding& finding) {
  return {{"verdict", fem::name(finding.verdict)},
          {"worst_frame", finding.frame},
          {"worst_place", finding.place},
          {"torn_frames", finding.torn_frames},
          {"line", finding.line},
          {"volume_line", finding.volume_line}};
}

Json lattice_json(const lattice::ControlLattice& lattice) {
  Json bones = Json::array();
  for (const auto& bone : lattice.bones) {
    bones.push_back({{"name", bone.name}, {"soft", bone.soft}, {"tip", bone.tip}, {"chain", bone.chain}});
  }
  Json changes = Json::array();
  for (const auto& change : lattice.changes) {
    changes.push_back({{"joint", change.joint}, {"what", change.what}, {"reason", change.reason}});
  }
  return {{"cells", lattice.complex.cells.size()},
          {"vertices", lattice.complex.points.rows()},
          {"edge_length_m", lattice.edge_length},
          {"retries", lattice.retries},
          {"grid", lattice.is_grid},
          {"copies", lattice.copies.size()},
          {"bones", bones},
          {"changes", changes}};
}

}  // namespace

std::string report_json(const RunReport& report, const Character& character, const fem::Body& body) {
  Json json;
  json["sinew"] = report.version;
  json["rig"] = character.rig.file;
  json["clip"] = character.the_clip().name;
  json["settings_toml"] = report.settings;
  json["material"] = {{"young_Pa", character.body_options.material.young},
                      {"poisson", character.body_options.material.poisson},
                      {"density_kg_per_m3", character.body_options.material.density},
                      {"limb_thickness_m", character.limb_thickness}};
  json["height_m"] = character.rig.height;
  json["metres_per_unit"] = character.rig.metres_per_unit;
  json["lattice"] = lattice_json(character.lattice.lattice);
  double largest_unknowns = 0.0;
  for (int u : report.counts.unknowns) largest_unknowns = std::max(largest_unknowns, static_cast<double>(u));
  json["solver"] = {{"regions", report.counts.regions},
                    {"leaf_cells", body.mesh.cells.size()},
                    {"active_functions", report.counts.functions},
                    {"unknown_functions_per_region", report.counts.unknowns},
                    {"factor_nonzeros", report.counts.factor_nonzeros},
                    {"flesh_volume_m3", body.volume}};
  Json times = Json::object();
  for (const auto& [name, seconds] : report.times) times[name] = seconds;
  json["seconds"] = times;
  json["settle"] = {{"steps", report.settle_steps},
                    {"speed_left_m_per_s", report.settle_speed},
                    {"fastest", report.settle_joint},
                    {"settled", report.settled}};

  json["cuts"] = Json::array();
  for (const fem::Cut& cut : report.cuts)
    json["cuts"].push_back({{"from_s", cut.begin},
                            {"to_s", cut.end},
                            {"way_m", cut.way},
                            {"by", cut.stated ? "scene" : "clip"}});
  json["energy_cap"] = {{"steps", report.energy_taken.steps}, {"taken_J", report.energy_taken.energy}};

  double residual = 0.0, strain = 0.0, det = std::numeric_limits<double>::infinity();
  int inverted = 0, flipped = 0;
  Json frames = Json::array();
  for (const FrameReport& f : report.frames) {
    residual = std::max(residual, f.measures.bone_residual);
    strain = std::max(strain, f.measures.largest_strain);
    det = std::min(det, f.measures.min_det);
    inverted = std::max(inverted, f.measures.inverted_cells);
    if (f.skin) flipped = std::max(flipped, f.skin->flipped);
    frames.push_back(frame_json(f, report.counts.functions, character.rig));
  }
  json["worst"] = {{"bone_residual_m", residual},
                   {"largest_strain", strain},
                   {"min_det_j", det},
                   {"inverted_cells", inverted}};
  if (report.finding) {
    json["worst"]["flipped_triangles"] = flipped;
    json["skin"] = finding_json(*report.finding);
  }
  json["frames"] = frames;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace sinew::tools
