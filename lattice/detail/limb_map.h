#pragma once

#include <array>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "lattice/control_lattice.h"
#include "lattice/detail/rig_input.h"
#include "lattice/detail/skeleton_distance.h"
#include "lattice/detail/triangle_grid.h"

namespace sinew::lattice::detail {

/// A face of a complex of which no face belongs to more than two cells.
struct CellFace {
  std::array<int, 4> vertices;  ///< outward from `first`; the fourth of a triangle is -1.
  int first = -1;               ///< cell.
  int second = -1;              ///< cell; -1 on the boundary.
};

/// Every face once, in an order that depends on the vertex indices alone.
std::vector<CellFace> faces_of(const CellComplex& complex);

/// Flesh that hangs on one stretch of a bone.
struct LimbPiece {
  int frame = -1;  ///< joint, or that of a bare bone (LimbMap).
  BoneStretch stretch;
};

/// The part of one limb that lies in one place; ascending by frame and bone, empty where nobody knows.
using Limb = std::vector<LimbPiece>;

/// Which limbs lie in which cell. Skin and bones in a cell are of one limb if they follow the same frame, if
/// one triangle of the skin hangs on both, or if flesh of both hangs together in the cell: without skin
/// between them, or, of a joint and the one above it, through each other's skin. That holds only where they
/// are less than 1.5 h apart along the skeleton, h the target edge of the place: flesh of a hand that rests
/// on a thigh is not of one limb with it. Of sheets and of bones outside the flesh nobody knows where flesh
/// is: there the way along the skeleton decides alone.
///
/// A bare bone, one of a joint that no skin follows, has a frame of its own, past the joints: two hip bones
/// of one pelvis do not tie the thighs that they run into. Out of flesh it goes with the bones at its ends.
///
/// Of a mirrored rig what is found in a place is also there in its mirror image: triangles may be split in
/// two ways, and a vertex in the plane follows one frame of two alike.
class LimbMap {
 public:
  /// `faces` are those of `lattice.complex`; everything must outlive the map.
  LimbMap(const RigInput& input, const ReducedSkeleton& skeleton, const ControlLattice& lattice,
          const std::vector<CellFace>& faces);

  /// The limbs in a cell, ascending; none where neither skin nor bone is in it.
  const std::vector<Limb>& limbs(int cell) const { return limbs_[cell]; }
  /// Whether skin is in a cell, also such that follows no frame.
  bool has_skin(int cell) const { return has_skin_[cell]; }
  /// Shortest way along the skeleton, unit coordinates; 0 where they follow the same frame.
  double distance(const Limb& a, const Limb& b) const;
  /// Whether flesh of one frame is in both.
  static bool share_frame(const Limb& a, const Limb& b);
  /// Of the flesh at p (unit coordinates): as the closest skin; of a mirrored rig also as the image of what
  /// is at the image of p. None outside the skin.
  std::vector<Limb> flesh_at(const Eigen::Vector3d& p) const;
  /// The joint of a frame.
  int joint_of(int frame) const;
  bool is_bare(int frame) const { return frame >= static_cast<int>(frame_of_joint_.size()); }
  /// Of the bone at a vertex of its chain.
  Limb bone_at(int bone, const Eigen::Vector3d& p) const;
  /// The frame of every joint before floating parts get soft frames of their own.
  const std::vector<int>& frame_of_joint() const { return frame_of_joint_; }

 private:
  /// What is known of a cell before its pieces are gathered to limbs.
  struct Label {
    std::vector<LimbPiece> pieces;
    std::vector<std::array<int, 2>> joined;              ///< frames.
    std::vector<int> skins;                              ///< frames of skin that is there.
    std::vector<int> sheets;                             ///< frames of skin with no flesh behind it.
    std::vector<std::pair<int, Eigen::Vector3d>> bones;  ///< frames and places along their bones.
    bool has_skin = false;
  };
  struct Corners {
    std::array<Eigen::Vector3d, 3> points;
    std::array<int, 3> frames;
  };

  LimbPiece piece_at(int frame, const Eigen::Vector3d& p) const;
  void add(Label& label, int frame, const Eigen::Vector3d& p) const;
  void add_triangle(Label& label, int triangle, const Eigen::Vector3d& p) const;
  void add_bone(Label& label, int bone, const Eigen::Vector3d& p) const;
  void label_skin(std::vector<Label>& labels, const std::vector<CellFace>& faces) const;
  void label_bones(std::vector<Label>& labels) const;
  void mirror(std::vector<Label>& labels) const;
  int bone_of(int bare_frame) const { return bare_frame - static_cast<int>(frame_of_joint_.size()); }
  bool is_above(int parent, int frame) const;
  int image(int frame) const;
  LimbPiece image(const LimbPiece& piece) const;
  std::optional<Limb> own_flesh_at(const Eigen::Vector3d& p) const;
  double edge_at(std::span<const int> vertices) const;
  void join_flesh(Label& label, const Cell& cell) const;
  std::vector<Limb> gather(const Label& label) const;

  const RigInput& input_;
  const ReducedSkeleton& skeleton_;
  const ControlLattice& lattice_;
  SkeletonDistance distance_;
  double h_;                                ///< unit coordinates.
  std::vector<int> frame_of_joint_;         ///< with the soft frames of the skeleton.
  std::vector<int> frame_of_bone_;          ///< bone edges that no skin hangs on have frames of their own.
  std::vector<std::vector<int>> bones_of_;  ///< per joint: those its weight counts for.
  std::vector<std::array<int, 3>> frames_;  ///< of the corners of the welded skin's triangles.
  std::vector<bool> is_sheet_;              ///< per welded vertex: no flesh is behind it.
  TriangleGrid grid_;                       ///< the skin's triangles.
  std::vector<std::vector<Limb>> limbs_;
  std::vector<bool> has_skin_;  ///< per cell.
};

}  // namespace sinew::lattice::detail
