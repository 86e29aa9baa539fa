#include "tools/session/plain_character.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "assets/error.h"
#include "lattice/box.h"
#include "lattice/hierarchy.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using lattice::Points;

constexpr const char* kGround = "ground";  ///< what held sides without a bone stand on.

// ------------------------------------------------------------------------------------------------ skeleton

struct Joints {
  std::vector<skeleton::Joint> list;
  std::map<std::string, int> of_bone;
  int ground = -1;  ///< -1 where nothing stands still.
};

skeleton::Joint joint_at(const std::string& name, int parent, const Vector3d& rest,
                         const Vector3d& parent_rest) {
  skeleton::Joint joint;
  joint.name = name;
  joint.parent = parent;
  joint.rest_from_joint.translation() = rest;
  joint.local.translation = rest - parent_rest;
  joint.parent_from_joint.translation() = joint.local.translation;
  return joint;
}

/// One joint per bone, at its start. What stands still is the root of all others, so that a bone that hardly
/// turns against the ground shares its region.
Joints make_joints(const PlainScene& plain) {
  Joints joints;
  const bool stands =
      std::any_of(plain.fixed.begin(), plain.fixed.end(), [](const auto& f) { return f.bone.empty(); });
  if (stands || !plain.is_held()) {
    joints.ground = 0;
    std::string name = kGround;
    const auto taken = [&] {
      return std::any_of(plain.bones.begin(), plain.bones.end(),
                         [&](const auto& bone) { return bone.name == name; });
    };
    while (taken()) name += "_";
    joints.list.push_back(joint_at(name, -1, Vector3d::Zero(), Vector3d::Zero()));
  }
  for (const PlainBone& bone : plain.bones) {
    const int parent = bone.parent.empty() ? joints.ground : joints.of_bone.at(bone.parent);
    const Vector3d parent_rest =
        parent < 0 ? Vector3d::Zero()
                   : Vector3d(joints.list[static_cast<std::size_t>(parent)].rest_from_joint.translation());
    joints.of_bone[bone.name] = static_cast<int>(joints.list.size());
    joints.list.push_back(joint_at(bone.name, parent, bone.start, parent_rest));
  }
  return joints;
}

Eigen::Quaterniond rotation_of(const Vector3d& axis, double degrees) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, axis.normalized()));
}

/// Keys of the turn. Between two keys of one axis the angle runs straight, so that turns of any size are
/// those that were asked for: further keys at most a quarter turn apart take care of it.
skeleton::RotationTrack rotation_track(const std::vector<PlainKey>& keys) {
  constexpr double kLargest = 90.0;
  skeleton::RotationTrack track;
  const auto add = [&](double time, Eigen::Quaterniond q) {
    if (!track.values.empty() && track.values.back().dot(q) < 0.0) q.coeffs() *= -1.0;
    track.times.push_back(time);
    track.values.push_back(q);
  };
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const PlainKey& key = keys[k];
    if (k > 0) {
      const PlainKey& before = keys[k - 1];
      // A key that does not turn has any axis.
      const Vector3d axis = before.angle == 0.0 ? key.axis : before.axis;
      const bool same = key.angle == 0.0 || axis.normalized().isApprox(key.axis.normalized(), 1e-12);
      const int parts = same ? static_cast<int>(std::ceil(std::abs(key.angle - before.angle) / kLargest)) : 1;
      for (int i = 1; i < parts; ++i) {
        const double s = static_cast<double>(i) / parts;
        add((1.0 - s) * before.time + s * key.time,
            rotation_of(axis, (1.0 - s) * before.angle + s * key.angle));
      }
    }
    add(key.time, rotation_of(key.axis, key.angle));
  }
  return track;
}

skeleton::Clip make_clip(const PlainScene& plain, const Joints& joints) {
  skeleton::Clip clip;
  clip.name = "keys";
  std::set<double> times;
  for (const PlainBone& bone : plain.bones) {
    if (bone.keys.empty()) continue;
    skeleton::Channel channel;
    channel.joint = joints.of_bone.at(bone.name);
    const Vector3d rest = joints.list[static_cast<std::size_t>(channel.joint)].local.translation;
    channel.translation.emplace();
    for (const PlainKey& key : bone.keys) {
      channel.translation->times.push_back(key.time);
      channel.translation->values.push_back(rest + key.move);
      times.insert(key.time);
    }
    channel.rotation = rotation_track(bone.keys);
    clip.channels.push_back(std::move(channel));
  }
  clip.num_keys = static_cast<int>(times.size());
  // Frame 0 is time 0 whatever the keys: a scene's times are its own.
  clip.start = 0.0;
  clip.end = times.empty() ? 0.0 : std::max(0.0, *times.rbegin());
  return clip;
}

