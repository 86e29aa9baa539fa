#include "fem/body/ties.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "lattice/embedding.h"

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

/// What of a tube lies in one leaf cell.
struct Piece {
  std::size_t cell;
  CellMass mass;  ///< int phi_a phi_b dV over it [m^3].
  bool is_seed;   ///< the cell holds the bone itself.
};

/// Vertices of a leaf cell, named in the hierarchy, and of those that it is part of up to level `coarsest`: a
/// fine cell beside a coarse one need not share a vertex with it, but then a coarser one that holds it does.
std::vector<int> vertices_up_to(int coarsest, std::size_t cell, const TiedCells& of) {
  std::vector<int> vertices;
  int hex = of.mesh.hex[cell];
  for (int level = of.mesh.level[cell]; level >= coarsest; --level, hex /= 8) {
    const lattice::HexVertices& corners = of.hierarchy.hexes(level)[static_cast<std::size_t>(hex)];
    vertices.insert(vertices.end(), corners.begin(), corners.end());
  }
  return vertices;
}

/// The pieces that hang together with the cells that hold the bone: a tube as thick as a quarter of a coarse
/// cell may reach into the next limb, which has nothing to do with the bone. All of them where nothing holds
/// it.
std::vector<Piece> connected(std::vector<Piece> pieces, const TiedCells& of, int coarsest) {
  std::map<int, std::vector<std::size_t>> pieces_at;  // vertex -> pieces
  std::vector<std::size_t> open;
  std::vector<bool> is_reached(pieces.size(), false);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    for (int v : vertices_up_to(coarsest, pieces[i].cell, of)) pieces_at[v].push_back(i);
    if (pieces[i].is_seed) open.push_back(i), is_reached[i] = true;
  }
  if (open.empty()) return pieces;
  while (!open.empty()) {
    const std::size_t i = open.back();
    open.pop_back();
    for (int v : vertices_up_to(coarsest, pieces[i].cell, of))
      for (std::size_t k : pieces_at[v])
        if (!is_reached[k]) open.push_back(k), is_reached[k] = true;
  }
  std::vector<Piece> kept;
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if (is_reached[i]) kept.push_back(pieces[i]);
  return kept;
}

/// A ball round each leaf cell.
struct CellBall {
  Eigen::Vector3d centre;
  double radius;
};
std::vector<CellBall> cell_balls(const lattice::LeafMesh& mesh) {
  std::vector<CellBall> balls;
  balls.reserve(mesh.cells.size());
  for (const lattice::HexVertices& cell : mesh.cells) {
    const lattice::HexCorners corners = lattice::hex_corners(mesh.points, cell);
    const Eigen::Vector3d centre = corners.colwise().mean().transpose();
    balls.push_back({centre, (corners.rowwise() - centre.transpose()).rowwise().norm().maxCoeff()});
  }
  return balls;
}

