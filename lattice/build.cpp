#include "lattice/build.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "lattice/detail/finish.h"
#include "lattice/detail/hexahedral_grid.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/lattice_points.h"
#include "lattice/detail/optimise.h"
#include "lattice/detail/retries.h"
#include "lattice/detail/rig_input.h"
#include "lattice/detail/separate_limbs.h"
#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/skin_samples.h"
#include "lattice/detail/tetrahedralise.h"

namespace sinew::lattice {
namespace {

using namespace detail;

/// Steps of the search for h, and when the count of cells is close enough.
constexpr int kSearchSteps = 8;
constexpr double kCloseEnough = 0.05;
/// Where the shape of cells needs no second look: what the worst cell of most lattices reaches. Below so many
/// cells it gets one.
constexpr double kGoodDihedral = 26.0, kGoodJacobian = 0.28;
constexpr int kFewCells = 1500;

/// A lattice in unit coordinates.
struct Draft {
  ReducedSkeleton skeleton;
  LatticePoints points;
  Tetrahedra cells;
};

SkinSamples samples_of(const RigInput& input, double h) {
  return sample_skin(input.unit_skin, h, input.mirror ? Halves::OneMirrored : Halves::Both, input.sizes,
                     input.poll);
}

Draft make_draft(const RigInput& input, double h, const Attempt& attempt, const SkinSamples& samples) {
  ReductionOptions reduction = attempt.reduction;
  reduction.sizes = &input.sizes;
  PointOptions options = attempt.points;
  options.sizes = &input.sizes;
  options.poll = input.poll;
  Draft draft;
  draft.skeleton =
      reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, h, reduction, input.mirror_joint());
  draft.points = place_points(input.unit_skin, draft.skeleton, h, options);
  draft.cells = tetrahedralise(draft.points, draft.skeleton, samples, h, options).cells;
  return draft;
}

/// The h below which the grid over the skin's box has a hundred points per wanted cell: no body fills so
/// little of its box, but a sheet of a few triangles may never give the wanted number, and the search must
/// end.
double smallest_edge_length(const RigInput& input, int wanted) {
  const Points& points = input.unit_skin.points;
  const Eigen::RowVector3d box = points.colwise().maxCoeff() - points.colwise().minCoeff();
  double h = 0.5;
  const auto grid_points = [&] { return (box.array() + 2.4 * h).prod() / (h * h * h); };
  while (grid_points() < 100.0 * wanted) h *= 0.9;
  return h / (input.sizes.largest(h) / h);
}

/// Secant search, in logarithms, for the h that gives the wanted number of cells.
double find_edge_length(const RigInput& input, int wanted, const Attempt& attempt) {
  const double target = std::log(static_cast<double>(wanted));
  const double lowest = std::log(smallest_edge_length(input, wanted));
  double x = std::log(0.1), best_x = x, best_error = std::numeric_limits<double>::infinity();
  double old_x = 0.0, old_y = 0.0, slope = -2.3;  // cells go like h^-3 in a bulk, h^-2 in a skin
  for (int step = 0; step < kSearchSteps; ++step) {
    const double h = std::exp(x);
    const Draft draft = make_draft(input, h, attempt, samples_of(input, h));
    const std::size_t cells = draft.cells.size() * (draft.points.half ? 2 : 1);
    const double y = std::log(static_cast<double>(std::max<std::size_t>(1, cells)));
    if (std::abs(y - target) < best_error) best_error = std::abs(y - target), best_x = x;
    if (best_error < kCloseEnough) break;
    if (step > 0 && std::abs(x - old_x) > 1e-9) slope = std::clamp((y - old_y) / (x - old_x), -4.0, -1.2);
    old_x = x;
    old_y = y;
    x = std::max(x + std::clamp((target - y) / slope, -1.2, 1.2), lowest);
  }
  return std::exp(best_x);
}

/// The whole lattice of a half. Every bone that is not there yet gets its partner's chain.
void add_mirror_image(Draft& draft) {
  LatticePoints& points = draft.points;
  const int count = static_cast<int>(points.points.size());
  std::vector<int> image(count);
  for (int v = 0; v < count; ++v) {
    image[v] = v;
    if (points.is_in_plane(v)) continue;
    LatticePoints::Place place = points.places[v];
    if (place.bone >= 0) place.bone = draft.skeleton.mirror_bone[place.bone];
    image[v] = points.add(reflected(points.points[v]), place);
  }
  for (std::size_t b = 0; b < points.chains.size(); ++b) {
    const std::size_t other = static_cast<std::size_t>(draft.skeleton.mirror_bone[b]);
    if (other <= b || points.chains[b].empty()) continue;
    for (const int v : points.chains[b]) points.chains[other].push_back(image[v]);
  }
  const std::size_t cells = draft.cells.size();
  for (std::size_t c = 0; c < cells; ++c) {
    const auto [i, j, k, l] = draft.cells[c];
    draft.cells.push_back({image[i], image[k], image[j], image[l]});
  }
  points.half = false;
}

/// From unit to rest coordinates, unused vertices dropped.
ControlLattice to_lattice(const RigInput& input, const Draft& draft, double h) {
  ControlLattice lattice;
  lattice.edge_length = h * input.unit_skin.scale;
  lattice.changes = draft.skeleton.changes;
  std::vector<int> new_index(draft.points.points.size(), -1);
  for (const auto& cell : draft.cells)
    for (int v : cell) new_index[v] = 0;
  for (const std::vector<int>& chain : draft.points.chains)
    for (int v : chain) new_index[v] = 0;
  int count = 0;
  for (int& index : new_index)
    if (index == 0) index = count++;
  lattice.complex.points.resize(count, 3);
  for (std::size_t v = 0; v < new_index.size(); ++v)
    if (new_index[v] >= 0)
      lattice.complex.points.row(new_index[v]) = input.unit_skin.to_rest(draft.points.points[v]).transpose();
  for (const auto& cell : draft.cells) {
    Cell out;
    for (int k = 0; k < 4; ++k) out.vertices[k] = new_index[cell[k]];
    lattice.complex.cells.push_back(out);
  }
  lattice.bones = lattice_bones(input, draft.skeleton);
  std::vector<std::vector<double>> parameters(lattice.bones.size());
  for (std::size_t b = 0; b < lattice.bones.size(); ++b)
    for (int v : draft.points.chains[b]) {
      lattice.bones[b].chain.push_back(new_index[v]);
      parameters[b].push_back(draft.points.places[v].s);
    }
  place_chains(lattice, parameters);
  return lattice;
}

/// Mean over the cells of the target edge at their middles [m], where `h` is that of a factor of 1 (unit
/// coordinates).
double mean_target_edge(const RigInput& input, const ControlLattice& lattice, double h) {
  double sum = 0.0;
  for (const Cell& cell : lattice.complex.cells) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int k = 0; k < 4; ++k) middle += 0.25 * lattice.complex.points.row(cell.vertices[k]).transpose();
    sum += input.sizes.edge_at(input.unit_skin.to_unit(middle), h);
  }
  return input.unit_skin.scale * sum / static_cast<double>(lattice.complex.cells.size());
}

