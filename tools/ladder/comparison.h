#pragma once

#include <vector>

#include "assets/result.h"

/// How far two results of one character are apart.
namespace sinew::tools {

/// One frame; distances between equal vertices [m].
struct FrameDifference {
  int frame = 0;
  double rms = 0.0;  ///< root of the mean square over all vertices.
  double largest = 0.0;
  int vertex = 0;  ///< where it is; the first of several.
};

struct Comparison {
  std::vector<FrameDifference> frames;  ///< those that both results have; at least one.
  double rms = 0.0;                     ///< over all vertices of all frames [m].
  double largest = 0.0;                 ///< [m]
  int vertex = 0, frame = 0;            ///< where it is; the first of several.
  double height = 0.0;                  ///< of the first result [m].
};

/// The difference of one frame. Both num_vertices x 3 [m].
FrameDifference difference(int frame, const lattice::Points& a, const lattice::Points& b);

/// Compares the frames that both have. Throws assets::InputError naming `b` where it is no result of the same
/// mesh: other vertex counts, rest shapes that differ by more than the rounding of the floats they are stored
/// in, other frame rates, no common frame.
Comparison compare(const assets::Result& a, const assets::Result& b);

}  // namespace sinew::tools
