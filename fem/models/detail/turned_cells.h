#pragma once

#include <span>
#include <utility>
#include <vector>

#include "fem/body/cell_matrices.h"
#include "fem/linear/large_pages.h"
#include "fem/models/detail/cell_groups.h"

/// Products of every cell's stiffness with displacements in turned axes.
namespace sinew::fem::detail {

/// A share of the displacements that forces are asked of: share R^T x, x relative to the cell's first corner.
struct TurnedPlace {
  double share = 1.0;
  const lattice::Points* x = nullptr;
  const std::vector<Eigen::Matrix3d>* rotations = nullptr;  ///< one per cell; null for none.
};

/// K of all leaf cells, upper blocks only.
class TurnedCells {
 public:
  /// `stiffness` is called once per cell, in their order.
  template <class Stiffness>
  TurnedCells(CellGroups groups, const Stiffness& stiffness) : groups_(std::move(groups)) {
    values_.resize(kGroupSize * static_cast<std::size_t>(groups_.num_groups()));
    for (int c = 0; c < groups_.num_cells(); ++c) set(c, stiffness(c));
  }

  const CellGroups& groups() const { return groups_; }
  CellStiffness stiffness(int cell) const;

  /// R K sum_k share_k R_k^T x_k of every cell, as CellGroups has vectors.
  void forces(const std::vector<Eigen::Matrix3d>& rotations, std::span<const TurnedPlace> places,
              std::vector<double>& result, Code code = best_code()) const;
  /// The same with the forces of the turn that R, the polar rotation of the first place, makes with that
  /// place: what is left is the slope of a potential (fem/models/detail/corotational_cells.h). `mean`: G of
  /// every cell, packed. `slim`, one per cell: whether it may be near collapse
  /// (fem/models/detail/collapse.h); those forces are not in.
  void polar_forces(const std::vector<double>& mean, std::span<const TurnedPlace> places,
                    std::vector<double>& result, std::vector<char>& slim, Code code = best_code()) const;

 private:
  static constexpr std::size_t kBlocks = 36;  ///< of 3 x 3, by rows: (0,0), (0,1) .. (0,7), (1,1) ..
  static constexpr std::size_t kGroupSize = kBlocks * 9 * CellGroups::kCells;
  void set(int cell, const CellStiffness& stiffness);

  CellGroups groups_;
  LargeVector<double> values_;  ///< group, block, row and column of the block, lane.
};

/// One row per corner of every cell, as CellGroups has vectors.
std::vector<double> packed(const CellGroups& groups, std::span<const lattice::HexGradients> cells);

/// Replaces matrices by the rotations of their polar decompositions, the nearest proper ones where they
/// mirror.
void polar_rotations(std::span<Eigen::Matrix3d> matrices, Code code = best_code());

}  // namespace sinew::fem::detail
