// Scenes of everything at random, in the envelope, at its corners and far outside of it.

#include <random>

#include "fem/time/envelope.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

/// Every setting that a scene of this file has.
struct Settings {
  std::string rung;
  Integrator integrator = Integrator::Bdf2;
  fem::Material material;
  fem::Damping damping;
  double step = kFrame;   ///< [s].
  double bend = 0.0;      ///< largest turn of the base or elbow [rad].
  double rate = 1.0;      ///< of its swing [rad/s].
  double gravity = 9.81;  ///< [m/s^2].
  bool elbow = false;     ///< else the short bar.

  std::string words() const {
    return fmt::format(
        "E {:.3g}, nu {:.3g}, rho {:.3g}, zeta {:.3g} at {:.3g} Hz, h {:.3g}, bend {:.3g} degrees at {:.3g} "
        "rad/s, "
        "g {:.3g}, {}, {}",
        material.young, material.poisson, material.density, damping.ratio, damping.frequency, step,
        bend / kDegree, rate, gravity, elbow ? "elbow" : "bar", name_of(integrator));
  }
};

Extreme run_settings(const Settings& s, const Arm& arm, int steps, bool twice) {
  fem::BodyOptions options;
  options.levels = 0;
  options.material = s.material;
  options.damping = s.damping;
  const std::vector<std::vector<Eigen::Affine3d>> poses{arm_pose(0.0), arm_pose(s.bend)};
  const Body body = s.elbow ? fem::make_body({arm.lattice, arm.skin, arm.skeleton, poses}, options)
                            : short_bar(s.material, s.damping);
  const Motion motion = [&](double time) -> std::vector<Eigen::Affine3d> {
    const double angle = s.bend * std::sin(s.rate * time);
    if (s.elbow) return arm_pose(angle);
    return {Eigen::Affine3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()))};
  };
  return run_extreme(
      {body, motion, extreme_options(s.rung, s.step, {0.0, -s.gravity, 0.0}, s.integrator), steps}, {},
      twice);
}

/// Numbers that are the same on every machine, unlike std::uniform_real_distribution's.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : rng_(seed) {}
  double unit() { return static_cast<double>(rng_() >> 11) * 0x1p-53; }
  double log_uniform(double low, double high) { return low * std::pow(high / low, unit()); }
  double within(const fem::TestedRange& range) { return log_uniform(range.low, range.high); }
  std::size_t index(std::size_t n) { return rng_() % n; }

 private:
  std::mt19937_64 rng_;
};

/// A rung, a body and an integrator that it takes.
void choose_kind(Chance& chance, Settings& s) {
  const std::vector<std::string> rungs = dynamic_rungs();
  s.rung = rungs[chance.index(rungs.size())];
  s.elbow = chance.unit() < 0.2;
  const std::vector<Integrator> integrators{Integrator::Bdf2, Integrator::BackwardEuler, Integrator::TrBdf2};
  s.integrator = integrators[chance.index(integrators.size())];
  if (s.elbow && s.rung == "blended" && s.integrator == Integrator::TrBdf2) s.integrator = Integrator::Bdf2;
}

/// As heavy as the envelope lets the rung be, on bodies of up to 1.6 m, by gravity and by its own swing.
void lighten(Settings& s) {
  const double bears = s.rung == "stvk" ? fem::kTestedWeightOfStvk : fem::kTestedWeight,
               most = bears * s.material.young / (s.material.density * 1.6);
  s.gravity = std::min(s.gravity, most);
  s.rate = std::min(s.rate, std::sqrt(most / (1.6 * std::max(1e-3, std::abs(s.bend)))));
}

/// Log-uniform in the envelope, but for Poisson's ratio.
Settings inside(std::uint64_t seed) {
  Chance chance(seed);
  Settings s;
  choose_kind(chance, s);
  const fem::TestedRange nu = fem::kTestedPoisson;
  s.material = {chance.within(fem::kTestedYoung), nu.low + (nu.high - nu.low) * chance.unit(),
                chance.within(fem::kTestedDensity)};
  s.damping = {chance.within(fem::kTestedDamping), chance.within(fem::kTestedDampingFrequency)};
  s.step = chance.within(fem::kTestedStep);
  s.bend = (chance.unit() - 0.5) * M_PI;
  s.rate = chance.log_uniform(0.1, 10.0);
  s.gravity = chance.log_uniform(1e-3, 20.0);
  lighten(s);
  return s;
}

