// Going on from a state that was kept, on every rung and with every integrator.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fem/time/simulation.h"
#include "lattice/basis.h"
#include "tests/fem/arm.h"
#include "tests/fem/bar.h"

namespace sinew::fem {
namespace {

using Eigen::Vector3d;
using lattice::Points;
using testing::HasSubstr;

struct Case {
  std::string_view model;
  Integrator integrator;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const ModelInfo& model : models()) {
    for (const Integrator integrator :
         {Integrator::Bdf2, Integrator::BackwardEuler, Integrator::TrBdf2, Integrator::ImplicitMidpoint}) {
      all.push_back({model.name, integrator});
      if (!model.dynamic) break;  // flesh without inertia knows one
    }
  }
  return all;
}

std::string name_of(const testing::TestParamInfo<Case>& info) {
  std::string name(info.param.model);
  for (char& c : name)
    if (c == '-') c = '_';
  return name + "_" + std::to_string(static_cast<int>(info.param.integrator));
}

/// A base that swings slowly, stands, turns so fast that steps are halved, jumps, and is cut elsewhere.
std::vector<Eigen::Affine3d> base_at(double time) {
  double angle = 0.0;
  Vector3d place(0, 0, 0);
  if (time < 0.05) angle = 0.3 * std::sin(20.0 * time);
  if (time >= 0.09) angle = 40.0 * (std::min(time, 0.12) - 0.09);
  if (time > 0.135) place = {5.0, 0.0, 1.0};     // farther than the bar is long: a jump
  if (time > 0.1585) place = {-20.0, 3.0, 0.0};  // in a cut
  Eigen::Affine3d pose(Eigen::AngleAxisd(angle, Vector3d::UnitZ()));
  pose.pretranslate(place);
  return {pose};
}

constexpr double kStep = 1.0 / 120.0, kEnd = 0.2;

Simulation make(const Body& body, const Case& of) {
  SimulationOptions options;
  options.step = kStep;
  options.model = std::string(of.model);
  options.integrator = of.integrator;
  options.cuts = {{0.158, 0.159}};
  return Simulation(body, base_at, 0.0, options);
}

/// States after every third of a step, whose samples lie between sub-steps, too.
std::vector<MovingState> states_of(Simulation& simulation, double from,
                                   const std::function<void()>& between) {
  std::vector<MovingState> states;
  for (int k = 1; k * kStep / 3.0 <= kEnd; ++k) {
    const double time = k * kStep / 3.0;
    if (time < from) continue;
    const SimulationReport report = simulation.advance_to(time);
    EXPECT_EQ(report.status, SimulationStatus::Ok) << report.message;
    if (report.status != SimulationStatus::Ok) break;
    states.push_back(simulation.state());
    between();
  }
  return states;
}

class MovingStates : public testing::TestWithParam<Case> {
 protected:
  static tests::BarOptions bar() {
    tests::BarOptions options;
    options.box.blocks = {4, 1, 1};
    // Its tip moves at three times the speed of sound of the soft one, which `stvk` does not stand.
    options.material = {GetParam().model == "stvk" ? 2e7 : 2e5, 0.3, 1000.0};
    options.damping = {0.1, 4.0};
    return options;
  }
  const Body body_ = tests::bar_body(bar());
};

// Restoring what is there changes nothing: the run goes on as one that was left alone.
TEST_P(MovingStates, OfTheRunItselfChangeNothing) {
  Simulation alone = make(body_, GetParam()), restored = make(body_, GetParam());
  const auto expected = states_of(alone, 0.0, [] {});
  const auto got = states_of(restored, 0.0, [&] { restored.set_state(restored.state()); });
  ASSERT_EQ(expected.size(), got.size());
  for (std::size_t k = 0; k < expected.size(); ++k)
    ASSERT_EQ(first_difference(expected[k], got[k]), "") << "after " << expected[k].flesh.time << " s";
}

// A simulation that never ran goes on from bytes as the one that wrote them did: before and between
// sub-steps, after a jump, within a cut and after it.
TEST_P(MovingStates, GoOnInAnotherSimulation) {
  Simulation alone = make(body_, GetParam());
  const auto expected = states_of(alone, 0.0, [] {});
  for (std::size_t k = 1; k + 1 < expected.size(); k += 7) {
    Simulation other = make(body_, GetParam());
    other.set_state(moving_state_from_bytes(to_bytes(expected[k])));
    const auto got = states_of(other, (static_cast<double>(k) + 1.5) * kStep / 3.0, [] {});
    ASSERT_EQ(got.size(), expected.size() - k - 1);
    for (std::size_t j = 0; j < got.size(); ++j)
      ASSERT_EQ(first_difference(expected[k + 1 + j], got[j]), "") << "from " << k << ", step " << j;
    EXPECT_EQ(hash(got.back()), hash(expected.back()));
  }
}

INSTANTIATE_TEST_SUITE_P(Rungs, MovingStates, testing::ValuesIn(cases()), name_of);

/// Several regions of a bent arm whose bones stand still, so that the energy cap has something to remember.
TEST(MovingState, HoldsTheEnergyCapOfABentLimb) {
  const tests::Arm arm = tests::make_arm();
  const Body body = tests::arm_body(arm, 90.0 * M_PI / 180.0);
  const auto motion = [](double) { return tests::arm_pose(M_PI / 2.0); };
  SimulationOptions options;
  options.model = "blended";
  options.step = 1.0 / 240.0;
  Simulation alone(body, motion, 0.0, options), other(body, motion, 0.0, options);
  Points kick = Points::Zero(body.mesh.num_vertices(), 3);
  kick.col(2).setConstant(2.0);
  alone.set_velocity(kick);
  ASSERT_EQ(alone.advance_to(0.1).status, SimulationStatus::Ok);
  MovingState kept = alone.state();
  ASSERT_TRUE(kept.energy.still);
  // Half of the kinetic energy has to go.
  kept.energy.cap = StoredEnergy(body, *kept.energy.still, options.gravity).of(kept.flesh.x) +
                    0.5 * kinetic_energy(body, kept.flesh.v);
  alone.set_state(kept);
  ASSERT_EQ(alone.advance_to(0.15).status, SimulationStatus::Ok);
  EXPECT_GT(alone.energy_taken().steps, 0);
  other.set_state(alone.state());
  ASSERT_EQ(alone.advance_to(0.2).status, SimulationStatus::Ok);
  ASSERT_EQ(other.advance_to(0.2).status, SimulationStatus::Ok);
  EXPECT_EQ(first_difference(alone.state(), other.state()), "");
}

TEST(MovingState, NamesThePartThatDiffers) {
  const Body body = tests::bar_body({});
  const Simulation simulation = make(body, {"blended-stiffness", Integrator::Bdf2});
  const MovingState state = simulation.state();
  MovingState other = state;
  EXPECT_EQ(first_difference(state, other), "");
  other.flesh.v(3, 1) += 1e-300;
  EXPECT_EQ(first_difference(state, other), "flesh.v");
  EXPECT_NE(hash(state), hash(other));
  other = state;
  other.now.frames[0].rotation(0, 0) = std::nextafter(1.0, 2.0);
  EXPECT_EQ(first_difference(state, other), "now.frames[0].rotation");
}

TEST(MovingState, RefusesBytesThatAreNotOne) {
  const Body body = tests::bar_body({});
  const std::string bytes = to_bytes(make(body, {"skin", Integrator::Bdf2}).state());
  EXPECT_THROW(moving_state_from_bytes("sinew moving state 2\n"), std::invalid_argument);
  EXPECT_THROW(moving_state_from_bytes(bytes + "x"), std::invalid_argument);
  for (std::size_t n = 0; n < bytes.size(); n += 97)
    EXPECT_THROW(moving_state_from_bytes(std::string_view(bytes).substr(0, n)), std::invalid_argument) << n;
}

TEST(MovingState, OfAnotherBodyIsRefusedByItsPart) {
  const Body body = tests::bar_body({});
  tests::BarOptions finer;
  finer.levels = 2;
  const Body other = tests::bar_body(finer);
  Simulation simulation = make(body, {"blended-stiffness", Integrator::Bdf2});
  const MovingState before = simulation.state();
  try {
    simulation.set_state(make(other, {"blended-stiffness", Integrator::Bdf2}).state());
    FAIL() << "took the state of another body";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr("moving state: flesh: expected"));
  }
  EXPECT_EQ(first_difference(before, simulation.state()), "");
}

