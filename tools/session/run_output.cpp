#include "tools/session/run_output.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/lattice_files.h"
#include "assets/output_mesh.h"
#include "tools/session/body_fields.h"
#include "tools/session/whole_skin.h"
#include "tools/support/errors.h"

namespace sinew::tools {

using lattice::Points;

namespace {

std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> posed_bones(
    const lattice::ControlLattice& lattice, const std::vector<Eigen::Affine3d>& pose) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bones;
  for (const auto& bone : lattice.bones) {
    bones.emplace_back(pose[static_cast<std::size_t>(bone.start.joint_a)] * bone.start.x_a,
                       pose[static_cast<std::size_t>(bone.end.joint_b)] * bone.end.x_b);
  }
  return bones;
}

}  // namespace

OutputLayout make_layout(const Scene& scene, const Character& character) {
  const assets::Rig& rig = character.rig;
  OutputLayout layout;
  if (scene.output_space == OutputSpace::File) layout.from_rig = rig.rig_from_file.inverse();
  layout.order = rig.file_vertex_order ? assets::VertexOrder::File : assets::VertexOrder::Importer;
  layout.rig_vertex.resize(static_cast<std::size_t>(assets::num_vertices(rig)));
  for (std::size_t i = 0; i < layout.rig_vertex.size(); ++i) layout.rig_vertex[i] = static_cast<int>(i);
  const Points rest = layout.apply(rest_points(rig));
  if (!scene.output_mesh.empty()) {
    assets::NamedMesh mesh = assets::read_surface(scene.output_mesh);
    layout.rig_vertex = assets::match_rest_positions(scene.output_mesh, mesh.points, rest,
                                                     assets::moving_together(rig, character.input.skin));
    mesh.points = layout.apply(rest_points(rig));
    layout.parts = {std::move(mesh)};
    layout.order = assets::VertexOrder::OutputMesh;
    return layout;
  }
  Eigen::Index next = 0;
  for (const assets::Part& part : rig.parts) {
    layout.parts.push_back({part.name, rest.middleRows(next, part.points.rows()), part.triangles});
    next += part.points.rows();
  }
  return layout;
}

CacheSink::CacheSink(const OutputLayout& layout, const Character& character, const std::string& file,
                     int first_frame)
    : layout_(layout),
      character_(character),
      writer_(assets::write_point_cache(file, static_cast<int>(layout.rig_vertex.size()), first_frame)) {}

void CacheSink::take(const Frame& frame) {
  try {
    writer_->write(layout_.apply(frame.positions));
  } catch (const std::domain_error& error) {
    throw NumericalError(fmt::format("{}: frame {} at {:.6g} s: {}", character_.rig.file, frame.report.frame,
                                     frame.report.time, error.what()));
  }
}

void CacheSink::finish() { writer_->finish(); }

PreviewSink::PreviewSink(const Character& character, int num_frames)
    : character_(character), shown_(assets::preview_frames(num_frames)) {}

void PreviewSink::take(const Frame& frame) {
  if (std::find(shown_.begin(), shown_.end(), taken_++) == shown_.end()) return;
  frames_.push_back({frame.report.frame, frame.report.time, frame.positions, frame.skinned,
                     posed_bones(character_.lattice.lattice, frame.pose)});
}

void PreviewSink::write(const std::string& file) const {
  assets::PreviewOptions picture;
  picture.caption =
      std::filesystem::path(character_.rig.file).stem().string() + ", " + character_.the_clip().name;
  picture.colours = assets::role_colours(character_.rig);
  assets::write_preview(file, all_triangles(character_.rig), frames_, picture);
}

void write_companions(const Scene& scene, const Character& character, const OutputLayout& layout,
                      const RunReport& report, const fem::Body& body, const FrameRange& frames,
                      const assets::OutputDirectory& out) {
  out.write(kRestFile, assets::obj_text(layout.parts));
  assets::Sidecar sidecar;
  sidecar.version = report.version;
  sidecar.rig_file = character.rig.file;
  sidecar.clip = character.the_clip().name;
  sidecar.rest_mesh = kRestFile;
  sidecar.cache = kCacheFile;
  sidecar.rest = assets::to_float(layout.apply(rest_points(character.rig)));
  for (const auto& part : layout.parts)
    sidecar.parts.push_back({part.name, static_cast<int>(part.points.rows())});
  sidecar.vertex_order = layout.order;
  sidecar.fps = scene.fps;
  sidecar.clip_start = character.the_clip().start;
  sidecar.first_frame = frames.first;
  sidecar.num_frames = frames.last - frames.first + 1;
  const bool si = scene.output_space == OutputSpace::Si;
  sidecar.metres_per_unit = si ? 1.0 : character.rig.metres_per_unit;
  sidecar.up_axis = si ? assets::UpAxis::Y : character.rig.up_axis;
  sidecar.settings_json = nlohmann::json{{"scene_toml", report.settings}}.dump();
  out.write(kSidecarFile, assets::sidecar_json(sidecar));
  out.write(kLatticeFile, assets::format_lattice(assets::LatticeFormat::Vtu, character.lattice.lattice,
                                                 character.input.joints, body_fields(body)));
  out.write(kReportFile, report_json(report, character, body));
}

}  // namespace sinew::tools
