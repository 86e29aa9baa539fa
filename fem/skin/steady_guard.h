#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "fem/skin/skin_guard.h"
#include "fem/skin/steady_weights.h"

/// The skin guard for frames in a row.
namespace sinew::fem {

/// What one frame asks of SkinGuard is nothing to the next, so skin that is laid back frame by frame pops.
/// Here weights fade in before the frame that needs them and out after it (SteadyWeights). Weights that are
/// on their way leave rims of their own, so what a look leaves is looked for again, and what that adds fades
/// in the same way. Weights of a frame depend on `lookahead` frames on either side.
class SteadyGuard {
 public:
  /// The first look finds what the flesh asks for, the others rims: without a second one Fox, lumberjack and
  /// bird are torn or rough, without a third one the Spider's attack.
  static constexpr int kLooks = 3;

  /// `guard` must outlive it. `reach`: frames over which weights rise and fall; >= 0, 0: each by itself.
  /// `looks` >= 1.
  SteadyGuard(const SkinGuard& guard, int reach, int looks = kLooks)
      : guard_(&guard), looks_(static_cast<std::size_t>(looks), Look(reach)) {}

  /// How many frames must be seen after one before it can be mended, unless none will follow.
  int lookahead() const { return static_cast<int>(looks_.size()) * looks_.front().weights.lookahead(); }
  /// The next frame as the flesh has it; as SkinGuard::weigh.
  void see(const lattice::Points& plain, const lattice::Points& flesh);
  /// The first frame that was seen and not mended: `skin` becomes its mended flesh.
  Mended mend_next(lattice::Points& skin);

 private:
  struct Frame {
    lattice::Points plain, flesh;
    GuardWeights by;  ///< what the looks so far have found.
  };
  struct Look {
    explicit Look(int reach) : weights(reach), pulls(reach) {}
    SteadyWeights weights, pulls;
    std::deque<Frame> frames;  ///< whose weights this look has not made steady.
  };
  void look(std::size_t number, Frame frame);
  Frame pass_on(std::size_t number);

  const SkinGuard* guard_;
  std::vector<Look> looks_;
};

}  // namespace sinew::fem
