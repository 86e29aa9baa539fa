#include "lattice/detail/separate_limbs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/segments.h"
#include "lattice/detail/skeleton_distance.h"
#include "lattice/detail/triangle_grid.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Skin farther apart than this along the skeleton belongs to different parts, in units of h.
constexpr double kPartDistance = 1.5;
constexpr double kSampleSpacing = 0.25;  ///< of skin samples, in units of h.
constexpr double kInsideSlack = 1e-9;

/// Which stretches of which bones move the skin in a cell.
using Label = std::vector<BoneStretch>;

class Separation {
 public:
  Separation(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice)
      : input_(input),
        skeleton_(skeleton),
        lattice_(lattice),
        distance_(skeleton),
        h_(lattice.edge_length / input.unit_skin.scale),
        labels_(lattice.complex.cells.size()) {}

  int run() {
    if (skeleton_.bones.empty()) return 0;
    label_cells();
    find_gaps();
    return gaps_.empty() ? 0 : split_vertices();
  }

 private:
  void label_cells();
  void add_sample(int cell, int bone, const Vector3d& p);
  int dominant_bone(const std::vector<Influence>& influences, const Vector3d& p) const;
  bool are_apart(int a, int b) const;
  bool is_outside(const TriangleCorners& face) const;
  void find_gaps();
  int split_vertices();
  std::vector<std::vector<int>> parts_at(const std::vector<int>& star, int vertex) const;

  const RigInput& input_;
  const ReducedSkeleton& skeleton_;
  ControlLattice& lattice_;
  SkeletonDistance distance_;
  double h_;
  std::vector<Label> labels_;
  std::vector<std::vector<int>> bones_of_joint_;  ///< those that a joint's weight counts for.
  /// Per face, by its sorted vertices: the cells on it.
  std::map<std::array<int, 3>, std::vector<int>> faces_;
  std::map<std::array<int, 3>, bool> gaps_;  ///< faces to be cut.
};

std::array<int, 3> sorted(int a, int b, int c) {
  std::array<int, 3> key{a, b, c};
  std::sort(key.begin(), key.end());
  return key;
}

/// The bone of the joint with most weight; of several the nearest.
int Separation::dominant_bone(const std::vector<Influence>& influences, const Vector3d& p) const {
  std::map<int, double> weight;  // by first bone: joints that count for the same frame share their bones
  for (const Influence& influence : influences)
    if (!bones_of_joint_[influence.frame].empty())
      weight[bones_of_joint_[influence.frame][0]] += influence.weight;
  if (weight.empty()) return -1;
  const int first = std::max_element(weight.begin(), weight.end(), [](const auto& a, const auto& b) {
                      return a.second < b.second;
                    })->first;
  int nearest = -1;
  double best = std::numeric_limits<double>::infinity();
  for (int b = 0; b < static_cast<int>(skeleton_.bones.size()); ++b) {
    const ReducedBone& bone = skeleton_.bones[b];
    if (bone.frame != skeleton_.bones[first].frame) continue;
    const double d =
        point_segment_distance(p, skeleton_.nodes[bone.start].position, skeleton_.nodes[bone.end].position);
    if (d < best) best = d, nearest = b;
  }
  return nearest;
}

void Separation::add_sample(int cell, int bone, const Vector3d& p) {
  const Vector3d a = skeleton_.nodes[skeleton_.bones[bone].start].position;
  const Vector3d b = skeleton_.nodes[skeleton_.bones[bone].end].position;
  const double s = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  for (BoneStretch& stretch : labels_[cell])
    if (stretch.bone == bone) {
      stretch.low = std::min(stretch.low, s);
      stretch.high = std::max(stretch.high, s);
      return;
    }
  labels_[cell].push_back({bone, s, s});
}

void Separation::label_cells() {
  std::vector<int> frames;
  for (const ReducedBone& bone : skeleton_.bones) frames.push_back(bone.frame);
  const std::vector<int> frame = frame_of_joint(input_.joints.parents, frames);
  bones_of_joint_.resize(frame.size());
  for (std::size_t j = 0; j < frame.size(); ++j)
    for (int b = 0; b < static_cast<int>(skeleton_.bones.size()); ++b)
      if (skeleton_.bones[b].frame == frame[j]) bones_of_joint_[j].push_back(b);

  const UnitSkin& skin = input_.unit_skin;
  const CellLocator locator(lattice_.complex);
  for (int t = 0; t < skin.triangles.rows(); ++t) {
    const Vector3d a = skin.points.row(skin.triangles(t, 0)), b = skin.points.row(skin.triangles(t, 1)),
                   c = skin.points.row(skin.triangles(t, 2));
    const int n = std::max(1, static_cast<int>(std::ceil((b - a).norm() / (kSampleSpacing * h_))));
    const int m = std::max(1, static_cast<int>(std::ceil((c - a).norm() / (kSampleSpacing * h_))));
    for (int i = 0; i <= n; ++i)
      for (int k = 0; k <= m; ++k) {
        const double u = static_cast<double>(i) / n, v = static_cast<double>(k) / m;
        if (u + v > 1.0 + 1e-12) continue;
        const Vector3d p = a + u * (b - a) + v * (c - a);
        const int cell = locator.find(skin.to_rest(p), kInsideSlack);
        // The weights of the nearest corner decide.
        const int corner = u > 0.5 ? 1 : v > 0.5 ? 2 : 0;
        const int bone = dominant_bone(skin.weights[skin.triangles(t, corner)], p);
        if (cell >= 0 && bone >= 0) add_sample(cell, bone, p);
      }
  }
}

