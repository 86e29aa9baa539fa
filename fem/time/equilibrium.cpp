#include "fem/time/equilibrium.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "fem/body/placement.h"
#include "fem/linear/anderson_mixing.h"
#include "fem/models/balance.h"

namespace sinew::fem {

using lattice::Points;

void EquilibriumOptions::validate() const {
  const auto require = [](bool holds, const char* field, double value, const char* rule) {
    if (!holds) throw std::invalid_argument(fmt::format("{}: got {:g}, expected {}", field, value, rule));
  };
  require(gravity.allFinite(), "gravity", gravity.norm(), "finite numbers");
  require(steps >= 1, "load steps", steps, ">= 1");
  require(max_halvings >= 0 && max_halvings <= 30, "load step halvings", max_halvings, "0 to 30");
  if (find_model(model) == nullptr)
    throw std::invalid_argument("model: got " + model + ", expected a name of the registry");
}

PosePath held_pose(std::vector<Eigen::Affine3d> pose_from_rest) {
  return [pose = std::move(pose_from_rest)](double) { return pose; };
}

Equilibrium find_equilibrium(const Body& body, const PosePath& path, const EquilibriumOptions& options) {
  options.validate();
  const std::unique_ptr<Model> model = find_model(options.model)->make(body, options.solver);
  const LoadForces forces(body, options.loads);
  const auto pose_at = [&](double factor) { return pose_frames(body.tree, path(factor), factor); };

  Equilibrium result;
  result.pose = pose_at(0.0);
  result.x = skinned_positions(body, result.pose);
  const auto try_factor = [&](double factor) {
    const PosedFrames pose = pose_at(factor);
    // The flesh rides on its frames to where the next pose begins.
    Points x = carried(body, result.x, result.pose, pose);
    SolveReport report;
    // A pressure follows the surface: its forces are taken where the flesh stands, until that stays put. On
    // slender flesh plain repetition drifts apart: the tip of a bar turns further than the force that turned
    // it.
    constexpr int kMostTurns = 100;
    detail::AndersonMixing mixing(8);
    Points place = x;  // where the pressure is taken
    int hardest = 0;   // turn, in iterations: what the next load step goes by
    for (int turn = 0; turn < kMostTurns; ++turn) {
      const Points force = factor * forces.at(place);
      report = model->equilibrate({&pose, factor * options.gravity, &force}, x);
      if (!report.ok()) return report;
      report.iterations = hardest = std::max(hardest, report.iterations);
      if (!forces.follow() || (x - place).cwiseAbs().maxCoeff() < 1e-11 * body.size) break;
      if (turn + 1 == kMostTurns) {
        report.status = SolveStatus::NoConvergence;
        report.message = options.model + ": pressure and flesh do not settle on one shape";
        return report;
      }
      place += mixing.step(x - place);
    }
    result.x = std::move(x);
    result.pose = pose;
    return report;
  };

  double step = 1.0 / options.steps;
  const double smallest = step * std::exp2(-options.max_halvings);
  while (result.load_factor < 1.0) {
    // The last step ends at 1 itself.
    const double wanted = result.load_factor + step;
    const double factor = wanted > 1.0 - 1e-9 ? 1.0 : wanted;
    if (options.before_step) options.before_step(result.load_factor);
    result.report = try_factor(factor);
    if (result.report.ok()) {
      result.load_factor = factor;
      ++result.load_steps;
      if (result.report.iterations <= 6) step *= 2.0;
      continue;
    }
    step *= 0.5;
    if (step >= smallest) continue;
    result.report.message += fmt::format("; no rest beyond load factor {:.4g}", result.load_factor);
    return result;
  }
  return result;
}

}  // namespace sinew::fem
