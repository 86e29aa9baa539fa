#include "lattice/detail/cell_flesh.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include <Eigen/Geometry>

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

constexpr int kSteps = 8;  ///< samples along an edge, less one.
/// Stretches of a segment shorter than this share of it are where skin lies on skin.
constexpr double kNothing = 1e-6;

struct Node {
  std::array<int, 4> at;  ///< barycentric, or i, j, k and 0.
  Vector3d p;
};

/// Points all over the cell, drawn in by half a step from its border, and the steps from one to the next.
std::vector<Node> nodes_of_tetrahedron(std::span<const Vector3d> corners) {
  std::vector<Node> nodes;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; i + j <= kSteps; ++j)
      for (int k = 0; i + j + k <= kSteps; ++k) {
        const std::array<int, 4> at{i, j, k, kSteps - i - j - k};
        Vector3d p = Vector3d::Zero();
        for (int c = 0; c < 4; ++c) p += (at[c] + 0.5) / (kSteps + 2.0) * corners[c];
        nodes.push_back({at, p});
      }
  return nodes;
}

std::vector<Node> nodes_of_hexahedron(std::span<const Vector3d> corners) {
  std::vector<Node> nodes;
  const int n = kSteps;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) {
        const Vector3d xi = (Vector3d(i, j, k).array() + 0.5) / n;
        Vector3d p = Vector3d::Zero();
        for (int c = 0; c < 8; ++c) {
          const Vector3d corner(c % 4 == 1 || c % 4 == 2, c % 4 >= 2, c >= 4);
          p += (corner.cwiseProduct(xi) + (Vector3d::Ones() - corner).cwiseProduct(Vector3d::Ones() - xi))
                   .prod() *
               corners[c];
        }
        nodes.push_back({{i, j, k, 0}, p});
      }
  return nodes;
}

/// Half of the steps to the neighbours; the other half is theirs.
std::vector<std::array<int, 4>> steps_to_neighbours(bool is_tetrahedron) {
  if (!is_tetrahedron) return {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  std::vector<std::array<int, 4>> steps;
  for (int a = 0; a < 4; ++a)
    for (int b = a + 1; b < 4; ++b) {
      std::array<int, 4> step{0, 0, 0, 0};
      step[a] = 1;
      step[b] = -1;
      steps.push_back(step);
    }
  return steps;
}

}  // namespace

CellFlesh::CellFlesh(const UnitSkin& skin, const TriangleGrid& grid,
                     std::span<const std::array<int, 3>> frames_of_triangle,
                     std::span<const Vector3d> corners)
    : skin_(skin), grid_(grid) {
  const bool is_tetrahedron = corners.size() == 4;
  const std::vector<Node> nodes =
      is_tetrahedron ? nodes_of_tetrahedron(corners) : nodes_of_hexahedron(corners);
  std::map<std::array<int, 4>, int> sample_at;
  for (const Node& node : nodes) {
    if (!skin.is_inside(node.p)) continue;
    const int index = static_cast<int>(samples_.size());
    const SurfaceQuery::Closest closest = skin.query.closest(node.p);
    samples_.push_back({node.p, closest.distance, index, index});
    sample_at[node.at] = index;
    claim(index, closest, frames_of_triangle);
  }
  for (const std::array<int, 4>& step : steps_to_neighbours(is_tetrahedron))
    for (const auto& [at, from] : sample_at) {
      std::array<int, 4> next = at;
      for (int c = 0; c < 4; ++c) next[c] += step[c];
      const auto to = sample_at.find(next);
      if (to == sample_at.end()) continue;
      const Sample &a = samples_[from], &b = samples_[to->second];
      spacing_ = std::max(spacing_, (a.p - b.p).norm());
      join(from, to->second, between(a.p, a.clearance, b.p, b.clearance));
    }
  std::sort(claims_.begin(), claims_.end());
}

/// A sample is flesh of the closest skin, unless it lies before it: then that skin is another limb's, which
/// dips into this one.
void CellFlesh::claim(int sample, const SurfaceQuery::Closest& closest,
                      std::span<const std::array<int, 3>> frames_of_triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return skin_.points.row(skin_.triangles(closest.triangle, k)).transpose();
  };
  const Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  if ((samples_[sample].p - closest.point).dot(normal) > 0.0) return;
  int nearest = 0;
  for (int k = 1; k < 3; ++k)
    if ((corner(k) - closest.point).squaredNorm() < (corner(nearest) - closest.point).squaredNorm())
      nearest = k;
  const int frame = frames_of_triangle[closest.triangle][nearest];
  if (frame >= 0) claims_.push_back({frame, sample});
}

CellFlesh::Contact CellFlesh::between(const Vector3d& a, double clearance_a, const Vector3d& b,
                                      double clearance_b) const {
  // Balls without skin that cover the segment.
  if (clearance_a + clearance_b > (b - a).norm()) return Contact::Continuous;
  const std::vector<double> crossings = grid_.crossings(a, b);
  if (crossings.empty()) return Contact::Continuous;
  double last = 0.0;
  for (std::size_t i = 0; i <= crossings.size(); ++i) {
    const double next = i < crossings.size() ? crossings[i] : 1.0;
    const double middle = 0.5 * (last + next);
    if (next - last > kNothing && !skin_.is_inside((1.0 - middle) * a + middle * b)) return Contact::None;
    last = next;
  }
  return Contact::Overlap;
}

void CellFlesh::join(int a, int b, Contact contact) {
  if (contact == Contact::None) return;
  const int loose_a = loose_part(a), loose_b = loose_part(b);
  samples_[std::max(loose_a, loose_b)].loose_part = std::min(loose_a, loose_b);
  if (contact == Contact::Overlap) return;
  const int part_a = part(a), part_b = part(b);
  samples_[std::max(part_a, part_b)].part = std::min(part_a, part_b);
}

void CellFlesh::add(int frame, const Vector3d& p) {
  if (!skin_.is_inside(p)) return;
  const double clearance = skin_.query.closest(p).distance;
  for (int i = 0; i < static_cast<int>(samples_.size()); ++i) {
    const Sample& sample = samples_[i];
    if ((sample.p - p).norm() > 1.5 * spacing_) continue;
    if (between(p, clearance, sample.p, sample.clearance) != Contact::Continuous) continue;
    const Claim claim{frame, i};
    claims_.insert(std::lower_bound(claims_.begin(), claims_.end(), claim), claim);
  }
}

bool CellFlesh::has(int frame) const {
  const auto first = std::lower_bound(claims_.begin(), claims_.end(), Claim{frame, -1});
  return first != claims_.end() && first->frame == frame;
}

CellFlesh::Contact CellFlesh::contact(int a, int b) const {
  Contact best = Contact::None;
  std::vector<bool> part_of_a(samples_.size(), false), loose_part_of_a(samples_.size(), false);
  for (const Claim& claim : claims_)
    if (claim.frame == a) part_of_a[part(claim.sample)] = loose_part_of_a[loose_part(claim.sample)] = true;
  for (const Claim& claim : claims_) {
    if (claim.frame != b) continue;
    if (part_of_a[part(claim.sample)]) return Contact::Continuous;
    if (loose_part_of_a[loose_part(claim.sample)]) best = Contact::Overlap;
  }
  return best;
}

int CellFlesh::part(int sample) const {
  while (samples_[sample].part != sample) sample = samples_[sample].part;
  return sample;
}

int CellFlesh::loose_part(int sample) const {
  while (samples_[sample].loose_part != sample) sample = samples_[sample].loose_part;
  return sample;
}

}  // namespace sinew::lattice::detail
