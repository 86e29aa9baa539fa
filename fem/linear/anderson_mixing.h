#pragma once

#include <cstddef>
#include <deque>

#include "lattice/points.h"

namespace sinew::fem::detail {

/// Anderson's mixing for a zero of g ([Anderson65]): the combination of the last steps whose g is least, and
/// from there a whole step of that g.
class AndersonMixing {
 public:
  /// Looks back over at most `depth` steps; >= 1.
  explicit AndersonMixing(std::size_t depth) : depth_(depth) {}

  /// What to add to the present point, where g is `g`; of the same size in every call.
  lattice::Points step(const lattice::Points& g);

 private:
  struct Change {
    lattice::Points x, g;
  };
  lattice::Points remember(const lattice::Points& g, const lattice::Points& move);

  std::size_t depth_;
  std::deque<Change> changes_;
  lattice::Points last_g_, last_step_;
};

}  // namespace sinew::fem::detail
