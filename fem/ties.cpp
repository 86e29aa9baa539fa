#include "fem/ties.h"

#include <algorithm>
#include <map>

namespace sinew::fem {
namespace {

/// The set that a tie acts on: all points within `radius` of a segment (a ball where both ends agree).
struct Tube {
  Eigen::Vector3d start, end;
  double radius = 0.0;

  double distance(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d span = end - start;
    const double length2 = span.squaredNorm();
    const double s = length2 > 0.0 ? std::clamp((p - start).dot(span) / length2, 0.0, 1.0) : 0.0;
    return (p - start - s * span).norm();
  }
};

/// int_{cell and tube} phi_a phi_b dV by 4x4x4 midpoint samples; false where the tube misses every sample.
bool tube_mass(const lattice::HexCorners& corners, const Tube& tube, CellMass& mass) {
  constexpr int kSamples = 4;
  bool any = false;
  mass.setZero();
  for (int i = 0; i < kSamples * kSamples * kSamples; ++i) {
    const Eigen::Vector3d xi((i % kSamples + 0.5) / kSamples, (i / kSamples % kSamples + 0.5) / kSamples,
                             (i / (kSamples * kSamples) + 0.5) / kSamples);
    const lattice::HexWeights phi = lattice::trilinear_weights(xi);
    if (tube.distance(corners.transpose() * phi) > tube.radius) continue;
    any = true;
    const double volume =
        lattice::trilinear_jacobian(corners, xi).determinant() / (kSamples * kSamples * kSamples);
    mass += volume * phi * phi.transpose();
  }
  return any;
}

/// `joint` names the frame in the lattice.
Tie add_tie(const Tube& tube, int frame, int joint, double kappa, const lattice::LeafMesh& mesh,
            const lattice::LeafLimbs& limbs, LeafMatrices& matrices) {
  Tie tie;
  tie.frame = frame;
  tie.centre_rest = 0.5 * (tube.start + tube.end);
  std::map<int, std::pair<double, Eigen::Vector3d>> moments;
  CellMass mass;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const lattice::HexVertices& cell = mesh.cells[c];
    const lattice::HexCorners corners = lattice::hex_corners(mesh.points, cell);
    const Eigen::Vector3d centre = corners.colwise().mean().transpose();
    const double reach = (corners.rowwise() - centre.transpose()).rowwise().norm().maxCoeff();
    if (tube.distance(centre) > reach + tube.radius || !tube_mass(corners, tube, mass)) continue;
    if (!limbs.owns_frame(static_cast<int>(c), joint, centre)) continue;
    for (std::size_t a = 0; a < 8; ++a) {
      auto& [zeroth, first] = moments.try_emplace(cell[a], 0.0, Eigen::Vector3d::Zero()).first->second;
      for (std::size_t b = 0; b < 8; ++b) {
        const double p = kappa * mass(static_cast<int>(a), static_cast<int>(b));
        matrices.tie[static_cast<std::size_t>(matrices.entry(cell[a], cell[b]))] += p;
        zeroth += p;
        first += p * (corners.row(static_cast<int>(b)).transpose() - tie.centre_rest);
      }
    }
  }
  for (const auto& [vertex, moment] : moments) {
    tie.vertices.push_back(vertex);
    tie.zeroth.push_back(moment.first);
    tie.first.push_back(moment.second);
  }
  return tie;
}

}  // namespace

std::vector<Tie> add_ties(const lattice::ControlLattice& lattice, const FrameTree& tree,
                          const LimbRadii& radii, const lattice::LeafMesh& mesh,
                          const lattice::LeafLimbs& limbs, const std::vector<double>& mu_of_frame,
                          double edge_length, const TieOptions& options, LeafMatrices& matrices) {
  std::vector<Tie> ties;
  const double smallest = 0.25 * edge_length;
  for (int b = 0; b < static_cast<int>(lattice.bones.size()); ++b) {
    const auto& bone = lattice.bones[static_cast<std::size_t>(b)];
    const int frame = tree.frame_of_joint[static_cast<std::size_t>(bone.frame)];
    const double c = bone.soft ? options.soft_stiffness : options.stiffness;
    if (c == 0.0) continue;
    const double radius = std::max(options.radius * radii.of_bone(b), smallest);
    const double kappa = c * mu_of_frame[static_cast<std::size_t>(frame)] / (radius * radius);
    ties.push_back(
        add_tie({bone.rest_start, bone.rest_end, radius}, frame, bone.frame, kappa, mesh, limbs, matrices));
    ties.back().bone = b;
  }
  for (const auto& soft : lattice.soft_frames) {
    const int frame = tree.frame_of_joint[static_cast<std::size_t>(soft.frame)];
    const double radius = 0.5 * edge_length;
    const double kappa =
        options.soft_stiffness * mu_of_frame[static_cast<std::size_t>(frame)] / (radius * radius);
    ties.push_back(
        add_tie({soft.position, soft.position, radius}, frame, soft.frame, kappa, mesh, limbs, matrices));
  }
  std::erase_if(ties, [](const Tie& tie) { return tie.vertices.empty(); });
  return ties;
}

}  // namespace sinew::fem
