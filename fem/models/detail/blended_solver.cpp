#include "fem/models/detail/blended_solver.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "fem/body/growth.h"
#include "fem/body/placement.h"
#include "fem/models/detail/coordinates.h"
#include "fem/models/detail/couples.h"
#include "fem/models/detail/region_systems.h"

namespace sinew::fem {
namespace {

using detail::Coordinates;
using detail::RegionSystem;
using Inputs = detail::CoupleInputs;
using lattice::Points;
using RowSparse = RegionSystem::RowSparse;

}  // namespace

struct BlendedSolver::Impl {
  const Body* body = nullptr;
  SolverOptions options;
  Coordinates coordinates;
  std::vector<RegionSystem> systems;
  detail::Couples couples;
  /// A row of a system: where its neighbours and what is applied to them stand, and where the force goes.
  struct Row {
    const int* columns = nullptr;
    const Inputs* inputs = nullptr;
    double* force = nullptr;
  };
  /// Of vertex a from row_start[a] on: its matrices are read once for all systems that have it.
  std::vector<Row> all_rows;
  std::vector<int> row_start;
  std::map<std::pair<double, Integrator>, std::vector<Factor>> factors;

  struct StepData;
  void collect_rows();
  void gather_inputs(RegionSystem& system, const StepData& step) const;
  void apply_matrices(int vertex) const;
  void solve_region(RegionSystem& system, const StepData& step, const Factor& factor) const;
};

BlendedSolver::BlendedSolver(const Body& body, const SolverOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->body = &body;
  impl_->options = options;
  impl_->coordinates = options.basis == Basis::Nodal ? detail::nodal_coordinates(body)
                                                     : detail::hierarchical_coordinates(body);
  impl_->systems = detail::region_systems(body, impl_->coordinates, options.rings);
  impl_->collect_rows();
  impl_->couples = detail::Couples(body.matrices);
}
BlendedSolver::~BlendedSolver() = default;
BlendedSolver::BlendedSolver(BlendedSolver&&) noexcept = default;

Factor::Report BlendedSolver::prepare(double h, Integrator integrator) {
  auto& factors = impl_->factors[{h, integrator}];
  if (!factors.empty() || impl_->systems.empty()) {
    Factor::Report done;
    done.ok = true;
    return done;
  }
  const SystemFactors c =
      system_factors(stage_of(integrator), h, impl_->body->damping.alpha(), impl_->body->damping.beta());
  factors.resize(impl_->systems.size());
  std::vector<Factor::Report> reports(impl_->systems.size());
  tbb::parallel_for(std::size_t{0}, factors.size(), [&](std::size_t i) {
    if (impl_->systems[i].num_unknown == 0) {
      reports[i].ok = true;
    } else {
      const RegionSystem& system = impl_->systems[i];
      reports[i] = factors[i].factorise(detail::region_matrix(*impl_->body, system, c),
                                        impl_->options.precision.value_or(Precision::Double),
                                        detail::wanted_rows(system));
    }
  });
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (reports[i].ok) continue;
    const Region& region = *impl_->systems[i].region;
    reports[i].message = "region of '" +
                         impl_->body->tree.frames[static_cast<std::size_t>(region.second)].name +
                         "': " + reports[i].message;
    impl_->factors.erase({h, integrator});
    return reports[i];
  }
  Factor::Report done;
  done.ok = true;
  return done;
}

namespace {

/// The shape free of strain at one instant: at rest, or grown with joints that the clip scales.
struct Rest {
  std::optional<Growth> growth;
  Points coefficients;  ///< of the grown shape.

  Rest() = default;
  Rest(const Body& body, const Coordinates& coordinates, const PosedFrames& posed) {
    if (!body.grows) return;
    growth = fem::growth(body, posed);
    coordinates.analyse(growth->shape, coefficients);
  }

  /// A function's coefficient, positions relative to the region's origin.
  Eigen::Vector3d of(const Body& body, const Coordinates& coordinates, const Region& region,
                     int function) const {
    const double is_value = coordinates.is_value[static_cast<std::size_t>(function)] ? 1.0 : 0.0;
    if (!growth) {
      const int vertex = coordinates.vertex[static_cast<std::size_t>(function)];
      return is_value * (body.mesh.points.row(vertex).transpose() - region.origin_rest);
    }
    const Frame& frame = body.tree.frames[static_cast<std::size_t>(region.second)];
    return coefficients.row(function).transpose() -
           is_value * growth->of(region.second, frame, region.origin_rest);
  }
};

}  // namespace

