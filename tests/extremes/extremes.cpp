#include "tests/extremes/extremes.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

namespace sinew::tests {

#ifdef SINEW_NIGHTLY
const bool kNightly = true;
#else
const bool kNightly = false;
#endif

namespace {

std::filesystem::path folder() {
  const std::filesystem::path path = std::filesystem::path(SINEW_BINARY_DIR) / "extremes";
  return kNightly ? path / "nightly" : path;
}

/// Holds extremes/.lock while it lives: tests of one program may run at the same time.
class TableLock {
 public:
  TableLock() : file_(open((folder() / ".lock").c_str(), O_CREAT | O_RDWR, 0644)) { flock(file_, LOCK_EX); }
  ~TableLock() { close(file_); }
  TableLock(const TableLock&) = delete;
  TableLock& operator=(const TableLock&) = delete;

 private:
  int file_;
};

/// In the order of the catalogue: X2 before X12, `held` last.
int place_of_row(const std::string& row) { return row.starts_with("X") ? std::atoi(row.c_str() + 1) : 1000; }

/// Every row's file opens with its counts: "<!-- springs 9 0 0.31; blended 8 1 0.02; -->".
void write_summary() {
  std::map<std::pair<int, std::string>, std::string> rows;
  for (const auto& entry : std::filesystem::directory_iterator(folder())) {
    const std::string row = entry.path().stem().string();
    if (entry.path().extension() != ".md" || row == "table") continue;
    std::ifstream file(entry.path());
    std::string counts;
    std::getline(file, counts);
    rows[{place_of_row(row), row}] = counts;
  }
  std::string text = "# Extremes: runs that passed, runs that ended by a name, processor time\n\n| row |";
  for (const std::string& rung : dynamic_rungs()) text.append(" ").append(rung).append(" |");
  text += "\n|---|";
  for (std::size_t k = 0; k < dynamic_rungs().size(); ++k) text += "---|";
  text += "\n";
  for (const auto& [key, counts] : rows) {
    text += fmt::format("| [{0}]({0}.md) |", key.second);
    for (const std::string& rung : dynamic_rungs()) {
      std::istringstream words(counts);
      std::string word, cell = " - |";
      while (words >> word) {
        int passed = 0, named = 0;
        double seconds = 0.0;
        if (word != rung || !(words >> passed >> named >> seconds)) continue;
        cell = named > 0 ? fmt::format(" {} passed, {} named, {:.2g} s |", passed, named, seconds)
                         : fmt::format(" {} passed, {:.2g} s |", passed, seconds);
      }
      text += cell;
    }
    text += "\n";
  }
  std::ofstream(folder() / "table.md") << text;
}

/// The energy of flesh whose bones stand still, from step to step.
class HeldEnergy {
 public:
  /// Flesh is let go as it is, before the first step that is seen.
  void let_go(const fem::Measures& m) { first_ = energy_of(m); }
  /// `noise`: what rounding may make of it [J].
  void see(const fem::Measures& m, double noise) {
    const double energy = energy_of(m);
    noise_ = std::max(noise_, noise);
    if (++count_ == 1) most_ = least_ = energy;
    // The first step of BDF2 is carried on past its stage: what it ends with is what there is to lose.
    if (count_ == 1) first_ = std::max(first_, energy);
    most_ = std::max(most_, energy);
    least_ = std::min(least_, energy);
    rise_ = std::max(rise_, energy - least_);
    scale_ = std::max({scale_, m.kinetic, std::abs(m.elastic + m.ties)});
  }
  double growth() const { return share(most_ - first_); }
  double rise() const { return share(rise_); }

 private:
  static double energy_of(const fem::Measures& m) {
    return m.kinetic + m.elastic + m.potential + m.ties + m.ghost;
  }
  double share(double energy) const { return energy > noise_ ? (energy - noise_) / scale_ : 0.0; }

  int count_ = 0;
  double first_ = -std::numeric_limits<double>::infinity();
  double most_ = 0.0, least_ = 0.0, rise_ = 0.0, scale_ = 0.0, noise_ = 0.0;
};

}  // namespace

std::vector<std::string> dynamic_rungs() {
  std::vector<std::string> names;
  for (const fem::ModelInfo& model : fem::models()) {
    if (model.dynamic) names.emplace_back(model.name);
  }
  return names;
}

std::vector<std::string> element_rungs() {
  std::vector<std::string> names = dynamic_rungs();
  std::erase(names, "springs");
  return names;
}

std::string name_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::BackwardEuler:
      return "backward-euler";
    case Integrator::TrBdf2:
      return "tr-bdf2";
    case Integrator::ImplicitMidpoint:
      return "implicit-midpoint";
    case Integrator::Bdf2:
      break;
  }
  return "bdf2";
}

