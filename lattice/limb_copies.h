#pragma once

#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/surface.h"

/// Cells that several limbs share: which of the coincident copies a piece of skin or flesh belongs to. Limbs
/// that lie side by side in one coarse cell would drag each other along; with a copy for each they do not.
namespace sinew::lattice {

/// The frame (a value of `frame_of_joint`) with most weight; weights of joints that count for the same frame
/// add up; the smallest index on a tie, -1 where there is no weight.
int skin_frame(const std::vector<Influence>& influences, const std::vector<int>& frame_of_joint);

/// Chooses between the copies of a cell. Read by any number of threads.
class LimbCopies {
 public:
  explicit LimbCopies(const ControlLattice& lattice);

  bool is_copy(int cell) const { return place_[static_cast<std::size_t>(cell)] >= 0; }

  /// Of the copies that coincide with `cell` the one for flesh that follows `frame` at p [m]: the copy that
  /// names the frame, else the one whose frames have the bone or soft frame nearest to p. A cell that is no
  /// copy is its own.
  int own_copy(int cell, int frame, const Eigen::Vector3d& p) const;

  /// True where flesh that follows `frame` at p belongs to `cell` rather than to another copy of it.
  bool owns(int cell, int frame, const Eigen::Vector3d& p) const { return own_copy(cell, frame, p) == cell; }

 private:
  struct Copy {
    int cell;
    std::vector<int> frames;
  };
  struct Segment {
    int frame;
    Eigen::Vector3d start, end;
  };
  double distance(const Copy& copy, const Eigen::Vector3d& p) const;

  std::vector<int> place_;                 ///< per cell; -1 for cells that are no copies.
  std::vector<std::vector<Copy>> places_;  ///< the copies that coincide, ascending.
  std::vector<Segment> segments_;          ///< bones and soft frames.
};

}  // namespace sinew::lattice
