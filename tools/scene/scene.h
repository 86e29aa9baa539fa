#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "assets/rig.h"
#include "fem/models/model.h"
#include "tools/scene/plain_scene.h"

/// What one run of `sinew simulate` is asked to do: every flag of the command and every key of a scene file.
namespace sinew::tools {

using fem::Integrator;
using fem::Precision;

/// Units and axes of what is written: the input file's own, or metres with Y up.
enum class OutputSpace { File, Si };

enum class Switch { Off, On };

/// Output frames first ... last, both included; frame k shows the clip at t0 + k / fps.
struct FrameRange {
  int first = 0;  ///< >= 0.
  int last = 0;   ///< >= first.

  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

/// Flesh that differs from the scene's: `[[material]]` in a scene file. Fields left out are the scene's.
struct BoneMaterial {
  /// Names of bones, with * for any letters and ? for one; at least one, unless there are `regions`.
  std::vector<std::string> bones;
  std::optional<double> young;    ///< as Scene::young.
  std::optional<double> poisson;  ///< as Scene::poisson.
  std::optional<double> density;  ///< as Scene::density.
  /// How far from the bone flesh is pulled after its rotation [m]; 1e-6 ... 1e3.
  std::optional<double> radius = {};
  /// Of that pull [-], c in c mu / radius^2; 0 ... 1e6. 10 for bones on edges, 100 for soft ones.
  std::optional<double> stiffness = {};
  /// These bones, each hanging on another of them, are one region of this name; nothing: judged by how they
  /// turn.
  std::string region = {};
  /// Instead of bones: names or numbers of regions of the lattice that is read. They take no radius,
  /// stiffness and region.
  std::vector<std::string> regions = {};

  friend bool operator==(const BoneMaterial&, const BoneMaterial&) = default;
};

/// Cells that are finer or coarser in the flesh of some bones: `[[size]]` in a scene file.
struct BoneSize {
  /// As BoneMaterial::bones, of the rig's joints.
  std::vector<std::string> bones;
  double factor = 1.0;  ///< on the length of edges [-]; 0.25 ... 4.

  friend bool operator==(const BoneSize&, const BoneSize&) = default;
};

/// How some pieces of the skin move: `[[part]]` and `[[bone]]` in a scene file.
struct RoleOf {
  /// Of parts or their islands (assets/islands.h), or of joints; * for any letters and ? for one.
  std::string name;
  assets::PartRole role = assets::PartRole::Simulated;

  friend bool operator==(const RoleOf&, const RoleOf&) = default;
};

/// As scenes write it: flesh, skinned, rigid or riding.
std::string_view role_name(assets::PartRole role);

/// Where something was read from; no part of what it says.
struct SourceFile {
  std::string path;  ///< as the user gave it; empty: nowhere.

  friend bool operator==(const SourceFile&, const SourceFile&) { return true; }
};

/// Built whole by read_scene or SimulateOptions, checked once by validate, then read only. Paths are relative
/// to the current directory. Limits follow the range in which the method is tested.
struct Scene {
  /// The scene file, where there is one.
  SourceFile source;
  /// The character; required for a run, unless the scene is a plain one.
  std::string rig;
  /// A box of flesh with bones of its own instead of a character.
  std::optional<PlainScene> plain;
  /// Where the results go; required for a run.
  std::string output;
  /// Replace a run that `output` holds already.
  bool overwrite = false;
  /// Report as JSON on stdout.
  bool json = false;

  /// Name of the clip; empty: the first with at least two keys.
  std::string clip;
  /// Lattice file; empty: a lattice is built.
  std::string lattice;
  /// Units and axes of a lattice file of another program: metres with Y up, or the rig file's.
  OutputSpace lattice_space = OutputSpace::Si;
  /// How far a vertex of such a file may lie from the bone it stands for [-]; share of the longest side of
  /// the skin's box; 1e-12 ... 0.1.
  double snap_tolerance = 1e-4;
  /// Bones that are no edges of such a file are held by penalty instead of being refused.
  bool soft_bones = false;
  /// Take a built lattice from `.sinew-cache` beside the output where nothing changed, and keep it there.
  Switch cache = Switch::On;
  /// Wanted number of lattice cells [-]; 20 ... 1e6.
  int cells = 1000;
  /// Wanted edge of the lattice's cells [m]; 1e-4 ... 1e3. Set: `cells` is not used.
  std::optional<double> cell_size;
  /// Joints that may have bones, with * for any letters and ? for one; empty: all.
  std::vector<std::string> bones_include;
  /// Joints that have none: what hangs on them hangs on the joint above.
  std::vector<std::string> bones_exclude;
  /// Bones for weighted joints without children; off: soft frames hold their skin.
  Switch tip_bones = Switch::On;
  /// A mirror-symmetric rig gets a mirror-symmetric lattice; off: nobody looks.
  Switch symmetry = Switch::On;
  /// Smaller cells where limbs are thin, and larger ones elsewhere.
  Switch grade = Switch::On;
  /// Larger cells where the skin follows one bone alone, away from joints.
  Switch coarsen_rigid = Switch::Off;
  /// Cells of another size round some bones; a later one overrides an earlier one.
  std::vector<BoneSize> sizes;
  /// Roles of parts and their islands; a later one overrides an earlier one, and all of them those of bones.
  std::vector<RoleOf> part_roles;
  /// Roles of what hangs on one joint alone; a later one overrides an earlier one.
  std::vector<RoleOf> bone_roles;
  /// Finest active level of the hierarchy [-]; 0 ... 3. 1, as tetrahedra of level 0 alone are far too stiff.
  int levels = 1;