Extreme run_extreme(Simulation& simulation, double step, int steps, double held_from,
                    const std::function<void(const Simulation&)>& look) {
  Extreme result;
  double stiffness = 0.0;  ///< E V of all cells: what the rounding of an elastic energy goes with [J].
  const Body& body = simulation.body();
  const double size = body.size;
  for (const fem::Material& material : body.materials)
    stiffness += material.young * body.volume / static_cast<double>(body.materials.size());
  const std::clock_t start = std::clock();
  const double begin = simulation.flesh().time;
  HeldEnergy held;
  if (begin >= held_from) held.let_go(simulation.measures_at(begin));
  for (int k = 1; k <= steps; ++k) {
    // To the end of the k-th step, whatever its parts, and not by rounding to the next one's.
    const fem::SimulationReport report = simulation.advance_to(begin + (k - 1e-3) * step);
    result.steps += report.steps;
    result.x = simulation.flesh().x;
    result.v = simulation.flesh().v;
    result.time = simulation.flesh().time;
    if (report.status != fem::SimulationStatus::Ok) {
      result.failure = report.message.empty() ? "(no name)" : report.message;
      EXPECT_FALSE(report.message.empty());
      break;
    }
    if (!result.x.allFinite() || !result.v.allFinite()) {
      ADD_FAILURE() << "a number that is none, and no failure, in step " << k;
      return result;
    }
    const fem::Measures m = simulation.measures_at(result.time);
    // Bones are exact to the last digits of where they are.
    const double extent = result.x.rowwise().norm().maxCoeff();
    EXPECT_LE(m.bone_residual, 1e-15 * extent) << "step " << k;
    result.energy = m.kinetic + m.elastic + m.potential + m.ties + m.ghost;
    result.elastic = std::max(result.elastic, m.elastic);
    result.inverted = m.inverted_cells;
    if (4 * k <= steps) result.early = std::max(result.early, m.kinetic);
    if (4 * k > 3 * steps) result.late = std::max(result.late, m.kinetic);
    if (result.time >= held_from) {
      // Balances hold to 1e-6 of the forces, so energies to the square of that.
      held.see(m, 1e-12 * std::abs(m.elastic) +
                      16.0 * std::numeric_limits<double>::epsilon() *
                          (stiffness * std::max(1.0, extent / size) + m.kinetic + std::abs(m.potential) +
                           result.x.cwiseProduct(fem::apply_tie(body.matrices, result.x)).sum()));
      result.growth = held.growth();
      result.rise = held.rise();
    }
    if (look) look(simulation);
  }
  result.ok = result.failure.empty();
  result.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  return result;
}

Extreme run_extreme(const ExtremeScene& scene, const std::function<void(const Simulation&)>& look,
                    bool twice) {
  const auto run = [&](const std::function<void(const Simulation&)>& seen) {
    Simulation simulation(scene.body, scene.motion, 0.0, scene.options);
    if (scene.velocity.rows() > 0) simulation.set_velocity(scene.velocity);
    return run_extreme(simulation, scene.options.step, scene.steps, scene.held_from, seen);
  };
  Extreme first = run(look);
  if (twice) {
    const Extreme second = run({});
    EXPECT_EQ(first.failure, second.failure);
    EXPECT_TRUE(first.x == second.x && first.v == second.v) << "another result the second time";
  }
  return first;
}

Points rest_of(const Body& body, const std::string& rung, const Eigen::Vector3d& gravity) {
  fem::EquilibriumOptions options;
  options.model = rung;
  options.gravity = gravity;
  const fem::Equilibrium rest =
      fem::find_equilibrium(body, fem::held_pose({Eigen::Affine3d::Identity()}), options);
  EXPECT_TRUE(rest.report.ok()) << rung << ": " << rest.report.message;
  return rest.x;
}

Eigen::Affine3d turned(double degrees) {
  return Eigen::Affine3d(Eigen::AngleAxisd(degrees * kDegree, Eigen::Vector3d::UnitY()));
}

