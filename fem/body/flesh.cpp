#include "fem/body/flesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

#include "fem/body/cell_matrices.h"
#include "fem/body/coarser_cells.h"
#include "fem/body/growth.h"
#include "fem/body/mirror.h"
#include "fem/body/orientation.h"

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

/// Holds the vertices of the finest level for which `is_held`, by a joint that is a frame; a vertex that a
/// bone holds stays the bone's.
template <class IsHeld>
void hold_vertices(const lattice::LeafMesh& finest, int frame, int joint, const IsHeld& is_held,
                   BoneConstraints& bones) {
  for (int a = 0; a < finest.num_vertices(); ++a) {
    const Eigen::Vector3d x = finest.points.row(a).transpose();
    if (bones.is_bone[static_cast<std::size_t>(a)] || !is_held(x)) continue;
    bones.is_bone[static_cast<std::size_t>(a)] = 1;
    bones.vertices.push_back({a, frame, -1, joint, joint, x, x, 0.0});
  }
  std::sort(bones.vertices.begin(), bones.vertices.end(),
            [](const BoneVertex& a, const BoneVertex& b) { return a.vertex < b.vertex; });
}

/// Of several planes that hold a vertex the first counts.
void hold_planes(const std::vector<HeldPlane>& planes, const FrameTree& tree, const lattice::LeafMesh& finest,
                 BoneConstraints& bones) {
  const double size = (finest.points.colwise().maxCoeff() - finest.points.colwise().minCoeff()).norm();
  const double tolerance = 1e-9 * size;  // of vertex means: a few roundings of coordinates of this size
  for (const HeldPlane& plane : planes)
    hold_vertices(
        finest, tree.frame_of_joint[static_cast<std::size_t>(plane.joint)], plane.joint,
        [&](const Eigen::Vector3d& x) { return std::abs((x - plane.point).dot(plane.normal)) <= tolerance; },
        bones);
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

/// Materials per cell of the finest level: the dominant frame's, then those of the user's regions.
std::vector<Material> finest_materials(const BodyInput& input, const BodyOptions& options,
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

/// Which coarse cells stay: those with flesh or skin in one of their cells. Were only some of its children
/// kept, a level-0 hat could reach kept cells without having its own vertex there, and it would be a
/// combination of details. `keep`: per leaf cell.
std::vector<std::uint8_t> kept_cells(const BodyInput& input, const lattice::Hierarchy& hierarchy,
                                     const lattice::LeafMesh& mesh, const std::vector<std::uint8_t>& keep,
                                     const LatticeMirror* mirror) {
  std::vector<std::uint8_t> kept(hierarchy.coarse().cells.size(), 0);
  for (std::size_t c = 0; c < keep.size(); ++c)
    kept[static_cast<std::size_t>(lattice::coarse_cell(hierarchy, mesh, static_cast<int>(c)))] |= keep[c];
  for (std::size_t c = 0; mirror != nullptr && c < kept.size(); ++c)
    if (kept[c]) kept[static_cast<std::size_t>(mirror->map.cells[c])] = 1;
  rescue_bones(input.lattice, kept);
  return kept;
}

/// Embeds the skin, each vertex in a cell of its own limb.
lattice::Embedding own_embedding(const BodyInput& input, const lattice::LeafMesh& mesh,
                                 const lattice::LeafLimbs& limbs) {
  return lattice::embed(mesh, input.skin.points,
                        [&](int vertex, int cell) { return limbs.owns_vertex(cell, vertex); });
}

/// Fill of all leaf cells of the finest level, and the coarse cells that stay.
struct Filled {
  std::vector<lattice::FillFractions> fill;
  std::vector<std::uint8_t> kept;
};

Filled fill_with_flesh(const BodyInput& input, const BodyOptions& options,
                       const lattice::Hierarchy& hierarchy, const FrameTree& tree,
                       const LatticeMirror* mirror, const lattice::LeafMesh& mesh) {
  const double h = input.lattice.edge_length;
  const lattice::SurfaceQuery query(input.skin.points, input.skin.triangles);
  const lattice::LeafLimbs limbs(input.lattice, hierarchy, mesh, input.skin);
  std::vector<lattice::FillFractions> fill = lattice::fill_fractions(mesh, query, options.shell * h, &limbs);
  // A quarter of a level-1 cell: no octant that the skin crosses for more than a corner is overlooked.
  const double spacing = 0.125 * h * std::exp2(1 - hierarchy.num_levels());
  const lattice::TriangleSamples samples =
      lattice::sample_triangles(input.skin.points, input.skin.triangles, spacing);
  lattice::fill_grazed_octants(mesh, samples.points, fill, [&](int sample, int cell) {
    return limbs.owns_vertex(cell, samples.vertices[static_cast<std::size_t>(sample)]);
  });
  if (mirror != nullptr) symmetrise(body_mirror(mirror->map, mirror->partners, tree, mesh), fill);
  std::vector<std::uint8_t> kept = kept_cells(
      input, hierarchy, mesh, lattice::filled_cells(fill, own_embedding(input, mesh, limbs).cell), mirror);
  if (std::find(kept.begin(), kept.end(), 1) == kept.end())
    throw std::invalid_argument("no lattice cell holds any flesh");
  return {std::move(fill), std::move(kept)};
}

/// Keeps fill and materials of the cells of the finest mesh, and gives coarser cells those of their children.
void set_cells(Flesh& flesh, const std::vector<lattice::FillFractions>& fill,
               const std::vector<Material>& materials) {
  const int finest = flesh.hierarchy.num_levels();
  for (int level = 1; level <= finest; ++level) {
    const std::size_t num_hexes = flesh.hierarchy.hexes(level).size();
    flesh.fill.of_level.emplace_back(num_hexes, lattice::FillFractions{});
    flesh.materials.of_level.emplace_back(num_hexes);
  }
  for (std::size_t c = 0; c < fill.size(); ++c) {
    flesh.fill.at(finest, flesh.finest.hex[c]) = fill[c];
    flesh.materials.at(finest, flesh.finest.hex[c]) = materials[c];
  }
  for (int level = finest - 1; level >= 1; --level) {
    const auto corners = [&](int on_level, int hex) {
      return lattice::hex_corners(flesh.hierarchy.points(),
                                  flesh.hierarchy.hexes(on_level)[static_cast<std::size_t>(hex)]);
    };
    for (int hex = 0; hex < static_cast<int>(flesh.hierarchy.hexes(level).size()); ++hex) {
      const int coarse = flesh.hierarchy.coarse_cell(hex >> (3 * (level - 1)));
      if (!flesh.kept[static_cast<std::size_t>(coarse)]) continue;
      std::array<lattice::HexCorners, 8> children;
      std::array<lattice::FillFractions, 8> child_fill;
      std::array<Material, 8> child_material;
      std::array<double, 8> volume{};
      for (int k = 0; k < 8; ++k) {
        const auto i = static_cast<std::size_t>(k);
        children[i] = corners(level + 1, 8 * hex + k);
        child_fill[i] = flesh.fill.at(level + 1, 8 * hex + k);
        child_material[i] = flesh.materials.at(level + 1, 8 * hex + k);
        for (const double w : gauss_weights(children[i], child_fill[i])) volume[i] += w;
      }
      flesh.fill.at(level, hex) = coarser_fill(corners(level, hex), children, child_fill);
      flesh.materials.at(level, hex) = coarser_material(child_material, volume);
    }
  }
}

/// The part of `of_all`, one per leaf cell of the whole lattice, that belongs to kept cells.
std::vector<lattice::FillFractions> of_kept(const lattice::Hierarchy& hierarchy,
                                            const lattice::LeafMesh& whole,
                                            const std::vector<std::uint8_t>& kept,
                                            const std::vector<lattice::FillFractions>& of_all) {
  std::vector<lattice::FillFractions> picked;
  for (std::size_t c = 0; c < of_all.size(); ++c)
    if (kept[static_cast<std::size_t>(lattice::coarse_cell(hierarchy, whole, static_cast<int>(c)))])
      picked.push_back(of_all[c]);
  return picked;
}

}  // namespace

Flesh make_flesh(const BodyInput& input, const BodyOptions& options) {
  options.validate();
  check_input(input, options);
  lattice::Hierarchy hierarchy(input.lattice.complex, std::max(1, options.levels));
  const lattice::ActiveSet all =
      lattice::uniform_active_set(hierarchy, hierarchy.num_levels(), hard_chains(input.lattice));
  const lattice::LeafMesh whole = lattice::leaf_mesh(hierarchy, all);
  check_orientation(whole);
  FrameTree tree = frame_tree(input.lattice, input.skeleton, further_frames(input));
  const std::optional<LatticeMirror> mirrored = lattice_mirror(input, hierarchy);
  Filled filled = fill_with_flesh(input, options, hierarchy, tree, mirrored ? &*mirrored : nullptr, whole);
  const std::vector<lattice::FillFractions> fill = of_kept(hierarchy, whole, filled.kept, filled.fill);
  lattice::LeafMesh finest = lattice::leaf_mesh(hierarchy, all, filled.kept);
  const lattice::LeafLimbs limbs(input.lattice, hierarchy, finest, input.skin);
  lattice::Embedding skin = own_embedding(input, finest, limbs);
  const std::optional<BodyMirror> mirror =
      mirrored ? std::optional(body_mirror(mirrored->map, mirrored->partners, tree, finest)) : std::nullopt;

  BoneConstraints bones = bone_constraints(input.lattice, tree, hierarchy, finest);
  hold_planes(input.held, tree, finest, bones);
  FrameWeights weights = frame_weights(hierarchy, finest, skin, input.skin, tree, bones);
  if (mirror) symmetrise(*mirror, weights);

  const std::vector<Material> of_frame = frame_materials(tree, options);
  const std::vector<Material> materials =
      finest_materials(input, options, hierarchy, finest, weights, of_frame);
  std::vector<double> mu_of_frame;
  for (const Material& m : of_frame) mu_of_frame.push_back(m.mu());
  const LimbRadii radii(input.lattice, tree, input.skin, input.lattice.edge_length,
                        mirrored ? &mirrored->map : nullptr);

  std::vector<PosedFrames> posed;
  for (const auto& pose : input.poses) posed.push_back(pose_frames(tree, pose, 0.0));
  std::vector<Region> regions = make_regions(input.lattice, tree, radii, finest, weights,
                                             judge_bends(tree, posed, options.regions), options.regions);
  if (mirror) symmetrise(*mirror, regions);
  std::vector<TieLaw> ties = tie_laws(input.lattice, tree, radii, finest, limbs, mu_of_frame, options.ties);
  const bool grows = std::any_of(posed.begin(), posed.end(), scales_joints);
  FrameWeights extension;
  if (grows) extension = bone_extension(hierarchy, finest, skin, bones);

  Flesh flesh{input.lattice,
              std::move(hierarchy),
              std::move(filled.kept),
              std::move(finest),
              {},
              {},
              std::move(tree),
              std::move(weights),
              std::move(bones),
              std::move(extension),
              std::move(regions),
              std::move(ties),
              lattice::LimbCopies(input.lattice),
              {input.skin.points, input.skin.triangles, {}},
              std::move(skin),
              options.ghost,
              options.phong,
              options.damping,
              grows};
  set_cells(flesh, fill, materials);
  return flesh;
}

Flesh make_flesh(const PlainFlesh& plain) {
  lattice::ControlLattice lattice;
  lattice.complex = plain.cells;
  lattice.edge_length = plain.edge_length;
  lattice::Hierarchy hierarchy(lattice.complex, std::max(1, plain.levels));
  lattice::LeafMesh finest =
      lattice::leaf_mesh(hierarchy, lattice::uniform_active_set(hierarchy, hierarchy.num_levels(), {}));
  check_orientation(finest);
  std::vector<lattice::FillFractions> fill(finest.cells.size());
  for (std::size_t c = 0; c < fill.size(); ++c) {
    const lattice::HexCorners corners = lattice::hex_corners(finest.points, finest.cells[c]);
    for (int q = 0; q < 8; ++q) {
      const Eigen::Vector3d x = corners.transpose() * lattice::trilinear_weights(gauss_point(q));
      fill[c][static_cast<std::size_t>(q)] = plain.fill ? plain.fill(x) : 1.0;
    }
  }
  BoneConstraints bones;
  bones.is_bone.assign(static_cast<std::size_t>(finest.num_vertices()), 0);
  if (plain.held) hold_vertices(finest, 0, plain.frame.joint, plain.held, bones);
  Region region{0, 0, 0.0, plain.frame.origin_rest, {}, {}};
  FrameWeights weights(finest.num_vertices(), 1);
  for (int a = 0; a < finest.num_vertices(); ++a) {
    weights.insert(a, 0) = 1.0;
    region.vertices.push_back(a);
    region.weights.push_back(1.0);
  }
  weights.makeCompressed();
  const std::vector<Material> materials(finest.cells.size(), plain.material);
  const lattice::LimbCopies copies(lattice);
  lattice::Embedding skin = lattice::embed(finest, finest.points);
  std::vector<std::uint8_t> kept(lattice.complex.cells.size(), 1);
  lattice::Surface surface{finest.points, {}, {}};
  Flesh flesh{std::move(lattice),
              std::move(hierarchy),
              std::move(kept),
              std::move(finest),
              {},
              {},
              {{plain.frame}, {0}},
              std::move(weights),
              std::move(bones),
              {},
              {std::move(region)},
              {},
              copies,
              std::move(surface),
              std::move(skin),
              plain.ghost,
              0.0,
              plain.damping,
              false};
  set_cells(flesh, fill, materials);
  return flesh;
}

lattice::ActiveSet uniform_set(const Flesh& flesh, int level) {
  return lattice::uniform_active_set(flesh.hierarchy, level, hard_chains(flesh.lattice));
}

}  // namespace sinew::fem
