#pragma once

#include <string>

#include "assets/detail/text_scanner.h"
#include "assets/volume_mesh.h"

namespace sinew::assets::detail {

/// Reads `count` vertices, each a number, three coordinates and `num_skipped` further numbers, into mesh.
/// Returns the first number, 0 or 1; the others follow it. `section` stands before what a failure names.
std::int64_t read_numbered_vertices(TextScanner& in, std::int64_t count, std::int64_t num_skipped,
                                    const std::string& section, VolumeMesh& mesh);

}  // namespace sinew::assets::detail