Points moved(const Body& body, const Eigen::Affine3d& base) {
  return (body.mesh.points * base.linear().transpose()).rowwise() + base.translation().transpose();
}

BarOptions short_bar_options(const fem::Material& material, const fem::Damping& damping, double size) {
  BarOptions options;
  options.box.min = Eigen::Vector3d(0.0, -0.2, -0.2) * size;
  options.box.max = Eigen::Vector3d(1.0, 0.2, 0.2) * size;
  options.box.blocks = {2, 1, 1};
  options.material = material;
  options.damping = damping;
  return options;
}

Body short_bar(const fem::Material& material, const fem::Damping& damping, double size) {
  return bar_body(short_bar_options(material, damping, size));
}

SimulationOptions extreme_options(const std::string& model, double step, const Eigen::Vector3d& gravity,
                                  Integrator integrator) {
  SimulationOptions options;
  options.model = model;
  options.step = step;
  options.gravity = gravity;
  options.integrator = integrator;
  return options;
}

Arm small_arm() { return make_arm(lattice::CellType::Hexahedron, 0, 2); }

Body small_arm_body(const Arm& arm, double largest_bend) {
  fem::BodyOptions options;
  options.levels = 0;
  return arm_body(arm, largest_bend, options);
}

Modes modes_of(const Body& body) {
  Modes modes;
  modes.system = free_system(body);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(modes.system.stiffness), Eigen::MatrixXd(modes.system.mass));
  modes.omega = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  modes.shape = eigen.eigenvectors();
  return modes;
}

double distance(const Points& a, const Points& b, double size) {
  return (a - b).rowwise().norm().maxCoeff() / size;
}

double largest(const Points& a) { return a.rowwise().norm().maxCoeff(); }

ExtremesTable::ExtremesTable(std::string row, std::string asks)
    : row_(std::move(row)), asks_(std::move(asks)) {}

ExtremesTable::~ExtremesTable() {
  std::string text = "<!--";
  for (const auto& [rung, count] : counts_)
    text += fmt::format(" {} {} {} {:.2g} ;", rung, count.passed, count.named, count.seconds);
  text += fmt::format(" -->\n# {}\n\n{}\n\n", row_, asks_);
  for (const auto& [rungs, why] : excuses_) text += fmt::format("- Not asked of {}: {}\n", rungs, why);
  if (!excuses_.empty()) text += "\n";
  text += "| setting | rung | outcome | s | measured |\n|---|---|---|---|---|\n";
  for (const Line& l : lines_)
    text +=
        fmt::format("| {} | {} | {} | {:.2g} | {} |\n", l.setting, l.rung, l.outcome, l.seconds, l.measured);
  std::filesystem::create_directories(folder());
  const TableLock lock;
  std::ofstream(folder() / (row_ + ".md")) << text;
  write_summary();
}

void ExtremesTable::add(const std::string& setting, const std::string& rung, const Extreme& run, bool must) {
  count(setting, rung, run);
  if (run.ok) lines_.push_back({setting, rung, "passed", "", run.seconds});
  EXPECT_TRUE(run.ok || !must) << row_ << ", " << rung << ", " << setting << ": " << run.failure;
}

void ExtremesTable::count(const std::string& setting, const std::string& rung, const Extreme& run) {
  Count& count = counts_[rung];
  ++(run.ok ? count.passed : count.named);
  count.seconds += run.seconds;
  if (!run.ok) lines_.push_back({setting, rung, "named: " + run.failure, "", run.seconds});
}

void ExtremesTable::at_most(const std::string& what, double value, double limit) {
  Line& line = lines_.back();
  EXPECT_LE(value, limit) << row_ << ", " << line.rung << ", " << line.setting << ": " << what;
  line.measured +=
      fmt::format("{}{} {:.2g} (at most {:.2g})", line.measured.empty() ? "" : "; ", what, value, limit);
}

void ExtremesTable::note(const std::string& what, double value) {
  std::string& measured = lines_.back().measured;
  measured += fmt::format("{}{} {:.2g}", measured.empty() ? "" : "; ", what, value);
}

void ExtremesTable::excuse(const std::string& rungs, const std::string& why) {
  excuses_.emplace_back(rungs, why);
}

}  // namespace sinew::tests
