#include "fem/body/body.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

#include "fem/body/growth.h"
#include "fem/body/mirror.h"
#include "fem/body/phong_skin.h"

namespace sinew::fem {
namespace {

void require(bool holds, const std::string& field, double value, const std::string& rule) {
  if (!holds) throw std::invalid_argument(field + ": got " + std::to_string(value) + ", expected " + rule);
}

void validate_material(const Material& m) {
  require(m.young > 0.0, "young", m.young, "a positive number of pascals");
  require(m.poisson > -1.0 && m.poisson < 0.5, "poisson", m.poisson, "-1 < nu < 0.5");
  require(m.density > 0.0, "density", m.density, "a positive number of kg/m^3");
}

/// The dominant frame of a leaf cell: the one with the largest sum over its corners.
int dominant_frame(const FrameWeights& weights, const lattice::HexVertices& cell) {
  std::map<int, double> sums;
  for (int a : cell) {
    for (FrameWeights::InnerIterator it(weights, a); it; ++it) sums[static_cast<int>(it.col())] += it.value();
  }
  int best = 0;
  double largest = -1.0;
  for (const auto& [frame, sum] : sums) {
    if (sum > largest) {
      best = frame;
      largest = sum;
    }
  }
  return best;
}

std::vector<Material> frame_materials(const FrameTree& tree, const BodyOptions& options) {
  std::vector<Material> materials(tree.frames.size(), options.material);
  for (const JointMaterial& m : options.materials) {
    const int f = tree.frame_of_joint[static_cast<std::size_t>(m.joint)];
    if (f >= 0) materials[static_cast<std::size_t>(f)] = m.material;
  }
  return materials;
}

std::vector<std::vector<int>> hard_chains(const lattice::ControlLattice& lattice) {
  std::vector<std::vector<int>> chains;
  for (const auto& bone : lattice.bones) {
    if (!bone.chain.empty()) chains.push_back(bone.chain);
  }
  return chains;
}

void check_orientation(const lattice::LeafMesh& mesh) {
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const auto corners = lattice::hex_corners(mesh.points, mesh.cells[c]);
    for (int q = 0; q < 8; ++q) {
      if (!(lattice::trilinear_jacobian(corners, gauss_point(q)).determinant() > 0.0)) {
        throw std::invalid_argument("leaf cell " + std::to_string(c) + " is inverted at rest");
      }
    }
  }
}

/// A bone that runs outside the flesh still needs its vertices: keeps the cells round chain vertices that
/// would lose all of theirs.
void rescue_bones(const lattice::ControlLattice& lattice, std::vector<std::uint8_t>& keep_coarse) {
  const auto& cells = lattice.complex.cells;
  std::vector<std::uint8_t> has_cell(static_cast<std::size_t>(lattice.complex.points.rows()), 0);
  const auto visit = [&](std::size_t c, const auto& action) {
    for (int k = 0; k < num_corners(cells[c].type); ++k)
      action(static_cast<std::size_t>(cells[c].vertices[static_cast<std::size_t>(k)]));
  };
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (keep_coarse[c]) visit(c, [&](std::size_t v) { has_cell[v] = 1; });
  }
  std::vector<std::uint8_t> rescued(has_cell.size(), 0);
  for (const auto& bone : lattice.bones) {
    for (int v : bone.chain) rescued[static_cast<std::size_t>(v)] = !has_cell[static_cast<std::size_t>(v)];
  }
  for (std::size_t c = 0; c < cells.size(); ++c) {
    visit(c, [&](std::size_t v) { keep_coarse[c] |= rescued[v]; });
  }
}

/// Everything below indexes weights by skin vertex and frames by joint.
void check_input(const BodyInput& input, const BodyOptions& options) {
  const auto num_joints = static_cast<double>(input.skeleton.num_joints());
  const auto& weights = input.skin.weights;
  require(input.skin.points.rows() == static_cast<Eigen::Index>(weights.size()), "skin weights",
          static_cast<double>(weights.size()),
          "one list per vertex, " + std::to_string(input.skin.points.rows()));
  for (const auto& influences : weights) {
    for (const lattice::Influence& i : influences) {
      require(i.frame >= 0 && i.frame < num_joints, "skin weight's joint", i.frame,
              "0 to " + std::to_string(input.skeleton.num_joints() - 1));
    }
  }
  for (const auto& pose : input.poses) {
    require(static_cast<int>(pose.size()) == input.skeleton.num_joints(), "pose",
            static_cast<double>(pose.size()),
            "one transform per joint, " + std::to_string(input.skeleton.num_joints()));
  }
  const auto require_joint = [&](int joint, const char* field) {
    require(joint >= 0 && joint < num_joints, field, joint,
            "0 to " + std::to_string(input.skeleton.num_joints() - 1));
  };
  for (const JointMaterial& m : options.materials) require_joint(m.joint, "material's joint");
  for (const JointTie& tie : options.ties.joints) require_joint(tie.joint, "twist's joint");
  for (const auto& group : options.regions.groups) {
    for (const int joint : group) require_joint(joint, "region's joint");
  }
}

