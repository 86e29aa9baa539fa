#include "assets/sidecar.h"

#include <bit>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace sinew::assets {
namespace {

using Json = nlohmann::ordered_json;

const char* axis_name(UpAxis axis) { return axis == UpAxis::X ? "X" : axis == UpAxis::Y ? "Y" : "Z"; }

Json vertex_order_json(VertexOrder order) {
  switch (order) {
    case VertexOrder::File:
      return {{"source", "file"}, {"note", "vertices are in the order of the rig file, part by part"}};
    case VertexOrder::Importer:
      return {{"source", "importer"},
              {"note",
               "the importer split and reordered the rig file's vertices: use the rest mesh beside this "
               "cache, or "
               "output_mesh for an order of your own"}};
    case VertexOrder::OutputMesh:
      return {{"source", "output-mesh"},
              {"note", "vertices are in the order of the mesh given as output_mesh"}};
  }
  throw std::invalid_argument("sidecar: unknown vertex order");
}

Json parts_json(const Sidecar& sidecar) {
  Json parts = Json::array();
  long long first = 0;
  for (const SidecarPart& part : sidecar.parts) {
    parts.push_back({{"name", part.name}, {"first_vertex", first}, {"vertex_count", part.num_vertices}});
    first += part.num_vertices;
  }
  if (first != sidecar.rest.rows())
    throw std::invalid_argument(
        fmt::format("sidecar: the parts have {} vertices, expected {}", first, sidecar.rest.rows()));
  return parts;
}

}  // namespace

std::uint64_t rest_hash(const FloatPoints& rest) {
  std::uint64_t hash = 14695981039346656037ull;  // offset basis and prime of FNV-1a, 64 bits
  for (Eigen::Index i = 0; i < rest.size(); ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(rest.data()[i]);
    for (int shift = 0; shift < 32; shift += 8) hash = (hash ^ ((bits >> shift) & 0xff)) * 1099511628211ull;
  }
  return hash;
}

std::string sidecar_json(const Sidecar& sidecar) {
  if (!(sidecar.fps > 0.0) || !std::isfinite(sidecar.fps) || sidecar.num_frames < 0)
    throw std::invalid_argument("sidecar: fps must be positive and the number of frames not negative");
  Json json = {{"format", "sinew-cache"},
               {"format_version", 1},
               {"generator", "sinew " + sidecar.version},
               {"rig", sidecar.rig_file},
               {"clip", sidecar.clip},
               {"clip_start_s", sidecar.clip_start},
               {"rest_mesh", sidecar.rest_mesh},
               {"cache", sidecar.cache},
               {"vertex_count", sidecar.rest.rows()},
               {"rest_hash",
                {{"algorithm", "FNV-1a 64 of little-endian float32 x y z"},
                 {"value", fmt::format("{:016x}", rest_hash(sidecar.rest))}}},
               {"vertex_order", vertex_order_json(sidecar.vertex_order)},
               {"parts", parts_json(sidecar)},
               {"fps", sidecar.fps},
               {"first_frame", sidecar.first_frame},
               {"frame_count", sidecar.num_frames},
               {"units", {{"metres_per_unit", sidecar.metres_per_unit}}},
               {"axes", {{"up", axis_name(sidecar.up_axis)}, {"handedness", "right"}}}};
  if (!sidecar.settings_json.empty()) {
    const Json settings = Json::parse(sidecar.settings_json, nullptr, false);
    if (!settings.is_object()) throw std::invalid_argument("sidecar: the settings are no JSON object");
    json["settings"] = settings;
  }
  if (sidecar.error_estimate) json["error_estimate"] = {{"value", *sidecar.error_estimate}, {"unit", "m"}};
  // File names need not be UTF-8: what is not becomes a replacement character instead of an exception.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace sinew::assets