// ------------------------------------------------------------------------------------------------- lattice

std::set<std::pair<int, int>> edges_of(const lattice::CellComplex& complex) {
  std::set<std::pair<int, int>> edges;
  for (const lattice::Cell& cell : complex.cells) {
    for (const auto& e : lattice::cell_edges(cell.type))
      edges.insert(std::minmax(cell.vertices[static_cast<std::size_t>(e[0])],
                               cell.vertices[static_cast<std::size_t>(e[1])]));
  }
  return edges;
}

/// The lattice vertices on the segment in order, each consecutive pair an edge.
std::vector<int> chain_of(const std::string& file, const PlainBone& bone, const lattice::CellComplex& complex,
                          const std::set<std::pair<int, int>>& edges) {
  const Vector3d span = bone.end - bone.start;
  const double size = (complex.points.colwise().maxCoeff() - complex.points.colwise().minCoeff()).norm();
  const double tolerance = 1e-6 * size;  // decimals of a text file
  std::map<double, int> on_it;
  for (Eigen::Index v = 0; v < complex.points.rows(); ++v) {
    const Vector3d p = complex.points.row(v).transpose();
    const double s = std::clamp((p - bone.start).dot(span) / span.squaredNorm(), 0.0, 1.0);
    if ((p - bone.start - s * span).norm() <= tolerance) on_it.emplace(s, static_cast<int>(v));
  }
  const auto refuse = [&](const std::string& what) {
    throw assets::InputError(
        file, fmt::format("bone '{}': {}, expected lattice vertices from its start to its end, each "
                          "pair joined by an edge; hint: other cells, or soft = true",
                          bone.name, what));
  };
  std::vector<int> chain;
  for (const auto& [s, v] : on_it) chain.push_back(v);
  for (const auto& [point, name] : {std::pair{bone.start, "start"}, std::pair{bone.end, "end"}}) {
    const double distance = (complex.points.rowwise() - point.transpose()).rowwise().norm().minCoeff();
    if (distance > tolerance)
      refuse(fmt::format("its {} lies {:.3g} m from the nearest lattice vertex", name, distance));
  }
  for (std::size_t k = 1; k < chain.size(); ++k) {
    if (edges.count(std::minmax(chain[k - 1], chain[k])) > 0) continue;
    refuse(fmt::format("lattice vertices {} and {} on it are not joined", chain[k - 1], chain[k]));
  }
  return chain;
}

lattice::ControlLattice make_lattice(const std::string& file, const PlainScene& plain, const Joints& joints) {
  const PlainBox& box = plain.box;
  lattice::ControlLattice lattice;
  lattice.complex = lattice::box_lattice({box.corner, box.corner + box.size, box.cells, box.type, {}});
  lattice.edge_length = box.size.cwiseQuotient(box.cells.cast<double>()).maxCoeff();
  const auto edges = edges_of(lattice.complex);
  for (const PlainBone& bone : plain.bones) {
    lattice::LatticeBone made;
    made.name = bone.name;
    made.frame = joints.of_bone.at(bone.name);
    made.rest_start = bone.start;
    made.rest_end = bone.end;
    made.start = {made.frame, made.frame, bone.start, bone.end};
    made.end = made.start;
    made.soft = bone.soft;
    // Where a child begins at the end, both move it alike unless the child is moved off: then the bone
    // stretches.
    for (const PlainBone& child : plain.bones) {
      if (child.parent != bone.name || (child.start - bone.end).norm() > 1e-9 * box.size.norm()) continue;
      made.start.joint_b = made.end.joint_b = joints.of_bone.at(child.name);
      break;
    }
    if (!bone.soft) made.chain = chain_of(file, bone, lattice.complex, edges);
    lattice.bones.push_back(std::move(made));
  }
  for (std::size_t j = 0; j < joints.list.size(); ++j) lattice.frame_of_joint.push_back(static_cast<int>(j));
  return lattice;
}

// ---------------------------------------------------------------------------------------------------- skin

Vector3d centre_of(const PlainBox& box, const BoxFace& face) {
  Vector3d centre = box.corner + 0.5 * box.size;
  centre[face.axis] += 0.5 * face.sign() * box.size[face.axis];
  return centre;
}

