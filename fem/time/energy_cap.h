#pragma once

#include <optional>

#include "fem/models/state.h"
#include "fem/report/measures.h"

/// Energy that a model makes out of nothing, and how it is taken out again.
namespace sinew::fem {

/// Blending the answers of several regions is not passive: their blend may push where neither region would,
/// and lightly damped flesh of a bent limb then gains energy that nothing put in. While the bones stand still
/// the flesh can have no more than it had when they stopped and what forces have done since: a passivity
/// observer and controller ([Hannaford02]) over whole steps.
class EnergyCap {
 public:
  /// What has been taken out so far.
  struct Taken {
    int steps = 0;        ///< that ended above the cap.
    double energy = 0.0;  ///< [J].
  };

  /// All that the cap goes on from.
  struct Memory {
    std::optional<PosedFrames> still;  ///< the pose of bones that stand still; empty while they move.
    double cap = 0.0;                  ///< [J].
    Taken taken;
  };

  /// `body` must outlive the cap.
  EnergyCap(const Body& body, const Eigen::Vector3d& gravity) : body_(body), gravity_(gravity) {}

  /// Limits what a step ends with: `before` at the pose `now`, `after` at the pose `next`; `force`: of the
  /// step, num_vertices x 3 [N], null for none. Takes the excess from the velocity; where that has less,
  /// flesh without velocity stops on its way where its stored energy reaches the cap. Does nothing, and costs
  /// next to nothing, where a bone moves.
  void limit(const State& before, const PosedFrames& now, const PosedFrames& next,
             const lattice::Points* force, State& after);

  /// The bones jumped: what the flesh had before says nothing any more.
  void forget() { memory_.still.reset(); }

  const Taken& taken() const { return memory_.taken; }
  const Memory& memory() const { return memory_; }
  void recall(Memory memory);

 private:
  const Body& body_;
  Eigen::Vector3d gravity_;
  Memory memory_;
  std::optional<StoredEnergy> stored_;  ///< in the pose of bones that stand still.
};

}  // namespace sinew::fem