/// Log-uniform in all that the options take.
Settings anywhere(std::uint64_t seed) {
  Chance chance(seed);
  Settings s;
  choose_kind(chance, s);
  s.material = {chance.log_uniform(1.0, 1e15), 0.49999 - 1.3 * chance.unit() * chance.unit(),
                chance.log_uniform(1e-6, 1e5)};
  s.damping = {chance.log_uniform(1e-6, 1e3), chance.log_uniform(1e-3, 1e3)};
  s.step = chance.log_uniform(1e-7, 1e6);
  s.bend = (chance.unit() - 0.5) * 8.0 * M_PI;
  s.rate = chance.log_uniform(1e-3, 1e3);
  s.gravity = chance.log_uniform(1e-6, 1e4);
  return s;
}

/// A corner of the envelope: bit k of `corner` takes setting k at its high end.
Settings corner_of(unsigned corner, const std::string& rung, bool elbow) {
  const auto end = [&](unsigned k, const fem::TestedRange& range) {
    return (corner >> k & 1U) != 0U ? range.high : range.low;
  };
  Settings s;
  s.rung = rung;
  s.elbow = elbow;
  s.material = {end(0, fem::kTestedYoung), end(1, fem::kTestedPoisson), end(2, fem::kTestedDensity)};
  s.damping = {end(3, fem::kTestedDamping), end(4, fem::kTestedDampingFrequency)};
  s.step = end(5, fem::kTestedStep);
  s.bend = 90.0 * kDegree;
  s.rate = 3.0;
  lighten(s);
  return s;
}

int num_steps() { return kNightly ? 60 : 10; }

/// Runs scenes and asks that all but `share` of them end well.
template <class Make>
void run_scenes(ExtremesTable& table, int scenes, int steps, double share, const Make& make) {
  const Arm arm = small_arm();
  int failures = 0;
  std::string named;
  for (int k = 0; k < scenes; ++k) {
    const Settings s = make(k);
    const Extreme run = run_settings(s, arm, steps, k % 10 == 0);
    const std::string setting = fmt::format("{}: {}", k, s.words());
    table.count(setting, s.rung, run);
    if (!run.ok) {
      ++failures;
      named += "\n  " + s.rung + ", " + setting + ": " + run.failure;
    }
    EXPECT_FALSE(::testing::Test::HasFailure()) << s.rung << ", " << setting;
  }
  EXPECT_LE(failures, share * scenes) << named;
}

TEST(Extremes, X36ScenesAtRandom) {
  ExtremesTable table("X36",
                      "10 000 scenes at random in the envelope (300 in the normal run): at most 1 % end by a "
                      "name. Only those have a line here.");
  run_scenes(table, kNightly ? 10'000 : 300, num_steps(), 0.01,
             [](int k) { return inside(20'021 + static_cast<std::uint64_t>(k)); });
}

TEST(Extremes, X36CornersOfTheEnvelope) {
  ExtremesTable table("X36-corners",
                      "All 64 corners of the envelope on every rung, bar and elbow (every seventh in "
                      "the normal run): at most 1 % end by a name.");
  const std::vector<std::string> rungs = dynamic_rungs();
  const int all = static_cast<int>(64 * 2 * rungs.size()), every = kNightly ? 1 : 7;
  run_scenes(table, (all + every - 1) / every, num_steps(), 0.01, [&](int k) {
    const auto i = static_cast<unsigned>(k * every);
    return corner_of(i % 64, rungs[i / 64 % rungs.size()], i / 64 / rungs.size() == 1);
  });
}

// Whatever the settings, a result or a name: how many of each is no matter. Steps here are cut into hundreds
// of parts, so that 60 of each scene would take half an hour: 20 have seen all that their bones do.
TEST(Extremes, X36ScenesFarOutsideOfTheEnvelope) {
  ExtremesTable table("X36-outside",
                      "Scenes at random in all that the options take: frames or a name, no number "
                      "that is none.");
  run_scenes(table, kNightly ? 1000 : 30, kNightly ? 20 : 10, 1.0,
             [](int k) { return anywhere(40'021 + static_cast<std::uint64_t>(k)); });
}

}  // namespace
}  // namespace sinew::tests