/// Outward quads of the boundary of the once subdivided box.
lattice::Surface make_skin(const lattice::CellComplex& complex) {
  const lattice::Hierarchy fine(complex, 1);
  std::map<std::array<int, 4>, std::vector<std::array<int, 4>>> owners;
  for (const lattice::HexVertices& hex : fine.hexes(1)) {
    for (std::array<int, 4> face : lattice::cell_faces(lattice::CellType::Hexahedron)) {
      for (int& corner : face) corner = hex[static_cast<std::size_t>(corner)];
      std::array<int, 4> key = face;
      std::sort(key.begin(), key.end());
      owners[key].push_back(face);
    }
  }
  lattice::Surface skin;
  std::map<int, int> index;
  std::vector<std::array<int, 4>> quads;
  for (const auto& [key, faces] : owners) {
    if (faces.size() > 1) continue;
    quads.push_back(faces.front());
    for (const int v : faces.front()) index.emplace(v, 0);
  }
  skin.points.resize(static_cast<Eigen::Index>(index.size()), 3);
  int next = 0;
  for (auto& [v, i] : index) {
    skin.points.row(next) = fine.points().row(v);
    i = next++;
  }
  skin.triangles.resize(2 * static_cast<Eigen::Index>(quads.size()), 3);
  Eigen::Index t = 0;
  for (const auto& q : quads) {
    skin.triangles.row(t++) << index[q[0]], index[q[1]], index[q[2]];
    skin.triangles.row(t++) << index[q[0]], index[q[2]], index[q[3]];
  }
  return skin;
}

/// Weights of a skin point by its distance to what holds flesh; shares below a hundredth are left out.
std::vector<lattice::Influence> weights_at(const Vector3d& p, const PlainScene& plain, const Joints& joints) {
  std::map<int, double> distance;
  const auto note = [&](int joint, double d) {
    const auto [found, is_new] = distance.emplace(joint, d);
    if (!is_new) found->second = std::min(found->second, d);
  };
  for (const PlainBone& bone : plain.bones) {
    const Vector3d span = bone.end - bone.start;
    const double s = std::clamp((p - bone.start).dot(span) / span.squaredNorm(), 0.0, 1.0);
    note(joints.of_bone.at(bone.name), (p - bone.start - s * span).norm());
  }
  for (const FixedFace& fixed : plain.fixed) {
    const int joint = fixed.bone.empty() ? joints.ground : joints.of_bone.at(fixed.bone);
    note(joint, std::abs(p[fixed.face.axis] - centre_of(plain.box, fixed.face)[fixed.face.axis]));
  }
  if (distance.empty()) return {{joints.ground, 1.0}};
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [joint, d] : distance) nearest = std::min(nearest, d);
  const double floor = 1e-6 * plain.box.size.norm();  // on a bone its share is all
  std::vector<lattice::Influence> influences;
  double sum = 0.0;
  for (const auto& [joint, d] : distance) {
    const double share = std::pow((nearest + floor) / (d + floor), 4);
    if (share < 0.01) continue;
    influences.push_back({joint, share});
    sum += share;
  }
  for (lattice::Influence& influence : influences) influence.weight /= sum;
  return influences;
}

}  // namespace

PlainCharacter make_plain_character(const Scene& scene) {
  const PlainScene& plain = *scene.plain;
  const Joints joints = make_joints(plain);
  PlainCharacter c;
  c.rig.file = scene.source.path.empty() ? "scene" : scene.source.path;
  c.rig.format = "plain scene";
  c.rig.skeleton = skeleton::Skeleton(joints.list);
  c.rig.clips = {make_clip(plain, joints)};
  c.rig.height = plain.box.size.y();
  c.rig.file_vertex_order = true;
  c.lattice = make_lattice(c.rig.file, plain, joints);
  lattice::Surface skin = make_skin(c.lattice.complex);
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
    skin.weights.push_back(weights_at(skin.points.row(v).transpose(), plain, joints));
  assets::Part part;
  part.name = "box";
  part.role = assets::PartRole::Simulated;
  part.points = skin.points;
  part.triangles = skin.triangles;
  part.weights = skin.weights;
  c.rig.parts = {std::move(part)};
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
    c.input.skin.surface_of_vertex.push_back(static_cast<int>(v));
  c.input.skin.surface = std::move(skin);
  c.input.joints.positions.resize(static_cast<Eigen::Index>(joints.list.size()), 3);
  for (std::size_t j = 0; j < joints.list.size(); ++j) {
    c.input.joints.positions.row(static_cast<Eigen::Index>(j)) =
        joints.list[j].rest_from_joint.translation().transpose();
    c.input.joints.parents.push_back(joints.list[j].parent);
    c.input.joints.names.push_back(joints.list[j].name);
  }
  for (const FixedFace& fixed : plain.fixed) {
    const int joint = fixed.bone.empty() ? joints.ground : joints.of_bone.at(fixed.bone);
    c.held.push_back({joint, centre_of(plain.box, fixed.face), Vector3d::Unit(fixed.face.axis)});
  }
  if (!plain.is_held()) c.bare_frames = {joints.ground};
  return c;
}

}  // namespace sinew::tools