/// `coarsest`: level of a cell of the mesh.
Tie add_tie(const TieLaw& law, const TiedCells& of, const std::vector<CellBall>& balls, int coarsest,
            LeafMatrices& matrices) {
  const lattice::LeafMesh& mesh = of.mesh;
  const Tube tube{law.start, law.end, law.radius};
  std::vector<std::uint8_t> holds_bone(mesh.cells.size(), 0);
  for (const int cell : law.holders)
    holds_bone[static_cast<std::size_t>(of.leaf_of_finest[static_cast<std::size_t>(cell)])] = 1;
  Tie tie;
  tie.frame = law.frame;
  tie.bone = law.bone;
  tie.centre_rest = 0.5 * (tube.start + tube.end);
  std::vector<Piece> pieces;
  CellMass mass;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const Eigen::Vector3d& centre = balls[c].centre;
    if (tube.distance(centre) > balls[c].radius + tube.radius) continue;
    if (!tube_mass(lattice::hex_corners(mesh.points, mesh.cells[c]), tube, mass)) continue;
    const int coarse = lattice::coarse_cell(of.hierarchy, mesh, static_cast<int>(c));
    if (of.copies.owns(coarse, law.joint, centre)) pieces.push_back({c, mass, holds_bone[c] != 0});
  }
  std::map<int, std::pair<double, Eigen::Vector3d>> moments;
  for (const Piece& piece : connected(std::move(pieces), of, coarsest)) {
    const lattice::HexVertices& cell = mesh.cells[piece.cell];
    const lattice::HexCorners corners = lattice::hex_corners(mesh.points, cell);
    for (std::size_t a = 0; a < 8; ++a) {
      auto& [zeroth, first] = moments.try_emplace(cell[a], 0.0, Eigen::Vector3d::Zero()).first->second;
      for (std::size_t b = 0; b < 8; ++b) {
        const double p = law.kappa * piece.mass(static_cast<int>(a), static_cast<int>(b));
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

/// Leaf cells with a vertex of a bone's chain, ascending.
std::vector<int> cells_at_chain(const lattice::LeafMesh& mesh, const std::vector<int>& chain) {
  std::vector<std::uint8_t> on_chain(static_cast<std::size_t>(mesh.num_vertices()), 0);
  for (int v : chain) {
    const int leaf = mesh.leaf_of_vertex[static_cast<std::size_t>(v)];
    if (leaf >= 0) on_chain[static_cast<std::size_t>(leaf)] = 1;
  }
  std::vector<int> holders;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c)
    if (std::any_of(mesh.cells[c].begin(), mesh.cells[c].end(),
                    [&](int v) { return on_chain[static_cast<std::size_t>(v)] != 0; }))
      holders.push_back(static_cast<int>(c));
  return holders;
}

/// Leaf cells of the limb of `joint` that hold a point of the segment from `start` to `end`, ascending.
std::vector<int> cells_at_segment(const lattice::LeafMesh& mesh, const lattice::LeafLimbs& limbs, int joint,
                                  const Eigen::Vector3d& start, const Eigen::Vector3d& end, double spacing) {
  const int n = std::max(1, static_cast<int>(std::ceil((end - start).norm() / spacing)));
  lattice::Points points(n + 1, 3);
  for (int i = 0; i <= n; ++i)
    points.row(i) = (start + (end - start) * (static_cast<double>(i) / n)).transpose();
  std::vector<int> holders = lattice::embed(mesh, points, [&](int i, int cell) {
                               return limbs.owns_frame(cell, joint, points.row(i).transpose());
                             }).cell;
  std::sort(holders.begin(), holders.end());
  holders.erase(std::unique(holders.begin(), holders.end()), holders.end());
  return holders;
}

JointTie override_of(const TieOptions& options, int joint) {
  JointTie found;
  for (const JointTie& tie : options.joints)
    if (tie.joint == joint) found = tie;
  return found;
}

}  // namespace

double smallest_radius(const lattice::LatticeBone& bone, double edge_length) {
  constexpr double kLongestPiece = 1.65;  // in the mean over a chain, in edges, where cells are of one size
  const double pieces = static_cast<double>(std::max<std::size_t>(2, bone.chain.size()) - 1);
  const double piece = bone.chain.empty() ? 0.0 : (bone.rest_end - bone.rest_start).norm() / pieces;
  return 0.25 * std::max(edge_length, piece / kLongestPiece);
}

std::vector<TieLaw> tie_laws(const lattice::ControlLattice& lattice, const FrameTree& tree,
                             const LimbRadii& radii, const lattice::LeafMesh& finest,
                             const lattice::LeafLimbs& limbs, const std::vector<double>& mu_of_frame,
                             const TieOptions& options) {
  std::vector<TieLaw> laws;
  const double edge_length = lattice.edge_length;
  const double spacing = 0.25 * edge_length;  // of points along soft bones
  for (int b = 0; b < static_cast<int>(lattice.bones.size()); ++b) {
    const auto& bone = lattice.bones[static_cast<std::size_t>(b)];
    const int frame = tree.frame_of_joint[static_cast<std::size_t>(bone.frame)];
    const JointTie own = override_of(options, bone.frame);
    const double c = own.stiffness.value_or(bone.soft ? options.soft_stiffness : options.stiffness);
    if (c == 0.0) continue;
    const double radius =
        own.radius.value_or(std::max(options.radius * radii.of_bone(b), smallest_radius(bone, edge_length)));
    const double kappa = c * mu_of_frame[static_cast<std::size_t>(frame)] / (radius * radius);
    laws.push_back({frame, bone.frame, b, bone.rest_start, bone.rest_end, radius, kappa,
                    bone.chain.empty()
                        ? cells_at_segment(finest, limbs, bone.frame, bone.rest_start, bone.rest_end, spacing)
                        : cells_at_chain(finest, bone.chain)});
  }
  for (const auto& soft : lattice.soft_frames) {
    const int frame = tree.frame_of_joint[static_cast<std::size_t>(soft.frame)];
    const JointTie own = override_of(options, soft.frame);
    const double radius = own.radius.value_or(0.5 * edge_length);
    const double kappa = own.stiffness.value_or(options.soft_stiffness) *
                         mu_of_frame[static_cast<std::size_t>(frame)] / (radius * radius);
    laws.push_back({frame, soft.frame, -1, soft.position, soft.position, radius, kappa,
                    cells_at_segment(finest, limbs, soft.frame, soft.position, soft.position, spacing)});
  }
  return laws;
}

std::vector<Tie> add_ties(const std::vector<TieLaw>& laws, const TiedCells& cells, LeafMatrices& matrices) {
  std::vector<Tie> ties;
  if (laws.empty()) return ties;
  const std::vector<CellBall> balls = cell_balls(cells.mesh);
  const int coarsest = *std::min_element(cells.mesh.level.begin(), cells.mesh.level.end());
  for (const TieLaw& law : laws) ties.push_back(add_tie(law, cells, balls, coarsest, matrices));
  std::erase_if(ties, [](const Tie& tie) { return tie.vertices.empty(); });
  return ties;
}

}  // namespace sinew::fem
