#include "tools/session/lattice_memory.h"

#include <algorithm>
#include <cmath>

#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "assets/error.h"
#include "lattice/build.h"
#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

/// Memory that this process may use [bytes]: the machine's, or less where a limit is set.
double available_bytes() {
  double bytes = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    bytes = std::min(bytes, static_cast<double>(limit.rlim_cur));
  return bytes;
}

/// Of building, checking, painting and writing a lattice. Measured peaks of `sinew lattice`: 71 MB at 3004
/// cells, 123 MB at 9922, 179 MB at 20268.
double estimated_bytes(double cells, double most) {
  constexpr double kPaintBase = 38e6, kPaintPerCell = 4000.0;
  const double building =
      static_cast<double>(lattice::estimated_build_bytes(static_cast<int>(std::min(cells, most))));
  const double painted = cells <= kMostPaintedCells ? kPaintBase + kPaintPerCell * cells : 0.0;
  return building * std::max(1.0, cells / most) + painted;
}

}  // namespace

double estimated_cells(const lattice::Surface& skin, double edge) {
  double volume = 0.0, area = 0.0;
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const auto corner = [&](int k) -> Eigen::Vector3d {
      return skin.points.row(skin.triangles(t, k)).transpose();
    };
    const Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    volume += corner(0).dot(normal) / 6.0;
    area += 0.5 * normal.norm();
  }
  // A cube of side 2 h / sqrt(3) has twelve cells.
  constexpr double kLayer = 0.6;
  const double per_volume = 12.0 / std::pow(2.0 * edge / std::sqrt(3.0), 3);
  return per_volume * (std::abs(volume) + kLayer * edge * area);
}

void check_lattice_memory(const Scene& scene, const lattice::Surface& skin, const Talk& talk) {
  constexpr double kWorthSaying = 10'000;
  const double cells = scene.cell_size ? estimated_cells(skin, *scene.cell_size) : scene.cells;
  const double most = find_scene_field("cells")->range.max;
  const double estimate = estimated_bytes(cells, most);
  const double available = available_bytes();
  const std::string asked =
      scene.cell_size
          ? fmt::format("--cell-size: got {}, which makes about {:.2g} cells and", *scene.cell_size, cells)
          : fmt::format("--cells: got {}, which", scene.cells);
  if (estimate > available)
    throw assets::LimitError(fmt::format(
        "{} takes about {:.2g} GB of memory, the limit is {:.2g} GB; hint: 1000 cells suffice for "
        "most characters",
        asked, 1e-9 * estimate, 1e-9 * available));
  if (cells > most)
    throw assets::LimitError(
        fmt::format("{} takes about {:.2g} GB of memory, the limit is {:.0f} cells; hint: "
                    "1000 cells suffice for most characters",
                    asked, 1e-9 * estimate, most));
  if (cells >= kWorthSaying)
    talk(fmt::format("about {:.2g} GB of memory for {:.0f} cells", 1e-9 * estimate, cells));
}

}  // namespace sinew::tools