/// Joints that are frames besides those of bones and soft frames.
std::vector<int> further_frames(const BodyInput& input) {
  std::vector<int> joints = input.bare_frames;
  for (const HeldPlane& plane : input.held) joints.push_back(plane.joint);
  return joints;
}

/// Adds the leaf vertices on the planes to those on the bones; a vertex that a bone holds stays the bone's.
void hold_planes(const std::vector<HeldPlane>& planes, const FrameTree& tree, const lattice::LeafMesh& mesh,
                 BoneConstraints& bones) {
  if (planes.empty()) return;
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  const double tolerance = 1e-9 * size;  // of vertex means: a few roundings of coordinates of this size
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const Eigen::Vector3d x = mesh.points.row(a).transpose();
    for (const HeldPlane& plane : planes) {
      if (bones.is_bone[static_cast<std::size_t>(a)] ||
          std::abs((x - plane.point).dot(plane.normal)) > tolerance)
        continue;
      bones.is_bone[static_cast<std::size_t>(a)] = 1;
      const int frame = tree.frame_of_joint[static_cast<std::size_t>(plane.joint)];
      bones.vertices.push_back({a, frame, -1, plane.joint, plane.joint, x, x, 0.0});
    }
  }
  std::sort(bones.vertices.begin(), bones.vertices.end(),
            [](const BoneVertex& a, const BoneVertex& b) { return a.vertex < b.vertex; });
}

}  // namespace

void BodyOptions::validate() const {
  require(levels >= 0 && levels <= 3, "levels", levels, "0 to 3");
  validate_material(material);
  for (const JointMaterial& m : materials) validate_material(m.material);
  for (const RegionMaterial& m : region_materials) validate_material(m.applied_to(material));
  for (const JointTie& tie : ties.joints) {
    require(tie.radius.value_or(1.0) > 0.0, "twist radius", *tie.radius, "> 0");
    require(tie.stiffness.value_or(1.0) >= 0.0, "twist stiffness", *tie.stiffness, ">= 0");
  }
  require(damping.ratio >= 0.0, "damping", damping.ratio, ">= 0");
  require(damping.frequency > 0.0, "damping_frequency", damping.frequency, "a positive number of hertz");
  require(ties.stiffness >= 0.0, "twist stiffness", ties.stiffness, ">= 0");
  require(ties.radius > 0.0, "twist radius", ties.radius, "> 0");
  require(ghost.strength >= 0.0, "ghost penalty", ghost.strength, ">= 0");
  require(phong >= 0.0 && phong <= 1.0, "phong", phong, "0 to 1");
}

Material RegionMaterial::applied_to(Material material) const {
  material.young = young.value_or(material.young);
  material.poisson = poisson.value_or(material.poisson);
  material.density = density.value_or(material.density);
  return material;
}

namespace {

/// Materials per leaf cell: the dominant frame's, then those of the user's regions.
std::vector<Material> leaf_materials(const BodyInput& input, const BodyOptions& options,
                                     const lattice::Hierarchy& hierarchy, const lattice::LeafMesh& mesh,
                                     const FrameWeights& weights, const std::vector<Material>& of_frame) {
  std::vector<Material> materials;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    Material material = of_frame[static_cast<std::size_t>(dominant_frame(weights, mesh.cells[c]))];
    if (!input.lattice.regions.empty()) {
      const int coarse = lattice::coarse_cell(hierarchy, mesh, static_cast<int>(c));
      for (const RegionMaterial& own : options.region_materials)
        if (own.region == input.lattice.regions[static_cast<std::size_t>(coarse)])
          material = own.applied_to(material);
    }
    materials.push_back(material);
  }
  return materials;
}

