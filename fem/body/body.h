#pragma once

#include <memory>
#include <vector>

#include "fem/body/flesh.h"
#include "fem/body/leaf_matrices.h"

/// The body: what one active set makes of the flesh. It does not change while it moves.
namespace sinew::fem {

/// Built by make_body or changed; read by the solvers.
struct Body {
  lattice::ControlLattice lattice;
  lattice::Hierarchy hierarchy;
  lattice::LeafMesh mesh;
  lattice::Embedding skin;                   ///< of surface.points, trilinear.
  std::vector<lattice::FillFractions> fill;  ///< per leaf cell.
  std::vector<Material> materials;           ///< per leaf cell.
  LeafMatrices matrices;
  FrameTree tree;
  FrameWeights weights;  ///< s_f of leaf vertices.
  BoneConstraints bones;
  std::vector<Tie> ties;
  std::vector<Region> regions;
  Damping damping;
  bool grows = false;               ///< as in Flesh.
  FrameWeights bone_extension;      ///< of leaf vertices; empty where nothing grows.
  std::vector<double> vertex_mass;  ///< row sums of M [kg].
  double volume = 0.0;              ///< of the flesh [m^3].
  double size = 0.0;                ///< diagonal of the lattice's box [m].
  /// How leaf values move the skin, num_points x num_vertices (fem/body/phong_skin.h).
  Eigen::SparseMatrix<double, Eigen::RowMajor> skin_rows = {};
  std::shared_ptr<const Flesh> flesh = {};  ///< what it is made of.
  long revision = 0;                        ///< how often the active set changed before.
};

/// The body of any active set of the flesh's hierarchy, of one level or of several. Throws
/// std::invalid_argument where `flesh` is null, a leaf cell is inverted, a function of level 0 is inactive or
/// the set has the wrong length.
Body make_body(std::shared_ptr<const Flesh> flesh, const lattice::ActiveSet& active);

/// The body of another set of the same flesh; its revision is one more. Nothing that was changed by hand in
/// `body` is in it. Errors as of make_body.
Body changed(const Body& body, const lattice::ActiveSet& active);

/// Flesh and body in one, every function up to options.levels active. Throws as make_flesh.
Body make_body(const BodyInput& input, const BodyOptions& options = {});

/// The same without what it takes to move: no matrices, no ties, no masses. For looking at fill, materials
/// and regions; takes a fraction of the memory.
Body paint_body(const BodyInput& input, const BodyOptions& options = {});

}  // namespace sinew::fem
