#include "fem/models/detail/skin.h"

#include "fem/body/placement.h"
#include "fem/models/detail/rotated_stiffness.h"

namespace sinew::fem {
namespace {

class Skin final : public Model {
 public:
  explicit Skin(const Body& body) : body_(body) {}

  SolveReport prepare(double, Integrator) override { return {}; }

  SolveReport solve_stage(const StageProblem& p, lattice::Points& velocity) override {
    const double eta_h = stage_of(p.integrator).eta * p.h;
    velocity = (skinned_positions(body_, *p.poses.stage) - *p.x_h) / eta_h;
    return {};
  }

  SolveReport equilibrate(const PoseProblem& problem, lattice::Points& x) override {
    x = skinned_positions(body_, *problem.pose);
    return {};
  }

  /// As linear flesh would answer in the rotation of its frames.
  CellForces cell_forces(const lattice::Points& x, const PosedFrames& pose) override {
    return RotatedStiffness(body_).forces(x, frame_rotations(body_, pose), body_.mesh.points);
  }

  bool linear_in_frames() const override { return true; }

  SolverCounts counts() const override {
    SolverCounts counts;
    counts.functions = body_.mesh.num_functions();
    return counts;
  }

 private:
  const Body& body_;
};

}  // namespace

std::unique_ptr<Model> make_skin(const Body& body, const SolverOptions&) {
  return std::make_unique<Skin>(body);
}

}  // namespace sinew::fem