bool Separation::are_apart(int a, int b) const {
  if (labels_[a].empty() || labels_[b].empty()) return false;
  for (const BoneStretch& x : labels_[a])
    for (const BoneStretch& y : labels_[b])
      if (distance_.between(x, y) < kPartDistance * h_) return false;
  return true;
}

/// True where the corners (drawn in a little), edge midpoints and mean of a face lie outside the skin.
bool Separation::is_outside(const TriangleCorners& face) const {
  const Vector3d mean = (face[0] + face[1] + face[2]) / 3.0;
  if (input_.unit_skin.is_inside(mean)) return false;
  for (int k = 0; k < 3; ++k) {
    if (input_.unit_skin.is_inside(0.9 * face[k] + 0.1 * mean)) return false;
    if (input_.unit_skin.is_inside(0.45 * (face[k] + face[(k + 1) % 3]) + 0.1 * mean)) return false;
  }
  return true;
}

void Separation::find_gaps() {
  const CellComplex& complex = lattice_.complex;
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c)
    for (const std::array<int, 4>& f : cell_faces(complex.cells[c].type)) {
      const auto& v = complex.cells[c].vertices;
      faces_[sorted(v[f[0]], v[f[1]], v[f[2]])].push_back(c);
    }
  const UnitSkin& skin = input_.unit_skin;
  std::vector<TriangleCorners> triangles;
  for (int t = 0; t < skin.triangles.rows(); ++t)
    triangles.push_back({skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                         skin.points.row(skin.triangles(t, 2))});
  const TriangleGrid grid(std::move(triangles), 0.5 * h_);
  for (const auto& [key, cells] : faces_) {
    if (cells.size() != 2 || !are_apart(cells[0], cells[1])) continue;
    TriangleCorners face;
    for (int k = 0; k < 3; ++k) face[k] = skin.to_unit(complex.points.row(key[k]).transpose());
    if (is_outside(face) && !grid.crosses(face, 0.0)) gaps_[key] = true;
  }
}

/// The cells round a vertex in groups that hang together through faces that are not cut, or hold skin of one
/// part.
std::vector<std::vector<int>> Separation::parts_at(const std::vector<int>& star, int vertex) const {
  std::vector<int> group(star.size());
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int i) {
    while (group[i] != i) i = group[i] = group[group[i]];
    return i;
  };
  const auto join = [&](int i, int k) {
    const int a = root(i), b = root(k);
    group[std::max(a, b)] = std::min(a, b);
  };
  for (std::size_t i = 0; i < star.size(); ++i)
    for (const std::array<int, 4>& f : cell_faces(CellType::Tetrahedron)) {
      const auto& v = lattice_.complex.cells[star[i]].vertices;
      const std::array<int, 3> key = sorted(v[f[0]], v[f[1]], v[f[2]]);
      if (std::find(key.begin(), key.end(), vertex) == key.end() || gaps_.contains(key)) continue;
      for (int other : faces_.at(key)) {
        const auto k = std::find(star.begin(), star.end(), other) - star.begin();
        join(static_cast<int>(i), static_cast<int>(k));
      }
    }
  for (std::size_t i = 0; i < star.size(); ++i)
    for (std::size_t k = i + 1; k < star.size(); ++k)
      if (!labels_[star[i]].empty() && !labels_[star[k]].empty() && !are_apart(star[i], star[k]))
        join(static_cast<int>(i), static_cast<int>(k));
  std::vector<std::vector<int>> parts;
  std::map<int, std::size_t> part_of;
  for (std::size_t i = 0; i < star.size(); ++i) {
    const auto [entry, fresh] = part_of.emplace(root(static_cast<int>(i)), parts.size());
    if (fresh) parts.emplace_back();
    parts[entry->second].push_back(star[i]);
  }
  return parts;
}

int Separation::split_vertices() {
  CellComplex& complex = lattice_.complex;
  std::vector<bool> on_bone(complex.points.rows(), false), on_gap(complex.points.rows(), false);
  for (const LatticeBone& bone : lattice_.bones)
    for (int v : bone.chain) on_bone[v] = true;
  for (const auto& [key, cut] : gaps_)
    for (int v : key) on_gap[v] = true;
  std::vector<std::vector<int>> stars(complex.points.rows());
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c)
    for (int k = 0; k < 4; ++k) stars[complex.cells[c].vertices[k]].push_back(c);

  std::vector<Cell> cells = complex.cells;  // the old ones serve the questions
  std::vector<int> original;                // of each copy
  const int count = static_cast<int>(complex.points.rows());
  for (int v = 0; v < count; ++v) {
    if (!on_gap[v] || on_bone[v]) continue;
    const std::vector<std::vector<int>> parts = parts_at(stars[v], v);
    for (std::size_t part = 1; part < parts.size(); ++part) {
      const int copy = count + static_cast<int>(original.size());
      original.push_back(v);
      for (int c : parts[part])
        std::replace(cells[c].vertices.begin(), cells[c].vertices.begin() + 4, v, copy);
    }
  }
  complex.cells = std::move(cells);
  complex.points.conservativeResize(count + static_cast<Eigen::Index>(original.size()), 3);
  for (std::size_t i = 0; i < original.size(); ++i)
    complex.points.row(count + static_cast<Eigen::Index>(i)) = complex.points.row(original[i]).eval();
  return static_cast<int>(original.size());
}

}  // namespace

int separate_limbs(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice) {
  return Separation(input, skeleton, lattice).run();
}

}  // namespace sinew::lattice::detail
