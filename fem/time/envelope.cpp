#include "fem/time/envelope.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

namespace sinew::fem {
namespace {

/// The ends of every bone of the lattice in a pose.
std::vector<Eigen::Vector3d> bone_ends(const Body& body, const std::vector<Eigen::Affine3d>& pose) {
  std::vector<Eigen::Vector3d> ends;
  for (const lattice::LatticeBone& bone : body.lattice.bones) {
    for (const lattice::BoneAnchor* anchor : {&bone.start, &bone.end}) {
      const double s = anchor == &bone.start ? 0.0 : 1.0;
      ends.push_back((1.0 - s) * (pose[static_cast<std::size_t>(anchor->joint_a)] * anchor->x_a) +
                     s * (pose[static_cast<std::size_t>(anchor->joint_b)] * anchor->x_b));
    }
  }
  return ends;
}

/// The largest of one kind so far, and where.
struct Worst {
  double value = 0.0, time = 0.0;
  std::string name;

  void see(double candidate, double at, const std::string& bone) {
    if (!(candidate > value)) return;
    value = candidate;
    time = at;
    name = bone;
  }
};

/// Slowest speed of sound along a bar of the body's flesh [m/s].
double slowest_sound(const Body& body) {
  double slowest = std::numeric_limits<double>::infinity();
  for (const Material& m : body.materials) slowest = std::min(slowest, std::sqrt(m.young / m.density));
  return slowest;
}

/// Most oblong cell of the lattice: longest edge over shortest.
std::pair<std::size_t, double> most_oblong(const lattice::CellComplex& complex) {
  std::pair<std::size_t, double> worst{0, 1.0};
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    const lattice::Cell& cell = complex.cells[c];
    double shortest = std::numeric_limits<double>::infinity(), longest = 0.0;
    for (const std::array<int, 2>& edge : lattice::cell_edges(cell.type)) {
      const auto corner = [&](std::size_t k) {
        return complex.points.row(cell.vertices[static_cast<std::size_t>(edge[k])]);
      };
      const double length = (corner(1) - corner(0)).norm();
      shortest = std::min(shortest, length);
      longest = std::max(longest, length);
    }
    if (longest / shortest > worst.second) worst = {c, longest / shortest};
  }
  return worst;
}

}  // namespace

std::vector<std::string> outside_envelope(const Body& body, const Motion& motion,
                                          const SimulationOptions& options, double first, long steps) {
  const double step = options.step;
  Worst turn, jump, jolt, stretch, squeeze;
  PosedFrames before;
  std::vector<Eigen::Vector3d> ends_before, moved_before;
  bool followed = false;  // in the step before flesh followed its bones: no start, and no cut
  for (long k = 0; k <= steps; ++k) {
    const double time = first + static_cast<double>(k) * step;
    const PosedFrames now = pose_frames(body.tree, motion(time), time);
    const std::vector<Eigen::Vector3d> ends = bone_ends(body, now.joints);
    std::vector<Eigen::Vector3d> moved(ends.size(), Eigen::Vector3d::Zero());
    const bool follows = k > 0 && !touches_cut(options.cuts, time - step, time);
    for (std::size_t b = 0; b < body.lattice.bones.size(); ++b) {
      const lattice::LatticeBone& bone = body.lattice.bones[b];
      const double length = (bone.rest_end - bone.rest_start).norm();
      const double posed = (ends[2 * b + 1] - ends[2 * b]).norm();
      stretch.see(posed / length, time, bone.name);
      squeeze.see(length / posed, time, bone.name);
      if (!follows) continue;
      for (std::size_t e : {2 * b, 2 * b + 1}) {
        moved[e] = ends[e] - ends_before[e];
        jump.see(moved[e].norm() / body.size, time, bone.name);
        if (followed) jolt.see((moved[e] - moved_before[e]).norm() / step, time, bone.name);
      }
    }
    for (std::size_t f = 0; follows && f < now.frames.size(); ++f) {
      const double chord = (now.frames[f].rotation - before.frames[f].rotation).norm();
      turn.see(2.0 * std::asin(std::min(1.0, chord / std::sqrt(8.0))) * 180.0 / std::numbers::pi, time,
               body.tree.frames[f].name);
    }
    before = now;
    ends_before = ends;
    moved_before = moved;
    followed = follows;
  }

  std::vector<std::string> warnings;
  const auto warn = [&](const Worst& worst, double limit, const std::string& what) {
    if (worst.value > limit)
      warnings.push_back(
          fmt::format("bone '{}': {} in the step to {:.4g} s, where every model is tested up "
                      "to {:.3g}",
                      worst.name, what, worst.time, limit));
  };
  if (const auto [cell, aspect] = most_oblong(body.lattice.complex); aspect > kTestedAspect)
    warnings.push_back(
        fmt::format("lattice cell {}: its longest edge is {:.3g} times its shortest, where every "
                    "model is tested up to {:g}",
                    cell, aspect, kTestedAspect));
  const double sound = slowest_sound(body);  // sqrt(E / rho)
  const double weight = options.gravity.norm() * body.size / (sound * sound);
  const double bears = options.model == "stvk" ? kTestedWeightOfStvk : kTestedWeight;
  if (weight > bears)
    warnings.push_back(
        fmt::format("model {}: the weight of the flesh, rho g size / E, is {:.3g}, where it is "
                    "tested up to {:g}",
                    options.model, weight, bears));
  // Rounding of a motion by exactly the limit is not outside of it.
  warn(turn, kTestedTurn * (1.0 + 1e-9), fmt::format("turns by {:.3g} degrees", turn.value));
  warn(jump, kTestedJump * (1.0 + 1e-9),
       fmt::format("jumps by {:.3g} sizes of the body, so the flesh is carried along,", jump.value));
  warn(jolt, (options.model == "stvk" ? kTestedJoltOfStvk : kTestedJolt) * sound,
       fmt::format("changes its velocity by {:.3g} m/s ({:.3g} times sound in the flesh)", jolt.value,
                   jolt.value / sound));
  warn(stretch, kTestedStretch * (1.0 + 1e-9),
       fmt::format("is drawn to {:.3g} times its length", stretch.value));
  const double least = options.model == "stvk" ? kTestedSqueezeOfStvk : kTestedSqueeze;
  warn(squeeze, (1.0 + 1e-9) / least,
       fmt::format("is squeezed to one part in {:.3g} of its length", squeeze.value));
  return warnings;
}

}  // namespace sinew::fem
