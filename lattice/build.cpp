#include "lattice/build.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "lattice/detail/cell_locator.h"
#include "lattice/detail/inspection.h"
#include "lattice/detail/lattice_points.h"
#include "lattice/detail/optimise.h"
#include "lattice/detail/skeleton_reduction.h"
#include "lattice/detail/skin_samples.h"
#include "lattice/detail/tetrahedralise.h"
#include "lattice/detail/unit_skin.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;
using namespace detail;

/// Steps of the search for h, and when the count of cells is close enough.
constexpr int kSearchSteps = 8;
constexpr double kCloseEnough = 0.05;

/// What one attempt is made with (LATTICE step 11).
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
std::vector<Attempt> attempts(int max_retries) {
  std::vector<Attempt> list(7);
  list[1].h_factor = 0.93;
  list[2].h_factor = 1.08;
  list[3].reduction.smallest_bone = 0.6;
  list[4].reduction.smallest_bone = 0.7;
  list[5].points.exclusion = 0.7;
  list[6].reduction.chain_degrees = 25.0;
  list[6].reduction.too_close = 0.3;
  list.resize(std::min<std::size_t>(list.size(), static_cast<std::size_t>(max_retries) + 1));
  return list;
}

struct Context {
  UnitSkin skin;
  JointTree joints;  ///< in unit coordinates.
  JointWeights weights;
};

Draft make_draft(const Context& context, double h, const Attempt& attempt, const SkinSamples& samples) {
  Draft draft;
  draft.skeleton = reduce_skeleton(context.skin, context.joints, context.weights, h, attempt.reduction);
  draft.points = place_points(context.skin, draft.skeleton, h, attempt.points);
  draft.cells = tetrahedralise(draft.points, draft.skeleton, samples, h, attempt.points).cells;
  return draft;
}

/// Secant search, in logarithms, for the h that gives the wanted number of cells.
double find_edge_length(const Context& context, int wanted) {
  const double target = std::log(static_cast<double>(wanted));
  double x = std::log(0.1), best_x = x, best_error = std::numeric_limits<double>::infinity();
  double old_x = 0.0, old_y = 0.0, slope = -2.3;  // cells go like h^-3 in a bulk, h^-2 in a skin
  for (int step = 0; step < kSearchSteps; ++step) {
    const double h = std::exp(x);
    const Draft draft = make_draft(context, h, {}, sample_skin(context.skin, h));
    const double y = std::log(static_cast<double>(std::max<std::size_t>(1, draft.cells.size())));
    if (std::abs(y - target) < best_error) best_error = std::abs(y - target), best_x = x;
    if (best_error < kCloseEnough) break;
    if (step > 0 && std::abs(x - old_x) > 1e-9) slope = std::clamp((y - old_y) / (x - old_x), -4.0, -1.2);
    old_x = x;
    old_y = y;
    x += std::clamp((target - y) / slope, -1.2, 1.2);
  }
  return std::exp(best_x);
}

BoneAnchor anchor(const JointTree& joints, int joint, const Vector3d& rest) {
  (void)joints;
  return {joint, joint, rest, rest};
}

/// Rest position of a node: bit for bit the joint's where it is one.
Vector3d rest_position(const Context& context, const JointTree& joints, const SkeletonNode& node) {
  const bool at_joint = node.position == Vector3d(context.joints.positions.row(node.joint).transpose());
  return at_joint ? Vector3d(joints.positions.row(node.joint).transpose())
                  : context.skin.to_rest(node.position);
}

