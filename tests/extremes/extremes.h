#pragma once

#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "fem/models/model.h"
#include "fem/time/equilibrium.h"
#include "fem/time/simulation.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

/// Settings far from ordinary, on every rung that moves. Whatever they are, a run ends well or with a failure
/// that has a name, and no number that it gives is infinite or none. Every row of the catalogue is one test
/// and writes what became of it to extremes/<row>.md in the build folder (extremes/nightly/ of the long
/// runs), and table.md beside it says how all rows stand on every rung.
namespace sinew::tests {

using fem::Body;
using fem::Integrator;
using fem::Motion;
using fem::Simulation;
using fem::SimulationOptions;
using lattice::Points;

/// True in the program that runs at night: as long and as many runs as are wanted, not as fit.
extern const bool kNightly;

inline constexpr double kFrame = 1.0 / 60.0;                       ///< [s].
inline const fem::Material kFirm{1e6, 0.3, 1000.0};                ///< of the short bar: 2 Hz.
inline const fem::Damping kDamped{0.1, 2.0};                       ///< a tenth of critical there.
inline const fem::Damping kCritical{1.0, 2.0};                     ///< a second leaves exp(-12.6).
inline const Eigen::Vector3d kNoWeight = Eigen::Vector3d::Zero();  ///< [m/s^2].
inline const Eigen::Vector3d kWeight{0.0, 0.0, -1.0};              ///< sags the short bar by 6 mm.

std::vector<std::string> dynamic_rungs();
/// The finite-element rungs: at small strain all of them are the same linear body.
std::vector<std::string> element_rungs();

std::string name_of(Integrator integrator);

/// A run to make.
struct ExtremeScene {
  const Body& body;
  Motion motion;
  SimulationOptions options;
  int steps = 0;
  /// From when the bones stand still, if they do: the energy of the flesh must not grow from there [s].
  double held_from = std::numeric_limits<double>::infinity();
  Points velocity{};  ///< at the start; empty: none.
};

/// What became of a run.
struct Extreme {
  bool ok = false;       ///< it ran to its end.
  std::string failure;   ///< else its name.
  Points x, v;           ///< at the end, or the last good ones.
  double time = 0.0;     ///< then [s].
  double energy = 0.0;   ///< then: kinetic, elastic and potential [J].
  double elastic = 0.0;  ///< the largest of all steps [J].
  double early = 0.0;    ///< largest kinetic energy in the first quarter of the steps [J].
  double late = 0.0;     ///< and in the last [J].
  /// By how much the energy rose over that with which the flesh was let go, or which it had after the first
  /// step on, over the largest kinetic or stored energy since [-].
  double growth = 0.0;
  double rise = 0.0;     ///< and over the least energy before, in the same measure [-].
  int inverted = 0;      ///< cells at the end.
  int steps = 0;         ///< taken, parts of steps included.
  double seconds = 0.0;  ///< processor time.
};

/// Runs `steps` steps and asks at each of them what holds for every run: finite numbers, bones in their
/// places, a name for every failure. `look` is called after every step that went well.
Extreme run_extreme(Simulation& simulation, double step, int steps,
                    double held_from = std::numeric_limits<double>::infinity(),
                    const std::function<void(const Simulation&)>& look = {});
/// The same from the start of a scene, and once more where the bits are to be the same the second time: every
/// scene of the nightly runs.
Extreme run_extreme(const ExtremeScene& scene, const std::function<void(const Simulation&)>& look = {},
                    bool twice = kNightly);

/// Where flesh rests under gravity on bones in their rest pose; a failure of the test where there is no rest.
Points rest_of(const Body& body, const std::string& rung, const Eigen::Vector3d& gravity);

inline std::vector<Eigen::Affine3d> still_base(double) { return {Eigen::Affine3d::Identity()}; }
/// About the y axis.
Eigen::Affine3d turned(double degrees);
/// The rest shape moved by a map.
Points moved(const Body& body, const Eigen::Affine3d& base);

/// A short bar, 1 x 0.4 x 0.4 m of 4 x 2 x 2 leaf cells, clamped at x = 0.
BarOptions short_bar_options(const fem::Material& material, const fem::Damping& damping, double size = 1.0);
Body short_bar(const fem::Material& material, const fem::Damping& damping, double size = 1.0);

SimulationOptions extreme_options(const std::string& model, double step, const Eigen::Vector3d& gravity,
                                  Integrator integrator = Integrator::Bdf2);

/// A small arm: two bones of two cells each.
Arm small_arm();
Body small_arm_body(const Arm& arm, double largest_bend);

/// Natural modes of a bar on its clamp, without damping, lowest first.
struct Modes {
  Eigen::VectorXd omega;  ///< [rad/s].
  Eigen::MatrixXd shape;  ///< columns over the free unknowns, normalised by the mass.
  FreeSystem system;

  /// A mode at the leaf vertices.
  Points at_leaves(Eigen::Index mode) const { return leaf_values(system, shape.col(mode)); }
};
Modes modes_of(const Body& body);

/// Largest distance of two placements over `size`.
double distance(const Points& a, const Points& b, double size = 1.0);
/// Largest row.
double largest(const Points& a);

/// What became of one row of the catalogue on every rung: a file in the build folder.
class ExtremesTable {
 public:
  /// `asks`: what the catalogue asks of the row, in words.
  ExtremesTable(std::string row, std::string asks);
  ~ExtremesTable();
  ExtremesTable(const ExtremesTable&) = delete;
  ExtremesTable& operator=(const ExtremesTable&) = delete;

  /// A run that passed or failed by a name. `must`: failing is a failure of the test.
  void add(const std::string& setting, const std::string& rung, const Extreme& run, bool must = true);
  /// The same without a line of its own where it passed: for rows of thousands of runs.
  void count(const std::string& setting, const std::string& rung, const Extreme& run);
  /// A number of the last line's run and what it may be at most.
  void at_most(const std::string& what, double value, double limit);
  /// A number of it that nothing is asked of.
  void note(const std::string& what, double value);
  /// A criterion that does not apply or does not hold, and why.
  void excuse(const std::string& rungs, const std::string& why);

 private:
  struct Line {
    std::string setting, rung, outcome, measured;
    double seconds = 0.0;
  };
  struct Count {
    int passed = 0, named = 0;
    double seconds = 0.0;
  };
  std::string row_, asks_;
  std::vector<Line> lines_;
  std::map<std::string, Count> counts_;
  std::vector<std::pair<std::string, std::string>> excuses_;
};

}  // namespace sinew::tests
