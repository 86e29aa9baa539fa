#include "fem/body/mirror.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

namespace sinew::fem {
namespace {

/// The partner of every region; empty where one has none.
std::vector<std::size_t> mirrored_regions(const BodyMirror& mirror, const std::vector<Region>& regions) {
  const auto frame = [&](int f) { return mirror.frames[static_cast<std::size_t>(f)]; };
  std::vector<std::size_t> partner;
  for (const Region& region : regions) {
    // Of several joints between the same two leaders the one at the image.
    const Eigen::Vector3d image = mirror.plane.image(region.origin_rest);
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t best = regions.size();
    for (std::size_t i = 0; i < regions.size(); ++i) {
      const Region& other = regions[i];
      if (other.first != frame(region.first) || other.second != frame(region.second) || other.t != region.t)
        continue;
      const double distance = (other.origin_rest - image).norm();
      if (distance < nearest) nearest = distance, best = i;
    }
    if (best == regions.size()) return {};
    partner.push_back(best);
  }
  return partner;
}

}  // namespace

BodyMirror body_mirror(const lattice::MirrorMap& map, const std::vector<int>& vertices, const FrameTree& tree,
                       const lattice::LeafMesh& mesh) {
  BodyMirror mirror;
  mirror.plane = map.plane;
  for (const Frame& frame : tree.frames)
    mirror.frames.push_back(
        tree.frame_of_joint[static_cast<std::size_t>(map.frames[static_cast<std::size_t>(frame.joint)])]);
  for (const int vertex : mesh.vertices)
    mirror.vertices.push_back(
        mesh.leaf_of_vertex[static_cast<std::size_t>(vertices[static_cast<std::size_t>(vertex)])]);
  const auto sorted = [](lattice::HexVertices cell) {
    std::sort(cell.begin(), cell.end());
    return cell;
  };
  std::map<lattice::HexVertices, int> cell_of;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) cell_of[sorted(mesh.cells[c])] = static_cast<int>(c);
  for (const lattice::HexVertices& cell : mesh.cells) {
    lattice::HexVertices image;
    for (std::size_t k = 0; k < 8; ++k) image[k] = mirror.vertices[static_cast<std::size_t>(cell[k])];
    const int other = cell_of.at(sorted(image));
    const lattice::HexVertices& corners = mesh.cells[static_cast<std::size_t>(other)];
    mirror.cells.push_back(other);
    std::array<int, 8>& map_of_cell = mirror.corners.emplace_back();
    for (std::size_t k = 0; k < 8; ++k)
      map_of_cell[k] =
          static_cast<int>(std::find(corners.begin(), corners.end(), image[k]) - corners.begin());
  }
  return mirror;
}

void symmetrise(const BodyMirror& mirror, std::vector<lattice::FillFractions>& fill) {
  const std::vector<lattice::FillFractions> old = fill;
  for (std::size_t c = 0; c < fill.size(); ++c) {
    const lattice::FillFractions& image = old[static_cast<std::size_t>(mirror.cells[c])];
    for (std::size_t k = 0; k < 8; ++k)
      fill[c][k] = 0.5 * (old[c][k] + image[static_cast<std::size_t>(mirror.corners[c][k])]);
  }
}

void symmetrise(const BodyMirror& mirror, FrameWeights& weights) {
  std::vector<Eigen::Triplet<double>> triplets;
  for (int a = 0; a < weights.outerSize(); ++a)
    for (FrameWeights::InnerIterator it(weights, a); it; ++it) {
      triplets.emplace_back(a, static_cast<int>(it.col()), 0.5 * it.value());
      triplets.emplace_back(mirror.vertices[static_cast<std::size_t>(a)],
                            mirror.frames[static_cast<std::size_t>(it.col())], 0.5 * it.value());
    }
  weights.setFromTriplets(triplets.begin(), triplets.end());
}

void symmetrise(const BodyMirror& mirror, std::vector<Region>& regions) {
  const std::vector<std::size_t> partner = mirrored_regions(mirror, regions);
  if (partner.size() != regions.size()) return;
  std::vector<std::map<int, double>> weights(regions.size());
  for (std::size_t i = 0; i < regions.size(); ++i)
    for (std::size_t k = 0; k < regions[i].vertices.size(); ++k) {
      const int vertex = regions[i].vertices[k];
      const double half = 0.5 * regions[i].weights[k];
      weights[i][vertex] += half;
      weights[partner[i]][mirror.vertices[static_cast<std::size_t>(vertex)]] += half;
    }
  for (std::size_t i = 0; i < regions.size(); ++i) {
    regions[i].vertices.clear();
    regions[i].weights.clear();
    for (const auto& [vertex, weight] : weights[i]) {
      regions[i].vertices.push_back(vertex);
      regions[i].weights.push_back(weight);
    }
  }
}

}  // namespace sinew::fem
