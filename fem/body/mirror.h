#pragma once

#include <array>
#include <vector>

#include "fem/body/frame_weights.h"
#include "fem/body/regions.h"
#include "lattice/basis.h"
#include "lattice/fill.h"
#include "lattice/mirror_map.h"

/// A mirrored character in a mirrored motion must give a mirrored result. What is sampled, voted for or
/// solved vertex by vertex does not come out mirrored by itself: triangles are not split alike on both sides,
/// a sample lies on the border of two cells, two frames tie on the plane. Each of these is replaced by the
/// mean of itself and its mirror image.
namespace sinew::fem {

/// Which parts of a body are each other's mirror images.
struct BodyMirror {
  lattice::MirrorPlane plane;
  std::vector<int> frames;    ///< per frame of the tree its partner.
  std::vector<int> vertices;  ///< per leaf vertex.
  std::vector<int> cells;     ///< per leaf cell.
  /// Per leaf cell: the partner's corner that is the image of each of its own.
  std::vector<std::array<int, 8>> corners;
};

/// `vertices`: the partners in the hierarchy (lattice::mirrored_vertices). `mesh` must be mirrored, and every
/// frame of the tree be one of the lattice.
BodyMirror body_mirror(const lattice::MirrorMap& map, const std::vector<int>& vertices, const FrameTree& tree,
                       const lattice::LeafMesh& mesh);

void symmetrise(const BodyMirror& mirror, std::vector<lattice::FillFractions>& fill);
void symmetrise(const BodyMirror& mirror, FrameWeights& weights);
/// Leaves the weights as they are where the regions are not each other's images: a clip may bend one side
/// only.
void symmetrise(const BodyMirror& mirror, std::vector<Region>& regions);

}  // namespace sinew::fem