/// The longest history of any integrator's stage.
constexpr std::size_t kMostPast = 3;

/// What all regions of one stage share.
struct BlendedSolver::Impl::StepData {
  StagePoses poses;
  Stage stage;
  double h, alpha, beta;
  Eigen::Vector3d gravity;
  const Points *x_h, *v_h, *x_expected, *v_expected;  ///< coefficients.
  Rest rest;                                          ///< at the stage.
  struct Past {
    double share;
    const PosedFrames* pose;
    const Points* x;  ///< coefficients.
    Rest rest;
  };
  std::vector<Past> past;
};

namespace {

Eigen::Vector4d lanes(const Eigen::Vector3d& v) { return {v[0], v[1], v[2], 0.0}; }

}  // namespace

/// What M, K and P act on in the region's axes at the end of the stage, first as coefficients, then at its
/// vertices.
void BlendedSolver::Impl::gather_inputs(RegionSystem& s, const StepData& step) const {
  const Region& region = *s.region;
  const RegionTransform end = transform_of(region, *step.poses.stage);
  const Eigen::Matrix3d to_local = end.rotation.transpose();
  // Of every time of the history: its origin, its axes, and the way from then to the stage with the region.
  std::array<Eigen::Vector3d, kMostPast> origin;
  std::array<Eigen::Matrix3d, kMostPast> past_local;
  std::array<Eigen::Affine3d, kMostPast> from_past;
  for (std::size_t j = 0; j < step.past.size(); ++j) {
    const RegionTransform then = transform_of(region, *step.past[j].pose);
    origin[j] = then.origin;
    past_local[j] = then.rotation.transpose();
    from_past[j] = end.from_rest * then.from_rest.inverse();
  }
  const double th = step.stage.theta * step.h;
  const double b = step.beta / (step.stage.kappa * step.h);

  std::vector<Inputs>& coefficients = s.values_are_coefficients ? s.inputs : s.coefficients;
  for (std::size_t k = 0; k < s.functions.size(); ++k) {
    const int f = s.functions[k];
    // A detail is a difference of positions: it turns with the region but does not travel.
    const double is_value = coordinates.is_value[static_cast<std::size_t>(f)] ? 1.0 : 0.0;
    const auto rest_of = [&](const Rest& rest) { return rest.of(*body, coordinates, region, f); };
    const Eigen::Vector3d x_expected = step.x_expected->row(f).transpose();
    const Eigen::Vector3d p = to_local * (x_expected - is_value * end.origin);
    const Eigen::Vector3d u_end = p - rest_of(step.rest);
    Eigen::Vector3d u_past = Eigen::Vector3d::Zero(), carried = Eigen::Vector3d::Zero();
    for (std::size_t j = 0; j < step.past.size(); ++j) {
      const StepData::Past& past = step.past[j];
      const Eigen::Vector3d x = past.x->row(f).transpose();
      u_past += past.share * (past_local[j] * (x - is_value * origin[j]) - rest_of(past.rest));
      carried += past.share * (from_past[j].linear() * x + is_value * from_past[j].translation());
    }
    // v+ - v_frame is the integrator's own difference of the flesh's place in the region: as exact as its
    // step.
    const Eigen::Vector3d x_h = step.x_h->row(f).transpose();
    const Eigen::Vector3d v_frame = (carried - x_h) / (step.stage.kappa * step.h);
    const Eigen::Vector3d inertia = step.v_h->row(f).transpose() + (th * step.alpha) * v_frame -
                                    (1.0 + th * step.alpha) * step.v_expected->row(f).transpose();
    coefficients[k] = {lanes(to_local * inertia), lanes(-th * ((1.0 + b) * u_end - b * u_past)),
                       lanes(-th * p)};
  }
  if (s.values_are_coefficients) return;
  for (std::size_t r = 0; r < s.inputs.size(); ++r) {
    Inputs sum;
    for (RowSparse::InnerIterator it(s.values, static_cast<Eigen::Index>(r)); it; ++it) {
      const Inputs& c = s.coefficients[static_cast<std::size_t>(it.col())];
      sum.inertia += it.value() * c.inertia;
      sum.elastic += it.value() * c.elastic;
      sum.tie += it.value() * c.tie;
    }
    s.inputs[r] = sum;
  }
}

