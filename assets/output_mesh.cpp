#include "assets/output_mesh.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;

/// Points sorted along x: enough to find the few within a tolerance that is tiny against the box.
class SortedPoints {
 public:
  explicit SortedPoints(const lattice::Points& points)
      : points_(points), order_(static_cast<std::size_t>(points.rows())) {
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return points(a, 0) < points(b, 0); });
  }

  /// Indices of the points within `radius` of p, ascending.
  std::vector<int> within(const Vector3d& p, double radius) const {
    const auto first = std::lower_bound(order_.begin(), order_.end(), p.x() - radius,
                                        [&](int i, double x) { return points_(i, 0) < x; });
    std::vector<int> found;
    for (auto it = first; it != order_.end() && points_(*it, 0) <= p.x() + radius; ++it)
      if ((points_.row(*it).transpose() - p).squaredNorm() <= radius * radius) found.push_back(*it);
    std::sort(found.begin(), found.end());
    return found;
  }

  int nearest(const Vector3d& p) const {
    Eigen::Index index = 0;
    (points_.rowwise() - p.transpose()).rowwise().squaredNorm().minCoeff(&index);
    return static_cast<int>(index);
  }

 private:
  const lattice::Points& points_;
  std::vector<int> order_;
};

std::string place(const Vector3d& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z()); }

}  // namespace

void MatchOptions::validate() const {
  if (!(tolerance > 0.0 && tolerance < 0.01))
    throw std::invalid_argument(fmt::format("MatchOptions: tolerance is {}, expected (0, 0.01)", tolerance));
}

std::vector<int> moving_together(const Rig& rig, const PhysicsSkin& skin) {
  // The simulated part's number is its welded vertex; the others are numbered behind those, one per part,
  // place and weights.
  std::vector<int> together = skin.surface_of_vertex;
  int next = static_cast<int>(skin.surface.points.rows());
  std::size_t vertex = 0;
  for (const Part& part : rig.parts) {
    std::map<std::tuple<double, double, double, std::vector<std::pair<int, double>>>, int> seen;
    for (Eigen::Index v = 0; v < part.points.rows(); ++v, ++vertex) {
      if (together[vertex] >= 0) continue;
      std::vector<std::pair<int, double>> weights;
      if (!part.weights.empty())
        for (const auto& influence : part.weights[static_cast<std::size_t>(v)])
          weights.emplace_back(influence.frame, influence.weight);
      const auto [entry, is_new] =
          seen.emplace(std::tuple(part.points(v, 0), part.points(v, 1), part.points(v, 2), weights), next);
      if (is_new) ++next;
      together[vertex] = entry->second;
    }
  }
  return together;
}

std::vector<int> match_rest_positions(const std::string& file, const lattice::Points& mesh_points,
                                      const lattice::Points& rig_points, const std::vector<int>& together,
                                      const MatchOptions& options) {
  options.validate();
  if (rig_points.rows() == 0 || static_cast<Eigen::Index>(together.size()) != rig_points.rows())
    throw std::invalid_argument("match_rest_positions: one number per vertex of the rig expected");
  const double diagonal = (rig_points.colwise().maxCoeff() - rig_points.colwise().minCoeff()).norm();
  const double radius = options.tolerance * diagonal;
  const SortedPoints sorted(rig_points);
  std::vector<int> match;
  for (Eigen::Index v = 0; v < mesh_points.rows(); ++v) {
    const Vector3d p = mesh_points.row(v);
    const std::vector<int> found = sorted.within(p, radius);
    if (found.empty()) {
      const int nearest = sorted.nearest(p);
      throw InputError(
          file, fmt::format("vertex {} at {}: no vertex of the rig within {:.3g}, the nearest, {}, is "
                            "{:.3g} away; hint: export the mesh in the rig's rest pose, units and axes",
                            v, place(p), radius, nearest, (rig_points.row(nearest).transpose() - p).norm()));
    }
    for (const int other : found)
      if (together[static_cast<std::size_t>(other)] != together[static_cast<std::size_t>(found.front())])
        throw InputError(
            file, fmt::format("vertex {} at {}: the rig's vertices {} and {} are both within {:.3g} but "
                              "move apart; hint: merge or separate them in the rig",
                              v, place(p), found.front(), other, radius));
    match.push_back(found.front());
  }
  return match;
}

}  // namespace sinew::assets
