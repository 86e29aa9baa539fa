#pragma once

#include <array>
#include <compare>
#include <span>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/detail/triangle_grid.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice::detail {

/// The flesh in one cell, in samples that hang together where no skin is between them ([Nesme09]; [Teran05]
/// finds the same components by cutting). Frames are whatever numbers the caller gives.
class CellFlesh {
 public:
  /// How the flesh of two frames meets in the cell.
  enum class Contact {
    None,       ///< a gap, or skin on skin.
    Overlap,    ///< through skin, but never outside of all.
    Continuous  ///< no skin between them.
  };

  /// Samples the cell with `corners` (unit coordinates; 4 of a tetrahedron or 8 of a hexahedron).
  /// `frames_of_triangle`: of the corners of the skin's triangles, -1 for none; `grid` has those triangles.
  CellFlesh(const UnitSkin& skin, const TriangleGrid& grid,
            std::span<const std::array<int, 3>> frames_of_triangle, std::span<const Eigen::Vector3d> corners);

  /// Flesh of `frame` round a point in the cell: where a bone runs.
  void add(int frame, const Eigen::Vector3d& p);

  bool has(int frame) const;
  Contact contact(int a, int b) const;

 private:
  struct Sample {
    Eigen::Vector3d p;
    double clearance;  ///< to the nearest skin.
    int part, loose_part;
  };
  struct Claim {
    int frame, sample;
    auto operator<=>(const Claim&) const = default;
  };
  /// Whether flesh goes on from a to b.
  Contact between(const Eigen::Vector3d& a, double clearance_a, const Eigen::Vector3d& b,
                  double clearance_b) const;
  int part(int sample) const;
  int loose_part(int sample) const;
  void join(int a, int b, Contact contact);
  void claim(int sample, const SurfaceQuery::Closest& closest,
             std::span<const std::array<int, 3>> frames_of_triangle);

  const UnitSkin& skin_;
  const TriangleGrid& grid_;
  std::vector<Sample> samples_;
  std::vector<Claim> claims_;  ///< sorted.
  double spacing_ = 0.0;
};

}  // namespace sinew::lattice::detail