/// A lattice that is its own mirror image.
struct LatticeMirror {
  lattice::MirrorMap map;
  std::vector<int> partners;  ///< of the hierarchy's vertices.
};

std::optional<LatticeMirror> lattice_mirror(const BodyInput& input, const lattice::Hierarchy& hierarchy) {
  if (!further_frames(input).empty()) return std::nullopt;  // they are in no lattice
  std::optional<lattice::MirrorMap> map = lattice::find_mirror_map(input.lattice, input.skin);
  if (!map) return std::nullopt;
  std::vector<int> partners = lattice::mirrored_vertices(hierarchy, *map);
  return LatticeMirror{std::move(*map), std::move(partners)};
}

/// Which leaf cells stay: those with flesh or skin, and with them all others of their coarse cell. Were only
/// some of its children kept, a level-0 hat could reach kept cells without having its own vertex there, and
/// it would be a combination of details.
std::vector<std::uint8_t> kept_cells(const BodyInput& input, const lattice::Hierarchy& hierarchy,
                                     const lattice::LeafMesh& mesh, std::vector<std::uint8_t> keep,
                                     const LatticeMirror* mirror) {
  std::vector<std::uint8_t> keep_coarse(hierarchy.coarse().cells.size(), 0);
  const auto coarse_of = [&](std::size_t c) {
    return static_cast<std::size_t>(lattice::coarse_cell(hierarchy, mesh, static_cast<int>(c)));
  };
  for (std::size_t c = 0; c < keep.size(); ++c) keep_coarse[coarse_of(c)] |= keep[c];
  for (std::size_t c = 0; mirror != nullptr && c < keep_coarse.size(); ++c)
    if (keep_coarse[c]) keep_coarse[static_cast<std::size_t>(mirror->map.cells[c])] = 1;
  rescue_bones(input.lattice, keep_coarse);
  for (std::size_t c = 0; c < keep.size(); ++c) keep[c] = keep_coarse[coarse_of(c)];
  return keep;
}

/// Embeds the skin, each vertex in a cell of its own limb.
lattice::Embedding own_embedding(const BodyInput& input, const lattice::LeafMesh& mesh,
                                 const lattice::LeafLimbs& limbs) {
  return lattice::embed(mesh, input.skin.points,
                        [&](int vertex, int cell) { return limbs.owns_vertex(cell, vertex); });
}

/// Fills the leaf cells of `mesh` and drops those without flesh from it.
std::vector<lattice::FillFractions> fill_with_flesh(const BodyInput& input, const BodyOptions& options,
                                                    const lattice::Hierarchy& hierarchy,
                                                    const FrameTree& tree, const LatticeMirror* mirror,
                                                    lattice::LeafMesh& mesh) {
  const double h = input.lattice.edge_length;
  const lattice::SurfaceQuery query(input.skin.points, input.skin.triangles);
  const lattice::LeafLimbs limbs(input.lattice, hierarchy, mesh, input.skin);
  std::vector<lattice::FillFractions> fill = lattice::fill_fractions(mesh, query, options.shell * h, &limbs);
  // A quarter of a level-1 cell: no octant that the skin crosses for more than a corner is overlooked.
  const double spacing = 0.125 * h * std::exp2(1 - std::max(1, options.levels));
  const lattice::TriangleSamples samples =
      lattice::sample_triangles(input.skin.points, input.skin.triangles, spacing);
  lattice::fill_grazed_octants(mesh, samples.points, fill, [&](int sample, int cell) {
    return limbs.owns_vertex(cell, samples.vertices[static_cast<std::size_t>(sample)]);
  });
  if (mirror != nullptr) symmetrise(body_mirror(mirror->map, mirror->partners, tree, mesh), fill);
  const std::vector<std::uint8_t> keep = kept_cells(
      input, hierarchy, mesh, lattice::filled_cells(fill, own_embedding(input, mesh, limbs).cell), mirror);
  std::vector<lattice::FillFractions> kept_fill;
  for (std::size_t c = 0; c < keep.size(); ++c) {
    if (keep[c]) kept_fill.push_back(fill[c]);
  }
  if (kept_fill.empty()) throw std::invalid_argument("no lattice cell holds any flesh");
  mesh = lattice::restrict_cells(hierarchy, mesh, keep);
  return kept_fill;
}

