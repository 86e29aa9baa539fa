#include "fem/models/blended.h"

#include "fem/blended_solver.h"

namespace sinew::fem {
namespace {

class Blended final : public Model {
 public:
  Blended(const Body& body, const SolverOptions& options) : solver_(body, options) {}

  SolveReport prepare(double h, Integrator integrator) override {
    const Factor::Report factor = solver_.prepare(h, integrator);
    SolveReport report;
    report.message = factor.message;
    if (!factor.ok) report.status = SolveStatus::NotPositiveDefinite;
    return report;
  }

  SolveReport solve_stage(const StageProblem& p, lattice::Points& velocity) override {
    velocity =
        solver_.stage_velocity(*p.state, *p.x_h, *p.v_h, p.poses, p.h, p.integrator, p.gravity, p.use_past);
    return {};
  }

  SolverCounts counts() const override { return solver_.counts(); }

 private:
  BlendedSolver solver_;
};

}  // namespace

std::unique_ptr<Model> make_blended(const Body& body, const SolverOptions& options) {
  return std::make_unique<Blended>(body, options);
}

}  // namespace sinew::fem
