#include "tools/session/skin_json.h"

#include "tools/session/whole_skin.h"

namespace sinew::tools::detail {

nlohmann::ordered_json skin_json(const fem::SkinFrame& frame, const assets::Rig& rig) {
  nlohmann::ordered_json json{{"torn_area", frame.torn_area},
                              {"flipped_triangles", frame.flipped},
                              {"stretched_triangles", frame.stretched},
                              {"squeezed_triangles", frame.squeezed},
                              {"folded_edges", frame.folds},
                              {"creases_heights", frame.creases},
                              {"roughness_edges", frame.roughness},
                              {"volume_ratio", frame.volume_ratio},
                              {"volume_of_rest", frame.volume_of_rest},
                              {"away_p95_heights", frame.away_95},
                              {"away_p99_heights", frame.away_99},
                              {"away_largest_heights", frame.away_most}};
  if (frame.worst_vertex >= 0) json["worst_place"] = place_of(rig, frame.worst_vertex);
  if (frame.farthest_vertex >= 0) json["away_largest_place"] = place_of(rig, frame.farthest_vertex);
  return json;
}

}  // namespace sinew::tools::detail
