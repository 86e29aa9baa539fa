#include "fem/time/energy_cap.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sinew::fem {
namespace {

/// Bones that are as they were but for the rounding of their rotations.
bool stand_still(const Body& body, const PosedFrames& now, const PosedFrames& next) {
  constexpr double kRounding = 1e-13;
  for (std::size_t f = 0; f < next.frames.size(); ++f) {
    const Eigen::Affine3d &from = now.frames[f].from_rest, &to = next.frames[f].from_rest;
    const Eigen::Vector3d& origin = body.tree.frames[f].origin_rest;
    if (!(to.linear() - from.linear()).isZero(kRounding) ||
        (to * origin - from * origin).norm() > kRounding * (body.size + (to * origin).norm()))
      return false;
  }
  return true;
}

}  // namespace

void EnergyCap::limit(const State& before, const PosedFrames& now, const PosedFrames& next,
                      const lattice::Points* force, State& after) {
  if (!stand_still(body_, now, next)) {
    forget();
    return;
  }
  double& cap = memory_.cap;
  if (!memory_.still) {
    memory_.still = next;
    stored_.emplace(body_, next, gravity_);
    cap = kinetic_energy(body_, before.v) + stored_->of(before.x);
  }
  if (force != nullptr) cap += force->cwiseProduct(after.x - before.x).sum();

  const double kinetic = kinetic_energy(body_, after.v), stored = stored_->of(after.x);
  if (kinetic + stored <= cap) return;
  ++memory_.taken.steps;
  if (stored <= cap) {
    after.v *= std::sqrt((cap - stored) / kinetic);
    memory_.taken.energy += kinetic + stored - cap;
    return;
  }
  // Stored energy is convex in the places of flesh in one pose, so that on the line between two places it is
  // at most what lies on the line between their energies.
  const double begin = stored_->of(before.x);
  const double share = std::clamp((cap - begin) / (stored - begin), 0.0, 1.0);
  after.x = before.x + share * (after.x - before.x);
  after.v.setZero();
  memory_.taken.energy += kinetic + stored - stored_->of(after.x);
}

void EnergyCap::recall(Memory memory) {
  memory_ = std::move(memory);
  if (memory_.still) stored_.emplace(body_, *memory_.still, gravity_);
}

}  // namespace sinew::fem
