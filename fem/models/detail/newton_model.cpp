#include "fem/models/detail/newton_model.h"

#include <utility>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "fem/models/balance.h"
#include "fem/models/detail/free_system.h"

namespace sinew::fem {
namespace {

using lattice::Points;

class NewtonModel final : public Model {
 public:
  NewtonModel(std::string name, const Body& body, std::unique_ptr<CellEnergy> energy,
              const NewtonOptions& options)
      : name_(std::move(name)),
        body_(body),
        energy_(std::move(energy)),
        options_(options),
        free_(free_vertices(body)),
        system_(body, free_),
        solver_(name_, body, free_, system_, *energy_, options) {}

  SolveReport prepare(double, Integrator) override { return {}; }

  SolveReport solve_stage(const StageProblem& problem, Points& velocity) override {
    const Balance balance = stage_balance(body_, problem);
    Points move = balance.guess;
    SolveReport report = solver_.solve(balance, options_.tolerance, move);
    if (report.ok()) refuse_below(0.0, balance.origin + move, report);
    if (report.ok()) velocity = move / (stage_of(problem.integrator).eta * problem.h);
    return report;
  }

  SolveReport equilibrate(const PoseProblem& problem, Points& x) override {
    const Balance balance = rest_balance(body_, problem, x);
    Points move = balance.guess;
    SolveReport report = solver_.solve(balance, options_.rest_tolerance, move);
    const Points solution = balance.origin + move;
    if (report.ok()) refuse_below(energy_->least_stretch(), solution, report);
    if (report.ok()) x = solution;
    return report;
  }

  CellForces cell_forces(const Points& x, const PosedFrames&) override {
    energy_->set_damping(0.0, {});
    CellForces result;
    result.energy.resize(body_.mesh.cells.size());
    result.force.resize(body_.mesh.cells.size());
    tbb::parallel_for(std::size_t{0}, body_.mesh.cells.size(), [&](std::size_t c) {
      const CellPoints corners = cell_points(x, body_.mesh.cells[c]);
      result.energy[c] = energy_->energy(static_cast<int>(c), corners);
      result.force[c] = energy_->gradient(static_cast<int>(c), corners);
    });
    return result;
  }

  SolverCounts counts() const override {
    SolverCounts counts;
    counts.regions = 1;
    counts.functions = body_.mesh.num_functions();
    counts.unknowns = {free_.num_unknowns()};
    counts.factor_nonzeros = solver_.factor_nonzeros();
    return counts;
  }

 private:
  /// A law that stops to resist being squeezed finds its balance in flesh that is turned inside out.
  void refuse_below(double stretch, const Points& x, SolveReport& report) const {
    if (energy_->least_stretch() == 0.0) return;
    const LeastStretch least = least_stretch(body_, x);
    if (least.stretch > stretch) return;
    report.status = SolveStatus::NoConvergence;
    report.cell = least.cell;
    report.message = fmt::format(
        "{}: collapsed, {} is squeezed to {:.3g} of its length and the law resists down to {:.3g} only; "
        "hint: "
        "neo-hookean",
        name_, place_of(body_, least.cell), least.stretch, energy_->least_stretch());
  }

  std::string name_;
  const Body& body_;
  std::unique_ptr<CellEnergy> energy_;
  NewtonOptions options_;
  FreeVertices free_;
  BlockSystem system_;
  NewtonSolver solver_;
};

}  // namespace

std::unique_ptr<Model> make_newton_model(std::string name, const Body& body,
                                         std::unique_ptr<CellEnergy> energy, const NewtonOptions& options) {
  return std::make_unique<NewtonModel>(std::move(name), body, std::move(energy), options);
}

}  // namespace sinew::fem
