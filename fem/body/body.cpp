#include "fem/body/body.h"

#include <algorithm>
#include <stdexcept>

#include "fem/body/cell_matrices.h"
#include "fem/body/orientation.h"
#include "fem/body/phong_skin.h"

namespace sinew::fem {
namespace {

/// Which vertices of the finest mesh a leaf mesh has.
struct Picked {
  std::vector<int> of_leaf;    ///< per leaf vertex the finest mesh's.
  std::vector<int> of_finest;  ///< its inverse; -1 where the leaf mesh has none.
};

Picked picked_vertices(const lattice::LeafMesh& finest, const lattice::LeafMesh& mesh) {
  Picked picked;
  picked.of_finest.assign(static_cast<std::size_t>(finest.num_vertices()), -1);
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const int vertex = mesh.vertices[static_cast<std::size_t>(a)];
    const int of_finest = finest.leaf_of_vertex[static_cast<std::size_t>(vertex)];
    picked.of_leaf.push_back(of_finest);
    picked.of_finest[static_cast<std::size_t>(of_finest)] = a;
  }
  return picked;
}

/// Rows of the leaf vertices. NewColumn: (int column) -> int, ascending.
template <class NewColumn>
FrameWeights picked_rows(const FrameWeights& all, const Picked& picked, Eigen::Index num_columns,
                         const NewColumn& new_column) {
  FrameWeights rows(static_cast<Eigen::Index>(picked.of_leaf.size()), num_columns);
  rows.reserve(all.nonZeros());
  for (std::size_t a = 0; a < picked.of_leaf.size(); ++a) {
    rows.startVec(static_cast<Eigen::Index>(a));
    for (FrameWeights::InnerIterator it(all, picked.of_leaf[a]); it; ++it)
      rows.insertBack(static_cast<Eigen::Index>(a), new_column(static_cast<int>(it.col()))) = it.value();
  }
  rows.finalize();
  return rows;
}

BoneConstraints picked_bones(const BoneConstraints& all, const Picked& picked) {
  BoneConstraints bones;
  bones.is_bone.assign(picked.of_leaf.size(), 0);
  for (BoneVertex bone : all.vertices) {
    bone.vertex = picked.of_finest[static_cast<std::size_t>(bone.vertex)];
    if (bone.vertex < 0) continue;
    bones.is_bone[static_cast<std::size_t>(bone.vertex)] = 1;
    bones.vertices.push_back(bone);
  }
  // Chains are of level 0, whose vertices every leaf mesh has; -1 where no kept cell has one.
  for (std::vector<int> chain : all.chains) {
    for (int& v : chain)
      if (v >= 0) v = picked.of_finest[static_cast<std::size_t>(v)];
    bones.chains.push_back(std::move(chain));
  }
  return bones;
}

/// The extension's columns belong to the bones' vertices; those that a set lacks are finer than level 0, and
/// their columns are empty.
FrameWeights picked_extension(const Flesh& flesh, const BoneConstraints& bones, const Picked& picked) {
  std::vector<int> column(flesh.bones.vertices.size(), -1);
  int next = 0;
  for (std::size_t k = 0; k < column.size(); ++k)
    if (picked.of_finest[static_cast<std::size_t>(flesh.bones.vertices[k].vertex)] >= 0) column[k] = next++;
  return picked_rows(flesh.bone_extension, picked, static_cast<Eigen::Index>(bones.vertices.size()),
                     [&](int k) { return column[static_cast<std::size_t>(k)]; });
}

std::vector<Region> picked_regions(const std::vector<Region>& all, const Picked& picked) {
  std::vector<Region> regions;
  for (const Region& whole : all) {
    Region region{whole.first, whole.second, whole.t, whole.origin_rest, {}, {}};
    for (std::size_t k = 0; k < whole.vertices.size(); ++k) {
      const int leaf = picked.of_finest[static_cast<std::size_t>(whole.vertices[k])];
      if (leaf < 0) continue;
      region.vertices.push_back(leaf);
      region.weights.push_back(whole.weights[k]);
    }
    if (!region.vertices.empty()) regions.push_back(std::move(region));
  }
  return regions;
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
Body make(std::shared_ptr<const Flesh> of, const lattice::ActiveSet& active, Assembly assembly) {
  if (!of) throw std::invalid_argument("make_body: there is no flesh");
  const Flesh& flesh = *of;
  lattice::LeafMesh mesh = lattice::leaf_mesh(flesh.hierarchy, active, flesh.kept);
  check_orientation(mesh);
  const std::vector<int> leaf_of_finest = lattice::containing_cells(flesh.finest, mesh);
  lattice::Embedding skin = lattice::carried_embedding(flesh.finest, flesh.skin, mesh, leaf_of_finest);
  std::vector<lattice::FillFractions> fill;
  std::vector<Material> materials;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    fill.push_back(flesh.fill.at(mesh.level[c], mesh.hex[c]));
    materials.push_back(flesh.materials.at(mesh.level[c], mesh.hex[c]));
  }
  const Picked picked = picked_vertices(flesh.finest, mesh);
  FrameWeights weights =
      picked_rows(flesh.weights, picked, flesh.weights.cols(), [](int frame) { return frame; });
  BoneConstraints bones = picked_bones(flesh.bones, picked);
  FrameWeights extension;
  if (flesh.grows) extension = picked_extension(flesh, bones, picked);
  std::vector<Region> regions = picked_regions(flesh.regions, picked);
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  Body body{flesh.lattice,
            flesh.hierarchy,
            std::move(mesh),
            std::move(skin),
            std::move(fill),
            std::move(materials),
            {},
            flesh.tree,
            std::move(weights),
            std::move(bones),
            {},
            std::move(regions),
            flesh.damping,
            flesh.grows,
            std::move(extension),
            {},
            0.0,
            size,
            {},
            of,
            0};
  if (assembly == Assembly::Left) return body;
  body.matrices = assemble(body.mesh, body.materials, body.fill, flesh.ghost);
  body.ties = add_ties(flesh.ties, {flesh.hierarchy, body.mesh, leaf_of_finest, flesh.copies}, body.matrices);
  body.skin_rows = phong_rows(body.mesh, body.fill, body.skin, flesh.surface, flesh.phong);
  weigh(body);
  return body;
}

/// Flesh and body in one.
Body make(const BodyInput& input, const BodyOptions& options, Assembly assembly) {
  const auto flesh = std::make_shared<const Flesh>(make_flesh(input, options));
  return make(flesh, uniform_set(*flesh, options.levels), assembly);
}

}  // namespace

Body make_body(std::shared_ptr<const Flesh> flesh, const lattice::ActiveSet& active) {
  return make(std::move(flesh), active, Assembly::Done);
}

Body changed(const Body& body, const lattice::ActiveSet& active) {
  Body next = make(body.flesh, active, Assembly::Done);
  next.revision = body.revision + 1;
  return next;
}

Body make_body(const BodyInput& input, const BodyOptions& options) {
  return make(input, options, Assembly::Done);
}

Body paint_body(const BodyInput& input, const BodyOptions& options) {
  return make(input, options, Assembly::Left);
}

}  // namespace sinew::fem