ControlLattice make_attempt(const RigInput& input, double h, const Attempt& attempt) {
  const SkinSamples samples = samples_of(input, h);
  Draft draft = make_draft(input, h, attempt, samples);
  optimise(draft.points, draft.cells, draft.skeleton, input.unit_skin, samples, h, input.sizes, input.poll);
  if (draft.points.half) add_mirror_image(draft);
  ControlLattice lattice = to_lattice(input, draft, h);
  separate_limbs(input, draft.skeleton, lattice);
  hang_joints(input, draft.skeleton, lattice);
  if (!input.sizes.is_uniform(h)) lattice.edge_length = mean_target_edge(input, lattice, h);
  return lattice;
}

/// An attempt and what the gate says of it.
struct Outcome {
  ControlLattice lattice;
  Inspection found;
  std::vector<GateFailure> failures;
};

/// Fewest intolerable failures, then fewest failures, then the better worst cell.
bool is_better(const Outcome& a, const Outcome& b, const BuildOptions& options) {
  const auto intolerable = [](const Outcome& o) {
    return std::count_if(o.failures.begin(), o.failures.end(),
                         [](const GateFailure& f) { return !f.tolerable; });
  };
  const auto shape = [&](const Outcome& o) {
    return std::min(o.found.quality.min_dihedral_degrees / std::max(1e-9, options.min_dihedral_degrees),
                    o.found.quality.min_scaled_jacobian / std::max(1e-9, options.min_scaled_jacobian));
  };
  if (intolerable(a) != intolerable(b)) return intolerable(a) < intolerable(b);
  if (a.failures.size() != b.failures.size()) return a.failures.size() < b.failures.size();
  return shape(a) > shape(b);
}

Outcome judged(ControlLattice lattice, const RigInput& input, const BuildOptions& options) {
  Outcome outcome;
  outcome.lattice = std::move(lattice);
  outcome.found = inspect(outcome.lattice, input.skin, input.unit_skin, input.poll);
  outcome.lattice.quality = outcome.found.quality;
  outcome.failures = judge(outcome.found, options);
  return outcome;
}

Outcome try_out(const RigInput& input, double h, const Attempt& attempt, const BuildOptions& options) {
  return judged(make_attempt(input, h * attempt.h_factor, attempt), input, options);
}

/// The last resort: cubes, and soft bones.
Outcome try_grid(const RigInput& input, const BuildOptions& options) {
  const double side = options.cell_size ? *options.cell_size / input.unit_skin.scale
                                        : find_grid_side(input.unit_skin, options.cells, input.poll);
  ReductionOptions reduction;
  reduction.tip_bones = options.tip_bones;
  return judged(hexahedral_lattice(input, side, reduction), input, options);
}

