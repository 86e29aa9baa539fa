#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lattice/points.h"

/// The control lattice: a coarse complex of convex cells round the skin in which every hard bone is a chain
/// of edges ([Capell02, sec. 4.1]).
namespace sinew::lattice {

/// Shapes in which every vertex has valence 3, so that one subdivision gives one hexahedron per corner.
/// Pyramids are refused: their apex has valence 4.
enum class CellType : std::uint8_t { Tetrahedron, Wedge, Hexahedron };

/// Number of vertices of a cell: 4, 6 or 8.
constexpr int num_corners(CellType type) {
  return type == CellType::Tetrahedron ? 4 : type == CellType::Wedge ? 6 : 8;
}

/// One cell. Vertex order and orientation are VTK's (VTK_TETRA, VTK_WEDGE with its first triangle's normal
/// pointing to the second, VTK_HEXAHEDRON); a positively oriented cell has positive volume.
/// For the wedge: with a = v1-v0, b = v2-v0, c = v3-v0, positive volume means (a x b) . c > 0.
struct Cell {
  CellType type = CellType::Tetrahedron;
  /// Vertex indices; the first num_corners(type) are used, the others are -1.
  std::array<int, 8> vertices{-1, -1, -1, -1, -1, -1, -1, -1};
};

/// Cells and their vertices. Two cells meet in a whole face, edge or vertex, or not at all.
struct CellComplex {
  Points points;            ///< num_vertices x 3 [m], rest (r_a).
  std::vector<Cell> cells;  ///< all of positive volume.
};

/// A rest point whose posed position is (1-s) T_a X_a + s T_b X_b, with T the joint's affine map from rest to
/// now. A vertex on a tip bone has joint_a == joint_b.
struct BoneAnchor {
  int joint_a = -1;              ///< joint index of the rig.
  int joint_b = -1;              ///< joint index of the rig.
  Eigen::Vector3d x_a{0, 0, 0};  ///< rest point carried by joint_a [m].
  Eigen::Vector3d x_b{0, 0, 0};  ///< rest point carried by joint_b [m].
};

/// A bone of the lattice: a straight segment of the rest skeleton that moves with one frame.
struct LatticeBone {
  std::string name;  ///< unique among the lattice's bones.
  /// Joint whose rotation the flesh round this bone follows: bones of one joint share its frame.
  int frame = -1;
  BoneAnchor start;  ///< how the start (s = 0) moves; its rest position is (x_a at s = 0).
  BoneAnchor end;    ///< how the end (s = 1) moves.
  /// Rest end points [m].
  Eigen::Vector3d rest_start{0, 0, 0};
  Eigen::Vector3d rest_end{0, 0, 0};
  /// Hard bones: lattice vertices from start to end in order, each consecutive pair a lattice edge.
  /// Soft bones: empty.
  std::vector<int> chain;
  bool soft = false;  ///< held by penalty (P_b) instead of by vertices.
  bool tip = false;   ///< invented for a weighted leaf joint.
};

/// A frame on which flesh hangs without any bone: a weighted joint with no room for a tip bone. Held by a
/// penalty ball round its position.
struct SoftFrame {
  int frame = -1;                     ///< joint index.
  Eigen::Vector3d position{0, 0, 0};  ///< rest [m].
};

/// A change that the builder made to the user's skeleton.
struct SkeletonChange {
  std::string joint;   ///< name of the joint or bone concerned.
  std::string what;    ///< "contracted", "cut", "welded", "chained", "soft", "tip", "soft frame", "pruned".
  std::string reason;  ///< one sentence with the numbers that decided.
};

/// Quality of a lattice against its skin.
struct LatticeQuality {
  double min_dihedral_degrees = 0.0;
  /// Smallest scaled Jacobian of the level-1 hexahedra (a regular tetrahedron gives 0.707).
  double min_scaled_jacobian = 0.0;
  double min_volume = 0.0;    ///< [m^3].
  double volume_ratio = 0.0;  ///< lattice volume / skin volume (by winding number).
  int skin_vertices_outside = 0;
  int skin_triangles_outside = 0;  ///< triangles that leave the lattice though their vertices are inside.
  bool exact_chains = true;        ///< every hard bone is a chain of edges.
  int components = 0;              ///< connected components of cells.
  int components_without_bone = 0;
};

/// The name of a region of cells, where the user's file has one.
struct RegionName {
  int number = 0;  ///< as in ControlLattice::regions.
  std::string name;
};

/// One of several coincident cells: limbs that lie side by side in one place have a cell each, so that they
/// move apart. Its vertices coincide with those of the other copies, where they are not the same.
struct CellCopy {
  int cell = -1;            ///< index among the cells.
  int place = -1;           ///< smallest cell index among the copies that coincide.
  std::vector<int> frames;  ///< joints whose flesh it holds, ascending; no two copies of a place share one.
};

/// The whole product of the builder or of a reader.
struct ControlLattice {
  CellComplex complex;
  std::vector<LatticeBone> bones;  ///< hard and soft.
  std::vector<SoftFrame> soft_frames;
  /// Every cell that coincides with another one, ascending by cell; each place is named at least twice.
  std::vector<CellCopy> copies;
  std::vector<SkeletonChange> changes;
  LatticeQuality quality;
  /// For every joint of the tree: the frame (a joint index that owns a bone or a soft frame) that its skin
  /// weight counts for; -1 where there is none at all.
  std::vector<int> frame_of_joint;
  double edge_length = 0.0;  ///< target edge h [m]; where sizes vary, its mean over the cells.
  /// A plain grid of cubes, all bones soft: the builder's last resort.
  bool is_grid = false;
  int retries = 0;  ///< how many attempts the gate refused.
  /// Regions of the user's file (physical groups, references): the number of every cell's, or empty.
  std::vector<int> regions;
  std::vector<RegionName> region_names;  ///< of some of them.
};

/// Edges of a cell as pairs of corners; 6, 9 or 12 of them.
std::span<const std::array<int, 2>> cell_edges(CellType type);

/// Faces of a cell as corners, counter-clockwise seen from outside a cell of positive volume; the fourth
/// corner of a triangle is -1. 4, 5 or 6 of them.
std::span<const std::array<int, 4>> cell_faces(CellType type);

/// Signed volume of a cell [m^3]: positive for VTK's orientation. Hexahedra and wedges by splitting into
/// tetrahedra about the vertex mean, exact for plane faces.
double cell_volume(const CellComplex& complex, const Cell& cell);

/// Throws std::invalid_argument naming the cell when an index is out of range, a cell has no positive volume
/// or a chain of a hard bone is not a chain of edges.
void validate(const ControlLattice& lattice);

}  // namespace sinew::lattice
