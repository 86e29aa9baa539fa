#pragma once

#include <array>
#include <vector>

#include "lattice/embedding.h"
#include "lattice/leaf_limbs.h"
#include "lattice/surface_query.h"

/// How much of each leaf cell is flesh.
namespace sinew::lattice {

/// Share of material round each of the 2x2x2 Gauss points of a leaf cell, in [0, 1]; Gauss point k belongs to
/// the octant of corner k (VTK's corner order).
using FillFractions = std::array<double, 8>;

/// 4x4x4 samples per leaf cell, eight in each octant, each for the part of the cell round it. A part is
/// material if the winding number at its sample exceeds 0.5; one that the skin of a body cuts is material as
/// far as the plane of the nearest skin says. Open sheets have no inside: there a sample is material within
/// `shell` [m] of the surface. Where cells coincide, `limbs` says which of them a sample belongs to. One
/// entry per leaf cell.
std::vector<FillFractions> fill_fractions(const LeafMesh& mesh, const SurfaceQuery& skin, double shell,
                                          const LeafLimbs* limbs = nullptr);

/// Points on every triangle, no farther than `spacing` [m] from their neighbours; corners included.
struct TriangleSamples {
  Points points;              ///< num_samples x 3 [m].
  std::vector<int> vertices;  ///< per sample the nearest corner of its triangle.
};
TriangleSamples sample_triangles(const Points& points, const Triangles& triangles, double spacing);

/// What an octant holds at least if the skin passes through it. Without it functions there would hold no mass
/// at all; more of it would be mass that is not there.
inline constexpr double kGrazedFill = 1.0 / 64.0;

/// Raises the fill of every octant that holds one of the `samples` of the skin to kGrazedFill; `may_hold` as
/// of embed().
void fill_grazed_octants(const LeafMesh& mesh, const Points& samples, std::vector<FillFractions>& fill,
                         const CellFilter& may_hold = {});

/// Flags the leaf cells that stay: any fill, or a point embedded in it (`embedded_cells`: cell indices, e.g.
/// Embedding::cell).
std::vector<std::uint8_t> filled_cells(const std::vector<FillFractions>& fill,
                                       const std::vector<int>& embedded_cells);

}  // namespace sinew::lattice
