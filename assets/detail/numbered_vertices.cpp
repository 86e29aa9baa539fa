#include "assets/detail/numbered_vertices.h"

#include <fmt/format.h>

namespace sinew::assets::detail {

std::int64_t read_numbered_vertices(TextScanner& in, std::int64_t count, std::int64_t num_skipped,
                                    const std::string& section, VolumeMesh& mesh) {
  mesh.complex.points.resize(count, 3);
  std::int64_t first = 1;
  for (std::int64_t v = 0; v < count; ++v) {
    if (v == 0)
      first = in.integer(section + "number of the first vertex", 0, 1);
    else
      in.integer(section + "number of a vertex", first + v, first + v);
    for (int k = 0; k < 3; ++k)
      mesh.complex.points(v, k) = in.coordinate(fmt::format("{}vertex {}", section, first + v));
    for (std::int64_t k = 0; k < num_skipped; ++k) in.real("attribute");
    mesh.numbering.vertices.push_back(first + v);
  }
  return first;
}

}  // namespace sinew::assets::detail
