#include "lattice/build.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "lattice/detail/finish.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/lattice_points.h"
#include "lattice/detail/optimise.h"
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

/// What one attempt is made with.
struct Attempt {
  double h_factor = 1.0;
  ReductionOptions reduction;
  PointOptions points;
};

/// A lattice in unit coordinates.
struct Draft {
  ReducedSkeleton skeleton;
  LatticePoints points;
  Tetrahedra cells;
};

/// Retries in order, cheapest change first.
std::vector<Attempt> attempts(const BuildOptions& options) {
  std::vector<Attempt> list(7);
  list[1].h_factor = 0.93;
  list[2].h_factor = 1.08;
  list[3].reduction.smallest_bone = 0.6;
  list[4].reduction.smallest_bone = 0.7;
  list[5].points.exclusion = 0.7;
  list[6].reduction.chain_degrees = 25.0;
  list[6].reduction.too_close = 0.3;
  list.resize(std::min<std::size_t>(list.size(), static_cast<std::size_t>(options.max_retries) + 1));
  for (Attempt& attempt : list) attempt.reduction.tip_bones = options.tip_bones;
  return list;
}

Draft make_draft(const RigInput& input, double h, const Attempt& attempt, const SkinSamples& samples) {
  Draft draft;
  draft.skeleton = reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, h, attempt.reduction);
  draft.points = place_points(input.unit_skin, draft.skeleton, h, attempt.points);
  draft.cells = tetrahedralise(draft.points, draft.skeleton, samples, h, attempt.points).cells;
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
  return h;
}

/// Secant search, in logarithms, for the h that gives the wanted number of cells.
double find_edge_length(const RigInput& input, int wanted, const Attempt& attempt) {
  const double target = std::log(static_cast<double>(wanted));
  const double lowest = std::log(smallest_edge_length(input, wanted));
  double x = std::log(0.1), best_x = x, best_error = std::numeric_limits<double>::infinity();
  double old_x = 0.0, old_y = 0.0, slope = -2.3;  // cells go like h^-3 in a bulk, h^-2 in a skin
  for (int step = 0; step < kSearchSteps; ++step) {
    const double h = std::exp(x);
    const Draft draft = make_draft(input, h, attempt, sample_skin(input.unit_skin, h));
    const double y = std::log(static_cast<double>(std::max<std::size_t>(1, draft.cells.size())));
    if (std::abs(y - target) < best_error) best_error = std::abs(y - target), best_x = x;
    if (best_error < kCloseEnough) break;
    if (step > 0 && std::abs(x - old_x) > 1e-9) slope = std::clamp((y - old_y) / (x - old_x), -4.0, -1.2);
    old_x = x;
    old_y = y;
    x = std::max(x + std::clamp((target - y) / slope, -1.2, 1.2), lowest);
  }
  return std::exp(best_x);
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

ControlLattice make_attempt(const RigInput& input, double h, const Attempt& attempt) {
  const SkinSamples samples = sample_skin(input.unit_skin, h);
  Draft draft = make_draft(input, h, attempt, samples);
  optimise(draft.points, draft.cells, draft.skeleton, input.unit_skin, samples, h);
  ControlLattice lattice = to_lattice(input, draft, h);
  separate_limbs(input, draft.skeleton, lattice);
  hang_joints(input, draft.skeleton, lattice);
  return lattice;
}

/// Fewest intolerable failures, then fewest failures.
bool is_better(const std::vector<GateFailure>& a, const std::vector<GateFailure>& b) {
  const auto intolerable = [](const std::vector<GateFailure>& list) {
    return std::count_if(list.begin(), list.end(), [](const GateFailure& f) { return !f.tolerable; });
  };
  return intolerable(a) != intolerable(b) ? intolerable(a) < intolerable(b) : a.size() < b.size();
}

}  // namespace

BuildResult build(const Surface& skin, const JointTree& joints, const BuildOptions& options) {
  options.validate();
  const RigInput input = make_rig_input(skin, joints, options);
  const std::vector<Attempt> list = attempts(options);
  const double h = options.cell_size ? *options.cell_size / input.unit_skin.scale
                                     : find_edge_length(input, options.cells, list.front());
  BuildResult best;
  int tried = 0;
  for (const Attempt& attempt : list) {
    BuildResult result;
    result.lattice = make_attempt(input, h * attempt.h_factor, attempt);
    const Inspection found = inspect(result.lattice, skin, input.unit_skin);
    result.lattice.quality = found.quality;
    result.failures = judge(found, options);
    if (tried == 0 || is_better(result.failures, best.failures)) best = std::move(result);
    ++tried;
    if (best.failures.empty()) break;
  }
  best.lattice.retries = tried - 1;
  return best;
}

}  // namespace sinew::lattice
