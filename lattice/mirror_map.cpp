#include "lattice/mirror_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <utility>

#include "lattice/detail/mirror_planes.h"
#include "lattice/detail/point_finder.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

/// How far an image may lie from its partner, as a share of the size: for the lattice, which is mirrored with
/// a few roundings, and for the skin, which comes from a file in single precision.
constexpr double kLatticeTolerance = 1e-9, kSkinTolerance = 1e-5;
/// By how much the weights of partners may differ, summed over the frames, in the mean over the skin: they
/// are painted by hand.
constexpr double kWeightTolerance = 0.02;

/// Looks for the mirror image in one plane; every step adds to the map and returns false where it fails.
class MirrorFinder {
 public:
  MirrorFinder(const ControlLattice& lattice, const Surface& skin, const MirrorPlane& plane, double size)
      : lattice_(lattice), skin_(skin), size_(size), finder_(lattice.complex.points) {
    map_.plane = plane;
  }
  bool run() { return find_places() && find_bones() && find_cells() && find_vertices() && skin_agrees(); }
  MirrorMap take() { return std::move(map_); }

 private:
  Vector3d point(int vertex) const { return lattice_.complex.points.row(vertex).transpose(); }
  bool are_images(const Vector3d& a, const Vector3d& b) const {
    return (map_.plane.image(a) - b).norm() <= kLatticeTolerance * size_;
  }

  bool find_places();
  bool find_bones();
  bool pair_frames(int a, int b);
  bool find_cells();
  bool find_vertices();
  bool skin_agrees() const;
  std::vector<double> weights_of(Eigen::Index vertex) const;
  std::optional<double> difference(Eigen::Index vertex, const detail::PointFinder& finder) const;

  const ControlLattice& lattice_;
  const Surface& skin_;
  double size_;
  detail::PointFinder finder_;
  MirrorMap map_;
  /// Per vertex the smallest index of those at its place (copies have vertices of their own at one place),
  /// and the same of its image's place.
  std::vector<int> place_, image_place_;
};

bool MirrorFinder::find_places() {
  const int n = static_cast<int>(lattice_.complex.points.rows());
  for (int v = 0; v < n; ++v) {
    place_.push_back(finder_.first_near(point(v), kLatticeTolerance * size_));
    image_place_.push_back(finder_.first_near(map_.plane.image(point(v)), kLatticeTolerance * size_));
    if (image_place_.back() < 0) return false;
  }
  return true;
}

/// False where one of the frames has another partner already.
bool MirrorFinder::pair_frames(int a, int b) {
  int &partner = map_.frames[static_cast<std::size_t>(a)], &other = map_.frames[static_cast<std::size_t>(b)];
  if ((partner >= 0 && partner != b) || (other >= 0 && other != a)) return false;
  partner = b;
  other = a;
  return true;
}

bool MirrorFinder::find_bones() {
  const std::vector<LatticeBone>& bones = lattice_.bones;
  const int n = static_cast<int>(bones.size());
  map_.bones.assign(bones.size(), -1);
  map_.frames.assign(lattice_.frame_of_joint.size(), -1);
  for (std::size_t b = 0; b < bones.size(); ++b) {
    for (int m = static_cast<int>(b); m < n && map_.bones[b] < 0; ++m) {
      const LatticeBone& other = bones[static_cast<std::size_t>(m)];
      if (map_.bones[static_cast<std::size_t>(m)] >= 0 || other.soft != bones[b].soft ||
          !are_images(bones[b].rest_start, other.rest_start) ||
          !are_images(bones[b].rest_end, other.rest_end) || !pair_frames(bones[b].frame, other.frame))
        continue;
      map_.bones[b] = m;
      map_.bones[static_cast<std::size_t>(m)] = static_cast<int>(b);
    }
    if (map_.bones[b] < 0) return false;
  }
  return std::all_of(lattice_.soft_frames.begin(), lattice_.soft_frames.end(), [&](const SoftFrame& soft) {
    return std::any_of(lattice_.soft_frames.begin(), lattice_.soft_frames.end(), [&](const SoftFrame& other) {
      return are_images(soft.position, other.position) && pair_frames(soft.frame, other.frame);
    });
  });
}

/// A cell by the places of its corners and, of a copy, by the frames it holds.
using CellKey = std::pair<std::array<int, 8>, std::vector<int>>;

bool MirrorFinder::find_cells() {
  const std::vector<Cell>& cells = lattice_.complex.cells;
  std::vector<std::vector<int>> frames(cells.size());
  for (const CellCopy& copy : lattice_.copies) frames[static_cast<std::size_t>(copy.cell)] = copy.frames;
  const auto key = [&](std::size_t c, const std::vector<int>& place, const std::vector<int>& of_frames) {
    CellKey result;
    result.first.fill(-1);
    for (std::size_t k = 0; k < static_cast<std::size_t>(num_corners(cells[c].type)); ++k)
      result.first[k] = place[static_cast<std::size_t>(cells[c].vertices[k])];
    std::sort(result.first.begin(), result.first.end());
    result.second = of_frames;
    std::sort(result.second.begin(), result.second.end());
    return result;
  };
  std::map<CellKey, int> cell_of;
  for (std::size_t c = 0; c < cells.size(); ++c) cell_of[key(c, place_, frames[c])] = static_cast<int>(c);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    std::vector<int> image_frames;
    for (int f : frames[c]) image_frames.push_back(map_.frames[static_cast<std::size_t>(f)]);
    const auto found = cell_of.find(key(c, image_place_, image_frames));
    if (found == cell_of.end()) return false;
    map_.cells.push_back(found->second);
  }
  return true;
}