/// From unit to rest coordinates, unused vertices dropped.
ControlLattice finish(const Context& context, const JointTree& joints, const Draft& draft, double h) {
  ControlLattice lattice;
  const ReducedSkeleton& skeleton = draft.skeleton;
  std::vector<int> new_index(draft.points.points.size(), -1);
  for (const auto& cell : draft.cells)
    for (int v : cell) new_index[v] = 0;
  for (const std::vector<int>& chain : draft.points.chains)
    for (int v : chain) new_index[v] = 0;
  std::vector<Vector3d> points;
  for (std::size_t v = 0; v < new_index.size(); ++v) {
    if (new_index[v] < 0) continue;
    new_index[v] = static_cast<int>(points.size());
    points.push_back(context.skin.to_rest(draft.points.points[v]));
  }
  for (const auto& cell : draft.cells) {
    Cell out;
    for (int k = 0; k < 4; ++k) out.vertices[k] = new_index[cell[k]];
    lattice.complex.cells.push_back(out);
  }
  for (std::size_t b = 0; b < skeleton.bones.size(); ++b) {
    const ReducedBone& reduced = skeleton.bones[b];
    LatticeBone bone;
    bone.name = reduced.name;
    bone.frame = reduced.frame;
    bone.soft = reduced.soft;
    bone.tip = reduced.tip;
    bone.rest_start = rest_position(context, joints, skeleton.nodes[reduced.start]);
    bone.rest_end = rest_position(context, joints, skeleton.nodes[reduced.end]);
    bone.start = anchor(joints, skeleton.nodes[reduced.start].joint, bone.rest_start);
    bone.end = anchor(joints, skeleton.nodes[reduced.end].joint, bone.rest_end);
    for (int v : draft.points.chains[b]) {
      const double s = draft.points.places[v].s;
      bone.chain.push_back(new_index[v]);
      points[new_index[v]] = (1.0 - s) * bone.rest_start + s * bone.rest_end;
    }
    if (!bone.chain.empty()) {
      points[bone.chain.front()] = bone.rest_start;
      points[bone.chain.back()] = bone.rest_end;
    }
    lattice.bones.push_back(std::move(bone));
  }
  lattice.complex.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    lattice.complex.points.row(static_cast<Eigen::Index>(v)) = points[v];
  lattice.soft_frames = skeleton.soft_frames;
  for (SoftFrame& frame : lattice.soft_frames) frame.position = context.skin.to_rest(frame.position);
  lattice.changes = skeleton.changes;
  lattice.edge_length = h * context.skin.scale;
  return lattice;
}

/// Every component without a bone is tied to the joint that moves most of its skin.
void tie_floating_components(const Context& context, const JointTree& joints, const Surface& skin,
                             ControlLattice& lattice) {
  const Inspection found = inspect(lattice, skin, context.skin);
  if (found.floating.empty()) return;
  const std::size_t num_joints = joints.parents.size();
  std::vector<int> component_of(lattice.complex.cells.size(), -1);
  for (std::size_t i = 0; i < found.floating.size(); ++i)
    for (int c : found.floating[i]) component_of[c] = static_cast<int>(i);
  std::vector<std::vector<double>> share(found.floating.size(), std::vector<double>(num_joints, 0.0));
  std::vector<Vector3d> place(found.floating.size(), Vector3d::Zero());
  std::vector<double> count(found.floating.size(), 0.0);
  const CellLocator locator(lattice.complex);
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const Vector3d p = skin.points.row(static_cast<Eigen::Index>(v)).transpose();
    const int cell = locator.find(p, 1e-9);
    const int part = cell < 0 ? -1 : component_of[cell];
    if (part < 0) continue;
    for (const Influence& influence : skin.weights[v]) share[part][influence.frame] += influence.weight;
    place[part] += p;
    count[part] += 1.0;
  }
  for (std::size_t i = 0; i < found.floating.size(); ++i) {
    const auto heaviest = std::max_element(share[i].begin(), share[i].end());
    if (!(*heaviest > 0.0)) continue;  // the gate reports it
    SoftFrame frame;
    frame.frame = static_cast<int>(heaviest - share[i].begin());
    frame.position = place[i] / count[i];
    // A place inside the component: the centroid of its skin, else of its first cell.
    const int cell = locator.find(frame.position, 1e-9);
    if (cell < 0 || component_of[cell] != static_cast<int>(i)) {
      frame.position.setZero();
      for (int k = 0; k < 4; ++k)
        frame.position +=
            0.25 *
            lattice.complex.points.row(lattice.complex.cells[found.floating[i][0]].vertices[k]).transpose();
    }
    lattice.soft_frames.push_back(frame);
    lattice.changes.push_back(
        {joints.names[frame.frame], "soft frame",
         fmt::format("holds a separate part of {} cells that no bone reaches", found.floating[i].size())});
  }
}

