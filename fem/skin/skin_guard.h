#pragma once

#include <vector>

#include <Eigen/Core>

#include "lattice/points.h"

/// Mends the skin where cells are too coarse to carry it.
namespace sinew::fem {

/// What mending changed in one frame.
struct Mended {
  double area = 0.0;     ///< share of the skin's area at rest that was moved [-].
  double largest = 0.0;  ///< longest way of a vertex, in the skin's own unit.
  int vertex = -1;       ///< which one; -1: nothing was mended.
};

/// Per vertex of the welded skin; both are empty where nothing is wrong.
struct GuardWeights {
  std::vector<double> weights;  ///< w [0 .. 1]: how far d goes by the neighbours'.
  std::vector<double> pulls;    ///< how much of it is left out then [0 .. 1]; 1: plain skinning.
};

/// A cell of the lattice is as wide as a limb is thick. In an armpit or between toes the skin of several
/// limbs crosses it, and what the cell does to one of them tears the other. There, and nowhere else, flesh is
/// laid back towards plain skinning: what it adds to it, d = x - plain, becomes as smooth as its surroundings
/// have it,
///   d_v = (1 - w_v) d_v^0 + w_v mean of d over the neighbours,
/// with w rising from 0 to 1 where triangles are stretched, squeezed or turned over, or the skin is creased,
/// against plain skinning and against rest, and fading over three rings (harmonic in the middle; smoothing
/// what deformation adds is [Mancewicz14]'s idea). What is still wrong then is drawn to plain skinning
/// itself. Where the skin is whole nothing changes, so rigid motion, and flesh that lags behind without
/// tearing, stay as they are to the last bit. w is a continuous function of the places, but a steep one:
/// frames in a row are mended by SteadyGuard.
class SkinGuard {
 public:
  /// rest: num_vertices x 3; triangles of it, vertices that belong together welded. Throws
  /// std::invalid_argument where an index is out of range.
  SkinGuard(const lattice::Points& rest, const lattice::Triangles& triangles);

  /// What `flesh` asks for (num_vertices x 3), where `plain` is plain skinning at that instant: `from`, and
  /// what is still wrong after that.
  GuardWeights weigh(const lattice::Points& plain, const lattice::Points& flesh,
                     const GuardWeights& from = {}) const;
  /// Lays `skin` back by these weights.
  Mended mend(const GuardWeights& by, const lattice::Points& plain, lattice::Points& skin) const;
  /// An instant that stands alone. Same places, same bits.
  Mended mend(const lattice::Points& plain, lattice::Points& skin) const {
    return mend(weigh(plain, skin), plain, skin);
  }

 private:
  struct Side;
  std::vector<double> faults(const lattice::Points& skin, const Side& plain) const;
  void spread(std::vector<double>& weights, int rings, double reach) const;
  void lay(const GuardWeights& by, const lattice::Points& plain, const lattice::Points& flesh,
           lattice::Points& skin) const;

  /// First fundamental form of a triangle: a.a, a.b, b.b of its edges.
  struct Form {
    double aa, ab, bb;
  };
  Form form(const lattice::Points& x, std::size_t triangle) const;
  std::vector<Form> forms(const lattice::Points& x) const;
  std::vector<double> angles(const lattice::Points& x) const;
  Eigen::Vector3d normal(const lattice::Points& x, std::size_t triangle) const;
  double flip(const lattice::Points& skin, const lattice::Points& plain, std::size_t triangle) const;

  lattice::Points rest_;
  lattice::Triangles triangles_;
  /// Two triangles and the edge between them.
  struct Hinge {
    int triangle_a, triangle_b, vertex_a, vertex_b;
  };
  std::vector<Hinge> hinges_;
  std::vector<int> row_start_, neighbour_;  ///< of vertices, by edges.
  std::vector<double> edge_length_;         ///< of every neighbour at rest.
  double size_ = 0.0;                       ///< diagonal of the box at rest.
  double coarseness_ = 1.0;                 ///< by which creases may be deeper.
  std::vector<double> area_;                ///< of vertices at rest, a third of each triangle.
  std::vector<Form> rest_forms_;
  std::vector<double> rest_angles_;
};

}  // namespace sinew::fem