/// Mass of each vertex and volume of the flesh, from matrices and fill.
void weigh(Body& body) {
  body.vertex_mass.assign(static_cast<std::size_t>(body.mesh.num_vertices()), 0.0);
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    for (int e = body.matrices.row_start[static_cast<std::size_t>(a)];
         e < body.matrices.row_start[static_cast<std::size_t>(a) + 1]; ++e) {
      body.vertex_mass[static_cast<std::size_t>(a)] += body.matrices.mass[static_cast<std::size_t>(e)];
    }
  }
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    for (double w : gauss_weights(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]))
      body.volume += w;
  }
}

enum class Assembly { Left, Done };

/// Left: matrices, ties and masses are not made.
Body make(const BodyInput& input, const BodyOptions& options, Assembly assembly) {
  options.validate();
  check_input(input, options);
  const double h = input.lattice.edge_length;
  lattice::Hierarchy hierarchy(input.lattice.complex, std::max(1, options.levels));
  const lattice::ActiveSet active =
      lattice::uniform_active_set(hierarchy, options.levels, hard_chains(input.lattice));
  lattice::LeafMesh mesh = lattice::leaf_mesh(hierarchy, active);
  check_orientation(mesh);
  FrameTree tree = frame_tree(input.lattice, input.skeleton, further_frames(input));
  const std::optional<LatticeMirror> whole = lattice_mirror(input, hierarchy);
  std::vector<lattice::FillFractions> fill =
      fill_with_flesh(input, options, hierarchy, tree, whole ? &*whole : nullptr, mesh);
  const lattice::LeafLimbs limbs(input.lattice, hierarchy, mesh, input.skin);
  lattice::Embedding skin = own_embedding(input, mesh, limbs);
  const std::optional<BodyMirror> mirror =
      whole ? std::optional(body_mirror(whole->map, whole->partners, tree, mesh)) : std::nullopt;

  BoneConstraints bones = bone_constraints(input.lattice, tree, hierarchy, mesh);
  hold_planes(input.held, tree, mesh, bones);
  FrameWeights weights = frame_weights(hierarchy, mesh, skin, input.skin, tree, bones);
  if (mirror) symmetrise(*mirror, weights);

  const std::vector<Material> of_frame = frame_materials(tree, options);
  std::vector<Material> materials = leaf_materials(input, options, hierarchy, mesh, weights, of_frame);
  LeafMatrices matrices;
  if (assembly == Assembly::Done) matrices = assemble(mesh, materials, fill, options.ghost);
  std::vector<double> mu_of_frame;
  for (const Material& m : of_frame) mu_of_frame.push_back(m.mu());
  const LimbRadii radii(input.lattice, tree, input.skin, h, whole ? &whole->map : nullptr);
  std::vector<Tie> ties;
  if (assembly == Assembly::Done)
    ties = add_ties(input.lattice, tree, radii, mesh, limbs, mu_of_frame, h, options.ties, matrices);

  std::vector<PosedFrames> posed;
  for (const auto& pose : input.poses) posed.push_back(pose_frames(tree, pose, 0.0));
  std::vector<Region> regions = make_regions(input.lattice, tree, radii, mesh, weights,
                                             judge_bends(tree, posed, options.regions), options.regions);
  if (mirror) symmetrise(*mirror, regions);

  Body body{input.lattice,
            std::move(hierarchy),
            std::move(mesh),
            std::move(skin),
            std::move(fill),
            std::move(materials),
            std::move(matrices),
            std::move(tree),
            std::move(weights),
            std::move(bones),
            std::move(ties),
            std::move(regions),
            options.damping,
            std::any_of(posed.begin(), posed.end(), scales_joints),
            {},
            {},
            0.0,
            0.0,
            {}};
  body.size = (body.mesh.points.colwise().maxCoeff() - body.mesh.points.colwise().minCoeff()).norm();
  if (assembly == Assembly::Left) return body;
  body.skin_rows = phong_rows(body.mesh, body.fill, body.skin, input.skin, options.phong);
  if (body.grows) body.bone_extension = bone_extension(body.hierarchy, body.mesh, body.skin, body.bones);
  weigh(body);
  return body;
}

}  // namespace

Body make_body(const BodyInput& input, const BodyOptions& options) {
  return make(input, options, Assembly::Done);
}

Body paint_body(const BodyInput& input, const BodyOptions& options) {
  return make(input, options, Assembly::Left);
}

}  // namespace sinew::fem
