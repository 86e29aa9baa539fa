#include "lattice/limb_thickness.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/segments.h"
#include "lattice/limb_copies.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

constexpr double kInsideSlack = 1e-9;  ///< rounding of the containment test, a share of the cell.
constexpr double kSmallShare = 0.01, kSmallShareOfMean = 0.3;

/// A third of the area of the triangles round each vertex [m^2].
std::vector<double> vertex_areas(const Surface& skin) {
  std::vector<double> areas(static_cast<std::size_t>(skin.points.rows()), 0.0);
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const auto point = [&](int k) -> Vector3d { return skin.points.row(skin.triangles(t, k)).transpose(); };
    const double third = (point(1) - point(0)).cross(point(2) - point(0)).norm() / 6.0;
    for (int k = 0; k < 3; ++k) areas[static_cast<std::size_t>(skin.triangles(t, k))] += third;
  }
  return areas;
}

double mean_edge(const CellComplex& complex, const Cell& cell) {
  double sum = 0.0;
  const std::span<const std::array<int, 2>> edges = cell_edges(cell.type);
  for (const auto& [a, b] : edges)
    sum += (complex.points.row(cell.vertices[static_cast<std::size_t>(a)]) -
            complex.points.row(cell.vertices[static_cast<std::size_t>(b)]))
               .norm();
  return sum / static_cast<double>(edges.size());
}

struct Limb {
  std::vector<std::pair<Vector3d, Vector3d>> bones;
  std::vector<std::pair<double, double>> skin;  ///< distance, area.
  double edge_area = 0.0, area = 0.0;

  double distance(const Vector3d& p) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : bones) nearest = std::min(nearest, detail::point_segment_distance(p, a, b));
    return nearest;
  }
};

double median(std::vector<std::pair<double, double>> samples, double area) {
  std::sort(samples.begin(), samples.end());
  double sum = 0.0;
  for (const auto& [distance, own] : samples)
    if ((sum += own) >= 0.5 * area) return distance;
  return samples.back().first;
}

}  // namespace

std::vector<LimbThickness> limb_thicknesses(const ControlLattice& lattice, const Surface& skin) {
  std::vector<Limb> limbs(lattice.frame_of_joint.size());
  for (const LatticeBone& bone : lattice.bones)
    limbs[static_cast<std::size_t>(bone.frame)].bones.emplace_back(bone.rest_start, bone.rest_end);
  for (const SoftFrame& soft : lattice.soft_frames)
    limbs[static_cast<std::size_t>(soft.frame)].bones.emplace_back(soft.position, soft.position);
  const detail::CellLocator locator(lattice.complex);
  const std::vector<double> areas = vertex_areas(skin);
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const int frame = skin_frame(skin.weights[v], lattice.frame_of_joint);
    if (frame < 0) continue;
    const Vector3d p = skin.points.row(static_cast<Eigen::Index>(v)).transpose();
    const int cell = locator.find(p, kInsideSlack);  // copies are as large as each other
    Limb& limb = limbs[static_cast<std::size_t>(frame)];
    if (cell < 0 || limb.bones.empty()) continue;
    limb.skin.emplace_back(limb.distance(p), areas[v]);
    limb.area += areas[v];
    limb.edge_area +=
        areas[v] * mean_edge(lattice.complex, lattice.complex.cells[static_cast<std::size_t>(cell)]);
  }
  std::vector<LimbThickness> result;
  for (std::size_t j = 0; j < limbs.size(); ++j)
    if (limbs[j].area > 0.0)
      result.push_back({static_cast<int>(j), 2.0 * median(limbs[j].skin, limbs[j].area),
                        limbs[j].edge_area / limbs[j].area, limbs[j].area});
  return result;
}

std::optional<LimbThickness> thinnest_limb(const std::vector<LimbThickness>& limbs) {
  double total = 0.0;
  for (const LimbThickness& limb : limbs) total += limb.area;
  const double least = total * std::min(kSmallShare, kSmallShareOfMean / static_cast<double>(limbs.size()));
  std::optional<LimbThickness> thinnest;
  for (const LimbThickness& limb : limbs)
    if (limb.area > least && limb.thickness > 0.0 && (!thinnest || limb.ratio() < thinnest->ratio()))
      thinnest = limb;
  return thinnest;
}

}  // namespace sinew::lattice
