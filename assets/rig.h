#pragma once

#include <array>
#include <string>
#include <vector>

#include "lattice/points.h"
#include "lattice/surface.h"
#include "skeleton/clip.h"
#include "skeleton/skeleton.h"

namespace sinew::assets {

/// Something worth telling about a file that is still usable, or the reason why it is not.
struct Finding {
  enum class Severity { Info, Warning, Error };
  Severity severity = Severity::Info;
  std::string code;     ///< short, stable, kebab-case: "weights-normalised".
  std::string where;    ///< joint, part or clip by the user's name; may be empty.
  std::string message;  ///< what, with numbers.
  std::string remedy;   ///< what to do; may be empty for Info.
};

/// How a part of the character moves.
enum class PartRole {
  Simulated,  ///< skinned and made of flesh: embedded in the lattice.
  Skinned,    ///< skinned, but follows by plain skinning (not simulated).
  Rigid,      ///< follows one joint (or stands still when joint is -1).
  Riding,     ///< skinned, and carried along by what moves the flesh round it.
};

/// One mesh of the file, in the file's own vertex order.
struct Part {
  std::string name;  ///< unique in the rig.
  PartRole role = PartRole::Rigid;
  /// Rest positions, num_vertices x 3 [m], in the rig's space: skinning the rest pose gives these back.
  lattice::Points points;
  lattice::Triangles triangles;  ///< winding outward after mirrored nodes were accounted for.
  /// Skinned parts: influences per vertex, frame = joint index; each sums to 1. Rigid parts: empty.
  std::vector<std::vector<lattice::Influence>> weights;
  int joint = -1;  ///< Rigid: the joint it follows.
  /// Simulated: triangles that physics takes the other way round, as their closed shell shows; ascending.
  std::vector<int> turned;
};

/// A clip of the file that cannot be played.
struct FaultyClip {
  std::string name;
  std::string reason;  ///< what is wrong and the remedy, one line without the file.
  int index = 0;       ///< its place among all clips of the file.
};

/// A vertex of the flesh with its share in what carries a prop.
struct Anchor {
  int vertex = 0;       ///< of the rig (part by part).
  double weight = 0.0;  ///< [-]; > 0.
};

/// A piece of the character that keeps its shape: a weapon, a hat, an eye.
struct Prop {
  std::string name;                   ///< of its island (assets/islands.h).
  PartRole role = PartRole::Skinned;  ///< Skinned, Rigid or Riding.
  int joint = -1;                     ///< that it hangs on; -1 where there is not one alone.
  std::vector<int> vertices;          ///< of the rig (part by part), ascending.
  std::vector<Anchor> anchors;        ///< Riding: the flesh round it; weights sum to 1.
  std::string reason;                 ///< of its role.
};

enum class UpAxis { X, Y, Z };

/// A character as plain values: SI units, right-handed, Y up, skeleton rest = bind pose.
struct Rig {
  std::string file;    ///< as the user gave it.
  std::string format;  ///< "glTF 2.0", "FBX", "Collada", ...
  std::vector<Part> parts;
  /// What keeps its shape, whatever the role of its part. Nothing before set_roles (assets/islands.h).
  std::vector<Prop> props;
  skeleton::Skeleton skeleton;
  std::vector<skeleton::Clip> clips;
  std::vector<FaultyClip> faulty_clips;  ///< left out of `clips`.
  double metres_per_unit = 1.0;          ///< file units were multiplied by this.
  UpAxis up_axis = UpAxis::Y;            ///< of the file.
  /// rig_from_file: file world coordinates (units, axes) to the rig's; a similarity. Outputs in file space
  /// use its inverse.
  Eigen::Affine3d rig_from_file = Eigen::Affine3d::Identity();
  double height = 0.0;  ///< extent along Y of the simulated parts at rest [m].
  /// True where the importer keeps the file's own vertex order (glTF); false where the order is the
  /// importer's.
  bool file_vertex_order = false;
  std::vector<Finding> findings;
};

/// Total vertex count over all parts: the order of every exported frame is part by part.
int num_vertices(const Rig& rig);

/// For every vertex of a rig with these parts and props: whether it is flesh, of a simulated part and of no
/// prop.
std::vector<bool> flesh_vertices(const std::vector<Part>& parts, const std::vector<Prop>& props);

/// Linear blend skinning of every part with T_J = pose_from_rest, num_vertices(rig) x 3 [m]: the plain
/// skinning that the simulation is compared with, and the motion of parts that are not simulated.
lattice::Points skin(const Rig& rig, const std::vector<Eigen::Affine3d>& pose_from_rest);

/// The flesh welded into one surface for physics.
struct PhysicsSkin {
  lattice::Surface surface;  ///< welded: points closer than 1e-6 of the diagonal with equal weights are one.
  /// For every rig vertex (part by part): index into surface.points, or -1 where it is no flesh.
  std::vector<int> surface_of_vertex;
};
PhysicsSkin physics_skin(const Rig& rig);

/// Extent of a surface along its thinnest principal axis [m]: 0 for a plane, whichever way it stands.
double thickness(const lattice::Points& points);

/// A skin thinner than this share of its diagonal holds no flesh: physics refuses it. Clothes of 1 mm on a
/// person would be three times as thick.
inline constexpr double kFlatSkin = 2e-4;

struct LoadOptions {
  /// Height of the character [m]; 0 = guess the units.
  double height = 0.0;
  /// Run third-party importers in this executable (installed beside sinew); empty = the default place.
  std::string importer_executable;
};

/// Reads a rig: glTF and GLB with our own checked reader, everything else through the importer executable.
/// Throws InputError, IoError or LimitError with one line that names the file, the thing and the remedy.
Rig load_rig(const std::string& file, const LoadOptions& options = {});

/// Index of the clip taken when none is named: the first with at least two distinct keys and a duration > 0,
/// else the first with a key, which is a pose. Throws ConfigError when `name` is given and absent (listing
/// the clips), InputError when it is faulty or no clip is usable.
int choose_clip(const Rig& rig, const std::string& name);

}  // namespace sinew::assets
