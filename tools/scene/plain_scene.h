#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lattice/control_lattice.h"

/// Scenes without a rig: a box of flesh, bones given as segments, faces that are held, loads. Benchmarks and
/// regression scenes are short text files this way.
namespace sinew::tools {

/// `[lattice]`: the box, cut into equal blocks.
struct PlainBox {
  Eigen::Vector3d corner{0, 0, 0};  ///< lower corner [m].
  Eigen::Vector3d size{1, 1, 1};    ///< [m]; each > 0.
  Eigen::Vector3i cells{1, 1, 1};   ///< blocks along x, y, z; each >= 1.
  /// What a block becomes: one hexahedron, two wedges or six tetrahedra.
  lattice::CellType type = lattice::CellType::Hexahedron;

  friend bool operator==(const PlainBox&, const PlainBox&) = default;
};

/// Where a bone is at one time, against its parent's frame.
struct PlainKey {
  double time = 0.0;              ///< [s]; increasing.
  Eigen::Vector3d move{0, 0, 0};  ///< of the bone's start, in the parent's axes [m].
  Eigen::Vector3d axis{0, 0, 1};  ///< of the turn about the bone's start, in the parent's axes; not zero.
  /// Angle of the turn [degrees]. From key to key it runs straight where the axis stays the same, over any
  /// number of turns; else the rotations are slerped the short way.
  double angle = 0.0;

  friend bool operator==(const PlainKey&, const PlainKey&) = default;
};

/// `[[bone]]`: a segment that the flesh follows.
struct PlainBone {
  std::string name;                              ///< unique, not empty.
  std::string parent;                            ///< name of a bone further up in the file; empty: none.
  Eigen::Vector3d start{0, 0, 0}, end{0, 0, 0};  ///< rest [m]; a chain of lattice edges unless `soft`.
  bool soft = false;                             ///< held by penalty instead of by vertices.
  std::vector<PlainKey> keys;                    ///< none: the bone stands still against its parent.

  friend bool operator==(const PlainBone&, const PlainBone&) = default;
};

/// A side of the box.
struct BoxFace {
  int axis = 0;       ///< 0 x, 1 y, 2 z.
  bool high = false;  ///< at the largest coordinate.

  /// -1 or +1: the outward normal's component along `axis`.
  int sign() const { return high ? 1 : -1; }

  friend bool operator==(const BoxFace&, const BoxFace&) = default;
};

/// `[[fixed]]`: a side of the box that is held in every component.
struct FixedFace {
  BoxFace face;
  std::string bone;  ///< moves with this bone; empty: stands still.

  friend bool operator==(const FixedFace&, const FixedFace&) = default;
};

/// `[[point_load]]`: a force on one point of the flesh.
struct PlainPointLoad {
  Eigen::Vector3d at{0, 0, 0};     ///< rest [m]; in the box.
  Eigen::Vector3d force{0, 0, 0};  ///< [N], of fixed direction.

  friend bool operator==(const PlainPointLoad&, const PlainPointLoad&) = default;
};

/// `[[body_load]]`: a force on all of the flesh, of fixed direction.
struct PlainBodyLoad {
  Eigen::Vector3d density{0, 0, 0};       ///< per volume at rest [N/m^3].
  Eigen::Vector3d acceleration{0, 0, 0};  ///< per mass [m/s^2].

  friend bool operator==(const PlainBodyLoad&, const PlainBodyLoad&) = default;
};

/// `[[face_load]]`: a force on a side of the box.
struct PlainFaceLoad {
  BoxFace face;
  /// Against the posed surface, turning with it [Pa]; positive pushes inwards.
  double pressure = 0.0;
  /// Per area at rest, of fixed direction [Pa].
  Eigen::Vector3d traction{0, 0, 0};

  friend bool operator==(const PlainFaceLoad&, const PlainFaceLoad&) = default;
};

/// `[velocity]`: what flesh that no bone holds starts with, linear + spin x (position - about).
struct PlainVelocity {
  Eigen::Vector3d linear{0, 0, 0};       ///< [m/s].
  Eigen::Vector3d spin{0, 0, 0};         ///< about its direction by the right hand [degrees/s].
  std::optional<Eigen::Vector3d> about;  ///< [m]; unset: the box's centre.

  friend bool operator==(const PlainVelocity&, const PlainVelocity&) = default;
};

/// Everything of a scene that a rig would say otherwise.
struct PlainScene {
  PlainBox box;
  std::vector<PlainBone> bones;
  std::vector<FixedFace> fixed;
  std::vector<PlainPointLoad> point_loads;
  std::vector<PlainBodyLoad> body_loads;
  std::vector<PlainFaceLoad> face_loads;
  std::optional<PlainVelocity> velocity;

  /// True where anything holds the flesh against falling.
  bool is_held() const { return !bones.empty() || !fixed.empty(); }
  bool is_loaded() const { return !point_loads.empty() || !body_loads.empty() || !face_loads.empty(); }

  /// Throws assets::ConfigError naming the thing, its value and the range.
  void validate() const;

  friend bool operator==(const PlainScene&, const PlainScene&) = default;
};

/// "x-min", "x-max", "y-min", ...
std::string face_name(const BoxFace& face);
/// nullopt for anything else.
std::optional<BoxFace> find_face(const std::string& name);
/// "hexahedra", "wedges", "tetrahedra".
std::string cell_type_name(lattice::CellType type);
std::optional<lattice::CellType> find_cell_type(const std::string& name);

/// The tables as TOML; opens with an empty line.
std::string print_plain_scene(const PlainScene& plain);

}  // namespace sinew::tools