void BlendedSolver::Impl::collect_rows() {
  std::vector<std::vector<Row>> of_vertex(static_cast<std::size_t>(body->mesh.num_vertices()));
  for (RegionSystem& s : systems) {
    for (int r = 0; r < s.num_rows; ++r) {
      const auto i = static_cast<std::size_t>(r);
      of_vertex[static_cast<std::size_t>(s.vertices[i])].push_back(
          {s.column.data() + s.row_start[i], s.inputs.data(), s.row_force.row(r).data()});
    }
  }
  row_start.assign(1, 0);
  for (const std::vector<Row>& some : of_vertex) {
    all_rows.insert(all_rows.end(), some.begin(), some.end());
    row_start.push_back(static_cast<int>(all_rows.size()));
  }
}

void BlendedSolver::Impl::apply_matrices(int vertex) const {
  const auto a = static_cast<std::size_t>(vertex);
  const auto first = static_cast<std::size_t>(body->matrices.row_start[a]),
             count = static_cast<std::size_t>(body->matrices.row_start[a + 1]) - first;
  for (auto r = static_cast<std::size_t>(row_start[a]); r < static_cast<std::size_t>(row_start[a + 1]); ++r) {
    const Row& row = all_rows[r];
    Eigen::Map<Eigen::Vector3d>(row.force) = couples.apply(first, {row.columns, count}, row.inputs);
  }
}

void BlendedSolver::Impl::solve_region(RegionSystem& s, const StepData& step, const Factor& factor) const {
  const Region& region = *s.region;
  const RegionTransform end = transform_of(region, *step.poses.stage);
  const Eigen::Matrix3d to_local = end.rotation.transpose();
  const double th = step.stage.theta * step.h;
  const Eigen::RowVector3d gravity = th * (to_local * step.gravity).transpose();
  for (int r = 0; r < s.num_rows; ++r) {
    s.row_force.row(r) +=
        body->vertex_mass[static_cast<std::size_t>(s.vertices[static_cast<std::size_t>(r)])] * gravity;
  }
  for (const auto& [t, rows] : s.ties) {
    const Tie& tie = body->ties[static_cast<std::size_t>(t)];
    const auto& growth = step.rest.growth;
    const Eigen::Affine3d target = tie_target(*body, tie, *step.poses.stage, growth ? &*growth : nullptr);
    const Eigen::Matrix3d turn = to_local * target.linear();
    const Eigen::Vector3d centre = to_local * (target * tie.centre_rest - end.origin);
    for (const auto& [k, r] : rows) {
      const auto i = static_cast<std::size_t>(k);
      s.row_force.row(r) += th * (turn * tie.first[i] + tie.zeroth[i] * centre).transpose();
    }
  }
  Eigen::Map<Points>(s.solution.data(), s.num_unknown, 3).noalias() = s.rows_to_unknown * s.row_force;
  factor.solve(s.solution, s.workspace);

  // Velocity of every local function in rotated axes, then at the region's vertices, back in the world,
  // weighted.
  for (std::size_t k = 0; k < s.functions.size(); ++k) {
    s.velocity.row(static_cast<Eigen::Index>(k)) = step.v_expected->row(s.functions[k]) * end.rotation;
  }
  s.velocity.topRows(s.num_unknown) += Eigen::Map<const Points>(s.solution.data(), s.num_unknown, 3);
  for (std::size_t k = 0; k < s.blended.size(); ++k) {
    Eigen::RowVector3d y = Eigen::RowVector3d::Zero();
    if (s.blended[k] >= 0) {
      for (RowSparse::InnerIterator it(s.values, s.blended[k]); it; ++it)
        y += it.value() * s.velocity.row(it.col());
    }
    s.result.row(static_cast<Eigen::Index>(k)) = region.weights[k] * (y * end.rotation.transpose());
  }
}