  /// Young's modulus [Pa]; 1e-3 ... 1e12. Unset: chosen so that the flesh swings at 7 Hz at 1.8 m.
  std::optional<double> young;
  /// Poisson's ratio [-]; in (-1, 0.5). Soft tissue hardly changes its volume.
  double poisson = 0.45;
  /// Density [kg/m^3]; 1 ... 1e5. Soft tissue is about water.
  double density = 1000.0;
  /// Damping ratio at `damping_frequency` [-]; 0 ... 10.
  double damping = 0.1;
  /// Frequency at which `damping` holds [Hz]; 0.01 ... 1000.
  double damping_frequency = 3.0;
  /// Materials of single bones; a later one overrides an earlier one.
  std::vector<BoneMaterial> materials;

  /// Height of the character [m]; 1e-3 ... 1e4. Unset: the units of the file are guessed.
  std::optional<double> height;
  OutputSpace output_space = OutputSpace::File;
  /// Gravity in the rig's space, Y up [m/s^2]; each component within 1e4.
  Eigen::Vector3d gravity{0.0, -9.81, 0.0};
  /// Time step [s]; 1e-6 ... 0.1. Belongs to the scene, not to the frame rate: the held pose depends on it
  /// slightly.
  double step = 1.0 / 120.0;
  /// Rung of the ladder: a name of the registry of models.
  std::string model{fem::kDefaultModel};
  Integrator integrator = Integrator::Bdf2;
  /// Float factors solve faster, with a relative error near 3e-7.
  std::optional<Precision> precision;  ///< left out: the model's own choice.
  /// Output frames per second [1/s]; 0.1 ... 1e4. 30, the rate at which most clips for games are keyed: a key
  /// falls on a frame, and a frame is four default steps.
  double fps = 30.0;
  /// Unset: the whole clip.
  std::optional<FrameRange> frames;
  /// Output frames that the character is cut to: on the way from the frame before it jumps, and its flesh
  /// goes along; 1 ... 1e7. Cuts that the clip shows by themselves are found besides.
  std::vector<int> cuts;
  /// Longest time that the flesh may take to settle before the first frame [s]; 0 ... 3600.
  double settle = 5.0;
  /// What is written is the rig's own skinning plus this share of (flesh - its rest in the pose) [-];
  /// 0 ... 10, 0 = plain skinning. Unset: the model's flesh itself.
  std::optional<double> offset;
  /// Lay the skin back towards plain skinning where cells are too coarse to carry it (fem/skin/skin_guard.h).
  Switch guard = Switch::On;
  /// The contact sheet of frames.
  Switch preview = Switch::On;
  /// Refuse flesh that an eye would call torn, or that did not settle: exit code 4, nothing is written.
  bool strict = false;
  /// Threads; 0 ... 1024, 0 = all. The results do not depend on it.
  int threads = 0;
  /// The artist's own mesh (OBJ or PLY), whose vertex order the output takes over; empty: the rig's order.
  std::string output_mesh;

  /// Throws assets::ConfigError naming the key, its value and the range, assets::LimitError for too many
  /// cells.
  void validate() const;

  friend bool operator==(const Scene&, const Scene&) = default;
};

/// By its extension, .toml.
bool is_scene_file(const std::string& file);

/// Reads a scene file (TOML). Strict: an unknown key is an error that names the nearest valid one, types are
/// not converted, values are checked. Keys left out keep the values of Scene. Paths in it are relative to its
/// own directory. Throws assets::ConfigError "<file>:<line>: ...", assets::IoError where it cannot be read.
Scene read_scene(const std::string& file);

/// The whole scene as TOML, with units and ranges as comments; read_scene gives the same scene back when the
/// text lies in the current directory. Throws assets::ConfigError for a path that is not UTF-8: TOML cannot
/// hold it.
std::string print_scene(const Scene& scene);

/// Indices of the names that a pattern fits; * stands for any letters, ? for one.
std::vector<int> matching(const std::string& pattern, const std::vector<std::string>& names);

/// One sentence for a pattern that fits none of the names of such things: the nearest, or the first of all.
std::string no_such(const std::string& thing, const std::string& pattern,
                    const std::vector<std::string>& names);
std::string no_such_bone(const std::string& pattern, const std::vector<std::string>& names);

/// The joints that any of the patterns fits, ascending. Throws assets::ConfigError, opened by `where`, for a
/// pattern that fits none, naming the nearest.
std::vector<int> joints_of(const std::vector<std::string>& patterns, const std::vector<std::string>& names,
                           const std::string& where);

/// A joint without a bone of its own, as the lattice merged it into another one.
struct MergedJoint {
  std::string name;
  std::string into;        ///< the joint whose frame its flesh follows.
  std::vector<int> bones;  ///< of that joint.
};

/// For every material the bones that it is for; none for one of regions. A pattern that fits no bone but a
/// merged joint is for the bones of that which it was merged into, and `say` is told. Throws
/// assets::InputError (for `rig_file`) where a pattern fits neither.
std::vector<std::vector<int>> bones_of_materials(const Scene& scene, const std::string& rig_file,
                                                 const std::vector<std::string>& bone_names,
                                                 const std::vector<MergedJoint>& merged = {},
                                                 const std::function<void(const std::string&)>& say = {});

}  // namespace sinew::tools