/// Other places of the grid for a lattice that passed. The worst of a few hundred cells depends much on where
/// the grid lies, and where cells are few another grid costs little.
void try_other_grids(const RigInput& input, double h, const BuildOptions& options, Outcome& best) {
  const auto cells = [](const Outcome& o) { return static_cast<int>(o.lattice.complex.cells.size()); };
  const auto is_good = [](const LatticeQuality& q) {
    return q.min_dihedral_degrees >= kGoodDihedral && q.min_scaled_jacobian >= kGoodJacobian;
  };
  if (options.max_retries == 0 || cells(best) > kFewCells) return;
  const double allowed = options.cell_size
                             ? std::numeric_limits<double>::infinity()
                             : std::max(std::abs(cells(best) - options.cells), options.cells / 10);
  for (const Attempt& attempt : moved_grids(options)) {
    if (is_good(best.found.quality)) return;
    Outcome other = try_out(input, h, attempt, options);
    if (other.failures.empty() && std::abs(cells(other) - options.cells) <= allowed &&
        is_better(other, best, options))
      best = std::move(other);
  }
}

/// In ascending order.
std::vector<int> sized_joints(const BuildOptions& options) {
  std::vector<int> joints;
  for (const SizeFactor& size : options.size_factors) joints.push_back(size.joint);
  std::sort(joints.begin(), joints.end());
  return joints;
}

/// The first attempt that passes, or the best of all.
BuildResult best_attempt_of(const RigInput& input, const BuildOptions& options) {
  const std::vector<Attempt> planned = planned_attempts(options);
  const double h = options.cell_size ? *options.cell_size / input.unit_skin.scale
                                     : find_edge_length(input, options.cells, planned.front());
  BuildResult result;
  std::optional<Outcome> best;
  Attempt best_attempt;
  const auto passes = [&](const Attempt& attempt) {
    Outcome outcome = try_out(input, h, attempt, options);
    if (!outcome.failures.empty()) result.refused.push_back({attempt.name, outcome.failures});
    if (!best || is_better(outcome, *best, options)) best = std::move(outcome), best_attempt = attempt;
    return best->failures.empty();
  };
  bool passed = passes(planned.front());
  if (passed) try_other_grids(input, h, options, *best);
  const bool grid_is_idle = !passed && is_shaped_by_bones(best->lattice, best->found, options);
  for (std::size_t i = 1; i < planned.size() && !passed; ++i)
    if (!(grid_is_idle && planned[i].moves_grid_only)) passed = passes(planned[i]);
  // What no threshold cures: bones give way, one after the other.
  const std::string base = best_attempt.name;
  for (std::size_t i = planned.size(); i <= static_cast<std::size_t>(options.max_retries) && !passed; ++i) {
    const std::optional<SoftBone> bone = offending_bone(best->lattice, best->found, options);
    if (!bone) break;
    Attempt attempt = best_attempt;
    attempt.reduction.soft_bones.push_back(*bone);
    attempt.name = fmt::format("{}, {} bones soft", base, attempt.reduction.soft_bones.size());
    passed = passes(attempt);
    if (best_attempt.name != attempt.name) break;  // it did not help
  }
  if (!passed && options.construction == Construction::Auto) {
    Outcome grid = try_grid(input, options);
    if (!grid.failures.empty()) result.refused.push_back({"grid of cubes", grid.failures});
    if (is_better(grid, *best, options)) best = std::move(grid);
  }
  result.lattice = std::move(best->lattice);
  result.failures = std::move(best->failures);
  result.lattice.retries = static_cast<int>(result.refused.size()) - (result.failures.empty() ? 0 : 1);
  result.no_mirror = input.no_mirror;
  result.idle_sizes = result.lattice.is_grid ? sized_joints(options) : input.idle_sizes;
  if (input.mirror) {
    const Eigen::Vector3d normal = input.unit_skin.axes.row(0).transpose();
    result.mirror = MirrorPlane{normal, normal.dot(input.unit_skin.centre)};
  }
  return result;
}

}  // namespace

BuildResult build(const Surface& skin, const JointTree& joints, const BuildOptions& options) {
  options.validate();
  BuildOptions whole = options;
  whole.symmetry = Symmetry::Off;
  if (options.construction == Construction::Grid) {
    Outcome grid = try_grid(make_rig_input(skin, joints, whole), whole);
    BuildResult result;
    result.lattice = std::move(grid.lattice);
    result.failures = std::move(grid.failures);
    result.idle_sizes = sized_joints(options);
    return result;
  }
  const RigInput input = make_rig_input(skin, joints, options);
  if (!input.mirror) return best_attempt_of(input, options);
  // The grid is the last resort, after lattices that are not mirrored.
  BuildOptions tetrahedra = options;
  tetrahedra.construction = Construction::Tetrahedra;
  BuildResult result = best_attempt_of(input, tetrahedra);
  if (result.failures.empty()) return result;
  // Half a lattice has less freedom than a whole one.
  BuildResult other = best_attempt_of(make_rig_input(skin, joints, whole), whole);
  if (!other.failures.empty()) return result;
  other.no_mirror = "the gate refused every mirrored lattice";
  other.lattice.retries += static_cast<int>(result.refused.size());
  other.refused.insert(other.refused.begin(), result.refused.begin(), result.refused.end());
  return other;
}

}  // namespace sinew::lattice