bool MirrorFinder::find_vertices() {
  map_.vertices.assign(place_.size(), -1);
  for (std::size_t c = 0; c < map_.cells.size(); ++c) {
    const Cell& cell = lattice_.complex.cells[c];
    const Cell& image = lattice_.complex.cells[static_cast<std::size_t>(map_.cells[c])];
    const int n = num_corners(cell.type);
    for (int k = 0; k < n; ++k) {
      const auto v = static_cast<std::size_t>(cell.vertices[static_cast<std::size_t>(k)]);
      const auto partner = std::find_if(image.vertices.begin(), image.vertices.begin() + n, [&](int u) {
        return place_[static_cast<std::size_t>(u)] == image_place_[v];
      });
      if (map_.vertices[v] >= 0 && map_.vertices[v] != *partner) return false;
      map_.vertices[v] = *partner;
    }
  }
  return true;
}

std::vector<double> MirrorFinder::weights_of(Eigen::Index vertex) const {
  std::vector<double> weights(lattice_.frame_of_joint.size(), 0.0);
  for (const Influence& influence : skin_.weights[static_cast<std::size_t>(vertex)]) {
    const int frame = lattice_.frame_of_joint[static_cast<std::size_t>(influence.frame)];
    if (frame >= 0) weights[static_cast<std::size_t>(frame)] += influence.weight;
  }
  return weights;
}

/// By how much the weights of a vertex differ from its partner's; nothing where it has none. Vertices may be
/// there twice, along seams of a texture: the most alike counts.
std::optional<double> MirrorFinder::difference(Eigen::Index vertex, const detail::PointFinder& finder) const {
  const std::vector<double> weights = weights_of(vertex);
  const Vector3d image = map_.plane.image(skin_.points.row(vertex).transpose());
  std::optional<double> smallest;
  finder.any_near(image, kSkinTolerance * size_, [&](int other) {
    const std::vector<double> others = weights_of(other);
    double sum = 0.0;
    for (std::size_t f = 0; f < weights.size(); ++f)
      if (map_.frames[f] >= 0) sum += std::abs(weights[f] - others[static_cast<std::size_t>(map_.frames[f])]);
    smallest = std::min(sum, smallest.value_or(sum));
    return false;
  });
  return smallest;
}

bool MirrorFinder::skin_agrees() const {
  const detail::PointFinder finder(skin_.points);
  double sum = 0.0;
  for (Eigen::Index v = 0; v < skin_.points.rows(); ++v) {
    const std::optional<double> own = difference(v, finder);
    if (!own) return false;
    sum += *own;
  }
  return sum <= kWeightTolerance * static_cast<double>(skin_.points.rows());
}

std::vector<MirrorPlane> candidates(const Points& points) {
  std::vector<MirrorPlane> planes;
  for (const int axis : {0, 2, 1}) planes.push_back(detail::middle_plane(points, Vector3d::Unit(axis)));
  for (const MirrorPlane& plane : detail::principal_planes(points)) planes.push_back(plane);
  return planes;
}

}  // namespace

std::optional<MirrorMap> find_mirror_map(const ControlLattice& lattice, const Surface& skin) {
  const Points& points = lattice.complex.points;
  if (points.rows() == 0 || skin.weights.empty()) return std::nullopt;
  const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
  for (const MirrorPlane& plane : candidates(points)) {
    MirrorFinder finder(lattice, skin, plane, size);
    if (finder.run()) return finder.take();
  }
  return std::nullopt;
}

std::vector<int> mirrored_vertices(const Hierarchy& hierarchy, const MirrorMap& mirror) {
  std::vector<int> partner = mirror.vertices;
  std::map<std::vector<int>, int> vertex_of;  // by its parents
  const auto parents_of = [&](int vertex, const auto& name) {
    std::vector<int> parents;
    for (int p : hierarchy.parents(vertex)) parents.push_back(name(p));
    std::sort(parents.begin(), parents.end());
    return parents;
  };
  const int first = hierarchy.num_vertices(0);
  for (int v = first; v < hierarchy.num_vertices(); ++v)
    vertex_of[parents_of(v, [](int p) { return p; })] = v;
  for (int v = first; v < hierarchy.num_vertices(); ++v)
    partner.push_back(
        vertex_of.at(parents_of(v, [&](int p) { return partner[static_cast<std::size_t>(p)]; })));
  return partner;
}

}  // namespace sinew::lattice
