#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "assets/point_cache.h"
#include "assets/rig.h"

/// The JSON file beside a point cache: what a reader needs to know before it trusts the cache.
namespace sinew::assets {

/// 64-bit FNV-1a over the bytes of the positions as they are stored (little-endian floats, x y z per vertex).
std::uint64_t rest_hash(const FloatPoints& rest);

/// Where the vertex order of the cache comes from.
enum class VertexOrder {
  File,        ///< the rig file's own.
  Importer,    ///< the third-party importer's: only the rest mesh written beside the cache fits.
  OutputMesh,  ///< that of the user's mesh.
};

/// A run of vertices of the cache.
struct SidecarPart {
  std::string name;
  int num_vertices = 0;
};

struct Sidecar {
  std::string version;    ///< of Sinew.
  std::string rig_file;   ///< as the user gave it.
  std::string clip;       ///< its name.
  std::string rest_mesh;  ///< file names beside the sidecar.
  std::string cache;
  FloatPoints rest;                ///< rest positions in the order and units of the cache.
  std::vector<SidecarPart> parts;  ///< in order; their vertices add up to rest's.
  VertexOrder vertex_order = VertexOrder::File;
  double fps = 0.0;         ///< frames per second.
  double clip_start = 0.0;  ///< time of frame 0 in the clip [s]; clips may start late.
  int first_frame = 0;
  int num_frames = 0;
  double metres_per_unit = 1.0;  ///< of the cache's coordinates.
  UpAxis up_axis = UpAxis::Y;    ///< of the cache's coordinates.
  std::string settings_json;     ///< an object; everything in force. Empty = none.
  /// Estimated error of the positions [m]; only where it was estimated.
  std::optional<double> error_estimate;
};

/// The text of the file. Throws std::invalid_argument where the counts do not fit or the settings are no JSON
/// object.
std::string sidecar_json(const Sidecar& sidecar);

}  // namespace sinew::assets
