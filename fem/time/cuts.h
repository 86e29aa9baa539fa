#pragma once

#include <vector>

#include "fem/body/frames.h"
#include "fem/time/motion.h"

/// Cuts: where a clip puts the whole body somewhere else and nobody means a motion. Between the keys of one
/// the body races across at any speed, and flesh that were simulated there would be thrown.
namespace sinew::fem {

/// An interval of a motion in which no time passes for the flesh: it keeps its place in its bones.
struct Cut {
  double begin = 0.0, end = 0.0;  ///< [s], begin <= end.
  double way = 0.0;               ///< from begin to end, of the frame in the middle of them all [m].
  bool stated = false;            ///< by the user, and not found.
};

/// A cut is no longer than this [s]: two frames at 20 frames per second.
inline constexpr double kLongestCut = 0.1;

/// The cuts of a motion that is interpolated between `keys` (ascending times [s]), of which at least two are
/// given. From one key to another one at most kLongestCut later nine frames in ten go a way of more than a
/// quarter of `size` (of the body [m]), at four times the speed that the body has before and after it, and so
/// far that to start and to stop on it takes more than twenty times the weight on Earth. A run or a fall has
/// its speed before or after, the swing of a sword leaves the other frames where they are, and no muscle
/// makes such a leap.
std::vector<Cut> find_cuts(const FrameTree& tree, double size, const Motion& motion,
                           const std::vector<double>& keys);

/// A cut that the user puts between two times, with all of every interval between keys that lies in it with a
/// part, as far as such an interval is no longer than kLongestCut.
Cut stated_cut(const FrameTree& tree, const Motion& motion, const std::vector<double>& keys, double begin,
               double end);

/// Whether some of [begin, end] [s] lies in a cut, with more than a point.
bool touches_cut(const std::vector<Cut>& cuts, double begin, double end);

}  // namespace sinew::fem