namespace {

/// v* of all leaf vertices: exact on bones; elsewhere skinned position plus velocity relative to the frames.
/// What it lacks is what a region solves for: little, so a rounded factor does, and nothing at rest.
Points expected_velocity(const Body& body, const State& state, const Points& x_h, const StagePoses& poses,
                         double elapsed, double eta_h) {
  Points v = Points::Zero(body.mesh.num_vertices(), 3);
  const auto num_frames = body.tree.frames.size();
  const double past_h = poses.before != nullptr ? poses.now->time - poses.before->time : 0.0;
  std::vector<Eigen::Affine3d> forward(num_frames), backward(num_frames);
  std::vector<Eigen::Matrix3d> turn(num_frames);
  for (std::size_t f = 0; f < num_frames; ++f) {
    const FrameTransform& now = poses.now->frames[f];
    forward[f] = poses.stage->frames[f].from_rest * now.to_rest;
    turn[f] = poses.stage->frames[f].rotation * now.rotation.transpose();
    if (poses.before != nullptr) backward[f] = poses.before->frames[f].from_rest * now.to_rest;
  }
  tbb::parallel_for(
      tbb::blocked_range<int>(0, body.mesh.num_vertices(), 256), [&](const tbb::blocked_range<int>& range) {
        for (int a = range.begin(); a != range.end(); ++a) {
          const Eigen::Vector3d x = state.x.row(a).transpose();
          Eigen::Vector3d sum = Eigen::Vector3d::Zero();
          for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
            const auto f = static_cast<std::size_t>(it.col());
            Eigen::Vector3d velocity = (forward[f] * x - x) / elapsed;
            if (poses.before != nullptr) {
              velocity += turn[f] * (state.v.row(a).transpose() - (x - backward[f] * x) / past_h);
            }
            sum += it.value() * velocity;
          }
          v.row(a) = sum.transpose();
        }
      });
  for (const BoneVertex& bone : body.bones.vertices) {
    v.row(bone.vertex) =
        (bone_position(bone, poses.stage->joints).transpose() - x_h.row(bone.vertex)) / eta_h;
  }
  return v;
}

}  // namespace

lattice::Points BlendedSolver::stage_velocity(const StageProblem& problem) {
  const Body& body = *impl_->body;
  const Points& x_h = *problem.x_h;
  const double h = problem.h;
  Impl::StepData step;
  step.poses = problem.poses;
  step.stage = stage_of(problem.integrator);
  step.h = h;
  step.alpha = body.damping.alpha();
  step.beta = body.damping.beta();
  step.gravity = problem.gravity;
  const double eta_h = step.stage.eta * h;
  const Points v_expected =
      expected_velocity(body, *problem.state, x_h, problem.poses, problem.elapsed, eta_h);
  const Points x_expected = x_h + eta_h * v_expected;
  const Coordinates& coordinates = impl_->coordinates;
  std::array<Points, 4 + kMostPast> analysed;
  auto coefficients = [&, next = analysed.begin()](const Points& values) mutable -> const Points* {
    if (coordinates.is_nodal()) return &values;
    coordinates.analyse(values, *next);
    return &*next++;
  };
  step.x_h = coefficients(x_h);
  step.v_h = coefficients(*problem.v_h);
  step.x_expected = coefficients(x_expected);
  step.v_expected = coefficients(v_expected);
  step.rest = Rest(body, coordinates, *problem.poses.stage);
  assert(problem.past.size() <= kMostPast && "no integrator looks further back");
  for (const PastPlace& place : problem.past)
    step.past.push_back(
        {place.share, place.pose, coefficients(*place.x), Rest(body, coordinates, *place.pose)});

  const std::vector<Factor>& factors = impl_->factors.at({h, problem.integrator});
  std::vector<RegionSystem>& systems = impl_->systems;
  tbb::parallel_for(std::size_t{0}, systems.size(),
                    [&](std::size_t i) { impl_->gather_inputs(systems[i], step); });
  tbb::parallel_for(tbb::blocked_range<int>(0, body.mesh.num_vertices(), 64),
                    [&](const tbb::blocked_range<int>& range) {
                      for (int a = range.begin(); a != range.end(); ++a) impl_->apply_matrices(a);
                    });
  tbb::parallel_for(std::size_t{0}, systems.size(), [&](std::size_t i) {
    if (systems[i].num_unknown > 0) impl_->solve_region(systems[i], step, factors[i]);
  });
  // Blend in region order: the same bits for any number of threads.
  Points v = Points::Zero(body.mesh.num_vertices(), 3);
  for (const RegionSystem& s : impl_->systems) {
    if (s.num_unknown == 0) continue;
    for (std::size_t k = 0; k < s.blended.size(); ++k) {
      v.row(s.region->vertices[k]) += s.result.row(static_cast<Eigen::Index>(k));
    }
  }
  for (const BoneVertex& bone : body.bones.vertices) v.row(bone.vertex) = v_expected.row(bone.vertex);
  fill_inactive_leaves(body, v);
  return v;
}

SolverCounts BlendedSolver::counts() const {
  SolverCounts counts;
  counts.regions = static_cast<int>(impl_->systems.size());
  counts.functions = impl_->body->mesh.num_functions();
  for (const RegionSystem& s : impl_->systems) counts.unknowns.push_back(s.num_unknown);
  if (!impl_->factors.empty()) {
    for (const Factor& factor : impl_->factors.begin()->second)
      counts.factor_nonzeros += factor.num_nonzeros();
  }
  return counts;
}

}  // namespace sinew::fem