void check_input(const Surface& skin, const JointTree& joints) {
  const int n = static_cast<int>(joints.parents.size());
  if (n == 0) throw std::invalid_argument("lattice: there is no joint");
  if (joints.positions.rows() != n || static_cast<int>(joints.names.size()) != n) {
    throw std::invalid_argument(fmt::format("lattice: {} joint positions and {} names for {} joints",
                                            joints.positions.rows(), joints.names.size(), n));
  }
  for (int j = 0; j < n; ++j) {
    if (!joints.positions.row(j).allFinite()) {
      throw std::invalid_argument(
          fmt::format("lattice: joint '{}' has a position that is not finite", joints.names[j]));
    }
    if (joints.parents[j] >= j || joints.parents[j] < -1) {
      throw std::invalid_argument(
          fmt::format("lattice: joint '{}' does not come after its parent", joints.names[j]));
    }
  }
  double total = 0.0;
  for (std::size_t v = 0; v < skin.weights.size(); ++v)
    for (const Influence& influence : skin.weights[v]) {
      if (influence.frame < 0 || influence.frame >= n) {
        throw std::invalid_argument(fmt::format(
            "lattice: skin vertex {} hangs on joint {}, which does not exist", v, influence.frame));
      }
      total += influence.weight;
    }
  if (!(total > 0.0)) throw std::invalid_argument("lattice: no skin vertex has a weight");
}

Context make_context(const Surface& skin, const JointTree& joints) {
  UnitSkin unit = make_unit_skin(skin);
  JointTree in_unit = joints;
  for (Eigen::Index j = 0; j < joints.positions.rows(); ++j)
    in_unit.positions.row(j) = unit.to_unit(joints.positions.row(j).transpose()).transpose();
  JointWeights weights = joint_weights(unit, joints);
  return {std::move(unit), std::move(in_unit), std::move(weights)};
}

ControlLattice make_attempt(const Context& context, const Surface& skin, const JointTree& joints, double h,
                            const Attempt& attempt) {
  const SkinSamples samples = sample_skin(context.skin, h);
  Draft draft = make_draft(context, h, attempt, samples);
  optimise(draft.points, draft.cells, draft.skeleton, context.skin, samples, h);
  ControlLattice lattice = finish(context, joints, draft, h);
  tie_floating_components(context, joints, skin, lattice);
  std::vector<int> frames;
  for (const LatticeBone& bone : lattice.bones) frames.push_back(bone.frame);
  for (const SoftFrame& frame : lattice.soft_frames) frames.push_back(frame.frame);
  lattice.frame_of_joint = frame_of_joint(joints.parents, frames);
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

void BuildOptions::validate() const {
  if (cells < 20) throw std::invalid_argument(fmt::format("cells: got {}, expected at least 20", cells));
  if (max_retries < 0)
    throw std::invalid_argument(fmt::format("max_retries: got {}, expected at least 0", max_retries));
  if (!(min_dihedral_degrees >= 0.0 && min_dihedral_degrees < 70.0)) {
    throw std::invalid_argument(
        fmt::format("min_dihedral_degrees: got {}, expected a value in [0, 70)", min_dihedral_degrees));
  }
  if (!(min_scaled_jacobian >= 0.0 && min_scaled_jacobian < 0.7)) {
    throw std::invalid_argument(
        fmt::format("min_scaled_jacobian: got {}, expected a value in [0, 0.7)", min_scaled_jacobian));
  }
}

BuildResult build(const Surface& skin, const JointTree& joints, const BuildOptions& options) {
  options.validate();
  check_input(skin, joints);
  const Context context = make_context(skin, joints);
  const double h = find_edge_length(context, options.cells);
  BuildResult best;
  int tried = 0;
  for (const Attempt& attempt : attempts(options.max_retries)) {
    BuildResult result;
    result.lattice = make_attempt(context, skin, joints, h * attempt.h_factor, attempt);
    const Inspection found = inspect(result.lattice, skin, context.skin);
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
