#pragma once

#include <functional>

namespace sinew::lattice {

/// What long work calls again and again, many times a second, from the thread it was called in. To stop the
/// work it throws: what was made so far is dropped.
struct Poll {
  std::function<void()> ask = {};  ///< empty: nobody asks.

  void operator()() const {
    if (ask) ask();
  }
};

}  // namespace sinew::lattice