// From level 1 to level 2 and back: shared vertices keep their bits, new ones have no coefficient and no
// velocity of their own, and the way back gives the same state.
TEST(MovingState, IsCarriedToAnotherActiveSet) {
  const Body body = tests::bar_body({});
  Simulation simulation = make(body, {"blended-stiffness", Integrator::Bdf2});
  ASSERT_EQ(simulation.advance_to(0.1).status, SimulationStatus::Ok);
  const MovingState state = simulation.state();

  const lattice::Hierarchy hierarchy(body.hierarchy.coarse(), 2);
  const lattice::LeafMesh fine = leaf_mesh(hierarchy, lattice::uniform_active_set(hierarchy, 2, {}));
  const MovingState carried = carried_over(state, hierarchy, body.mesh, fine);
  for (int a = 0; a < fine.num_vertices(); ++a) {
    const int vertex = fine.vertices[static_cast<std::size_t>(a)];
    if (hierarchy.level(vertex) < 2) {
      const int from = body.mesh.leaf_of_vertex[static_cast<std::size_t>(vertex)];
      EXPECT_EQ(carried.flesh.x.row(a), state.flesh.x.row(from));
      EXPECT_EQ(carried.flesh.v_past.row(a), state.flesh.v_past.row(from));
      continue;
    }
    Vector3d x(0, 0, 0), v(0, 0, 0);
    for (const int parent : hierarchy.parents(vertex)) {
      const int leaf = fine.leaf_of_vertex[static_cast<std::size_t>(parent)];
      x += carried.flesh.x.row(leaf).transpose();
      v += carried.flesh.v.row(leaf).transpose();
    }
    const auto n = static_cast<double>(hierarchy.parents(vertex).size());
    EXPECT_LE((carried.flesh.x.row(a).transpose() - x / n).norm(), 1e-15);
    EXPECT_LE((carried.flesh.v.row(a).transpose() - v / n).norm(), 1e-14);
  }
  MovingState back = carried_over(carried, hierarchy, fine, body.mesh);
  back.model = state.model;
  EXPECT_EQ(first_difference(back, state), "");
  EXPECT_TRUE(carried.model.systems.empty());
}

}  // namespace
}  // namespace sinew::fem
