#include "lattice/detail/limb_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <tuple>

#include "lattice/detail/cell_flesh.h"
#include "lattice/detail/cell_locator.h"
#include "lattice/detail/point_finder.h"
#include "lattice/detail/segments.h"
#include "lattice/detail/symmetry.h"
#include "lattice/detail/triangle_grid.h"
#include "lattice/limb_copies.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Flesh farther apart than this along the skeleton belongs to different limbs, in units of h.
constexpr double kLimbDistance = 1.5;
/// Where flesh is looked for behind the skin, in units of h.
constexpr double kSheetDepth = 0.02;
constexpr double kSoftBoneSpacing = 0.25;  ///< of the points along soft bones, in units of h.
constexpr double kInsideSlack = 1e-9;
constexpr double kImageTolerance = 1e-9;  ///< of a vertex and the image of its partner, unit coordinates.
constexpr double kGridSide = 0.5;         ///< of the grid of triangles, in units of h.

bool is_before(const LimbPiece& a, const LimbPiece& b) {
  return std::tie(a.frame, a.stretch.bone) < std::tie(b.frame, b.stretch.bone);
}

/// Widens the piece of the same frame and bone, or adds it.
void merge(std::vector<LimbPiece>& pieces, const LimbPiece& piece) {
  for (LimbPiece& other : pieces)
    if (other.frame == piece.frame && other.stretch.bone == piece.stretch.bone) {
      other.stretch.low = std::min(other.stretch.low, piece.stretch.low);
      other.stretch.high = std::max(other.stretch.high, piece.stretch.high);
      return;
    }
  pieces.push_back(piece);
}

/// The skin's triangles with their numbers, for visits by face.
std::vector<TriangleCorners> corners_of(const UnitSkin& skin) {
  std::vector<TriangleCorners> triangles;
  for (int t = 0; t < skin.triangles.rows(); ++t)
    triangles.push_back({skin.points.row(skin.triangles(t, 0)), skin.points.row(skin.triangles(t, 1)),
                         skin.points.row(skin.triangles(t, 2))});
  return triangles;
}

/// The frames of the corners of every welded triangle. They are those of the caller's vertices: pieces that
/// touch are welded, and the point that they share has the weights of one of them.
std::vector<std::array<int, 3>> frames_of_triangles(const RigInput& input,
                                                    const std::vector<int>& frame_of_joint) {
  using Corner = std::array<int, 2>;  // welded point, frame
  std::map<std::array<int, 3>, std::array<Corner, 3>> corners_of;
  for (Eigen::Index t = 0; t < input.skin.triangles.rows(); ++t) {
    std::array<Corner, 3> corners;
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(input.skin.triangles(t, k));
      corners[k] = {input.unit_skin.welded[v], skin_frame(input.skin.weights[v], frame_of_joint)};
    }
    std::sort(corners.begin(), corners.end());
    const std::array<int, 3> key{corners[0][0], corners[1][0], corners[2][0]};
    const auto [found, fresh] = corners_of.emplace(key, corners);
    if (!fresh) found->second = std::min(found->second, corners);  // whatever the order of doubled triangles
  }
  const Triangles& triangles = input.unit_skin.triangles;
  std::vector<std::array<int, 3>> frames(static_cast<std::size_t>(triangles.rows()));
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    std::array<int, 3> key{triangles(t, 0), triangles(t, 1), triangles(t, 2)};
    std::sort(key.begin(), key.end());
    for (const auto& [welded, frame] : corners_of.at(key))
      for (int k = 0; k < 3; ++k)
        if (triangles(t, k) == welded) frames[static_cast<std::size_t>(t)][k] = frame;
  }
  return frames;
}

}  // namespace

std::vector<CellFace> faces_of(const CellComplex& complex) {
  struct Side {
    std::array<int, 4> key, vertices;
    int cell;
  };
  std::vector<Side> sides;
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c)
    for (const std::array<int, 4>& corners : cell_faces(complex.cells[c].type)) {
      Side side;
      for (int k = 0; k < 4; ++k)
        side.vertices[k] = corners[k] < 0 ? -1 : complex.cells[c].vertices[corners[k]];
      side.key = side.vertices;
      std::sort(side.key.begin(), side.key.end());
      side.cell = c;
      sides.push_back(side);
    }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return std::tie(a.key, a.cell) < std::tie(b.key, b.cell); });
  std::vector<CellFace> faces;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    if (i > 0 && sides[i].key == sides[i - 1].key) {
      faces.back().second = sides[i].cell;
    } else {
      faces.push_back({sides[i].vertices, sides[i].cell, -1});
    }
  }
  return faces;
}

LimbMap::LimbMap(const RigInput& input, const ReducedSkeleton& skeleton, const ControlLattice& lattice,
                 const std::vector<CellFace>& faces)
    : input_(input),
      skeleton_(skeleton),
      lattice_(lattice),
      distance_(skeleton),
      h_(lattice.edge_length / input.unit_skin.scale),
      grid_(corners_of(input.unit_skin), kGridSide * h_) {
  std::vector<int> frames;
  for (const ReducedBone& bone : skeleton.bones) frames.push_back(bone.frame);
  const std::vector<int> bone_frame = detail::frame_of_joint(input.joints.parents, frames);
  for (const SoftFrame& soft : skeleton.soft_frames) frames.push_back(soft.frame);
  frame_of_joint_ = detail::frame_of_joint(input.joints.parents, frames);
  bones_of_.resize(bone_frame.size());
  for (std::size_t j = 0; j < bone_frame.size(); ++j)
    for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b)
      if (skeleton.bones[b].frame == bone_frame[j]) bones_of_[j].push_back(b);
  std::vector<bool> has_skin(frame_of_joint_.size(), false);
  for (const std::vector<Influence>& influences : input.skin.weights)
    if (const int frame = skin_frame(influences, frame_of_joint_); frame >= 0) has_skin[frame] = true;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const ReducedBone& bone = skeleton.bones[b];
    const bool bare = !bone.soft && !has_skin[bone.frame];
    frame_of_bone_.push_back(bare ? static_cast<int>(frame_of_joint_.size()) + b : bone.frame);
  }
  const UnitSkin& skin = input.unit_skin;
  frames_ = frames_of_triangles(input, frame_of_joint_);
  for (std::size_t v = 0; v < skin.weights.size(); ++v) {
    const Vector3d p = skin.points.row(static_cast<Eigen::Index>(v)).transpose();
    is_sheet_.push_back(!skin.is_inside(p - kSheetDepth * h_ * skin.normals[v]));
  }

  std::vector<Label> labels(lattice.complex.cells.size());
  label_skin(labels, faces);
  label_bones(labels);
  for (std::size_t c = 0; c < labels.size(); ++c) {
    input_.poll();
    join_flesh(labels[c], lattice.complex.cells[c]);
  }
  if (input.mirror) mirror(labels);
  for (const Label& label : labels) {
    limbs_.push_back(gather(label));
    has_skin_.push_back(label.has_skin);
  }
}

LimbPiece LimbMap::piece_at(int frame, const Vector3d& p) const {
  LimbPiece piece;
  piece.frame = frame;
  double nearest = std::numeric_limits<double>::infinity();
  for (int b : bones_of_[frame]) {
    const Vector3d start = skeleton_.nodes[skeleton_.bones[b].start].position;
    const Vector3d end = skeleton_.nodes[skeleton_.bones[b].end].position;
    const double distance = point_segment_distance(p, start, end);
    if (!(distance < nearest)) continue;
    nearest = distance;
    const double s = std::clamp((p - start).dot(end - start) / (end - start).squaredNorm(), 0.0, 1.0);
    piece.stretch = {b, s, s};
  }
  return piece;
}

void LimbMap::add(Label& label, int frame, const Vector3d& p) const {
  if (frame < 0) return;
  merge(label.pieces, piece_at(frame, p));
}

void LimbMap::add_bone(Label& label, int bone, const Vector3d& p) const {
  merge(label.pieces, bone_at(bone, p)[0]);
  label.bones.emplace_back(frame_of_bone_[bone], p);
}

/// A triangle of the skin in a cell: its corners must not part, whatever they hang on.
void LimbMap::add_triangle(Label& label, int triangle, const Vector3d& p) const {
  label.has_skin = true;
  const std::array<int, 3>& frames = frames_[triangle];
  for (int k = 0; k < 3; ++k) {
    const int v = input_.unit_skin.triangles(triangle, k);
    (is_sheet_[v] ? label.sheets : label.skins).push_back(frames[k]);
  }
  for (int k = 0; k < 3; ++k) {
    if (k > 0 && frames[k] == frames[k - 1]) continue;
    add(label, frames[k], p);
    const int other = frames[(k + 1) % 3];
    if (frames[k] >= 0 && other >= 0 && frames[k] != other) label.joined.push_back({frames[k], other});
  }
}

/// A triangle lies in the cells that hold its corners and in those whose faces it crosses: no sampling, and
/// so no piece of skin is overlooked.
void LimbMap::label_skin(std::vector<Label>& labels, const std::vector<CellFace>& faces) const {
  const UnitSkin& skin = input_.unit_skin;
  const CellLocator locator(lattice_.complex);
  std::vector<std::vector<int>> cells_of(skin.points.rows());
  for (int v = 0; v < skin.points.rows(); ++v)
    locator.find_all(skin.to_rest(skin.points.row(v).transpose()), kInsideSlack, cells_of[v]);
  // Vertices welded to one may hang on different joints.
  for (std::size_t v = 0; v < input_.skin.weights.size(); ++v) {
    const int welded = skin.welded[v];
    const int frame = skin_frame(input_.skin.weights[v], frame_of_joint_);
    for (int c : cells_of[welded]) add(labels[c], frame, skin.points.row(welded).transpose());
  }
  for (int t = 0; t < skin.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int v = skin.triangles(t, k);
      for (int c : cells_of[v]) add_triangle(labels[c], t, skin.points.row(v).transpose());
    }
  for (const CellFace& face : faces) {
    input_.poll();
    const int n = face.vertices[3] < 0 ? 3 : 4;
    std::array<Vector3d, 4> corners;
    Vector3d mean = Vector3d::Zero();
    for (int k = 0; k < n; ++k) {
      corners[k] = skin.to_unit(lattice_.complex.points.row(face.vertices[k]).transpose());
      mean += corners[k] / n;
    }
    const auto visit = [&](int t) {
      for (const int cell : {face.first, face.second})
        if (cell >= 0) add_triangle(labels[cell], t, mean);
      return true;
    };
    if (n == 3) grid_.for_each_crossing({corners[0], corners[1], corners[2]}, 0.0, visit);
    for (int k = 0; n == 4 && k < 4; ++k)
      grid_.for_each_crossing({corners[k], corners[(k + 1) % 4], mean}, 0.0, visit);
  }
}

void LimbMap::label_bones(std::vector<Label>& labels) const {
  struct Edge {
    int low, high, bone;
  };
  std::vector<Edge> edges;
  for (int b = 0; b < static_cast<int>(lattice_.bones.size()); ++b) {
    const std::vector<int>& chain = lattice_.bones[b].chain;
    for (std::size_t i = 1; i < chain.size(); ++i)
      edges.push_back({std::min(chain[i - 1], chain[i]), std::max(chain[i - 1], chain[i]), b});
  }
  const auto before = [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high) < std::tie(b.low, b.high);
  };
  std::sort(edges.begin(), edges.end(), before);
  const UnitSkin& skin = input_.unit_skin;
  for (std::size_t c = 0; c < labels.size(); ++c) {
    const Cell& cell = lattice_.complex.cells[c];
    for (const std::array<int, 2>& e : cell_edges(cell.type)) {
      const int a = cell.vertices[e[0]], b = cell.vertices[e[1]];
      const auto found =
          std::lower_bound(edges.begin(), edges.end(), Edge{std::min(a, b), std::max(a, b), 0}, before);
      if (found == edges.end() || found->low != std::min(a, b) || found->high != std::max(a, b)) continue;
      const Vector3d start = skin.to_unit(lattice_.complex.points.row(a).transpose());
      const Vector3d end = skin.to_unit(lattice_.complex.points.row(b).transpose());
      for (const double s : {0.0, 0.25, 0.5, 0.75, 1.0})
        add_bone(labels[c], found->bone, (1.0 - s) * start + s * end);
    }
  }
  const CellLocator locator(lattice_.complex);
  std::vector<int> cells;
  for (int b = 0; b < static_cast<int>(lattice_.bones.size()); ++b) {
    const LatticeBone& bone = lattice_.bones[b];
    if (!bone.soft) continue;
    const double spacing = kSoftBoneSpacing * lattice_.edge_length;
    const int n =
        std::max(1, static_cast<int>(std::ceil((bone.rest_end - bone.rest_start).norm() / spacing)));
    for (int i = 0; i <= n; ++i) {
      const Vector3d p = bone.rest_start + (bone.rest_end - bone.rest_start) * (static_cast<double>(i) / n);
      locator.find_all(p, kInsideSlack, cells);
      for (int c : cells) add_bone(labels[c], b, skin.to_unit(p));
    }
  }
  for (const SoftFrame& soft : skeleton_.soft_frames) {
    locator.find_all(skin.to_rest(soft.position), kInsideSlack, cells);
    for (int c : cells) add(labels[c], soft.frame, soft.position);
  }
}

int LimbMap::joint_of(int frame) const {
  return is_bare(frame) ? skeleton_.bones[bone_of(frame)].frame : frame;
}

/// Whether flesh of `frame` hangs on the end of that of `parent`.
bool LimbMap::is_above(int parent, int frame) const {
  const int joint = input_.unit_joints.parents[joint_of(frame)];
  if (joint < 0 || frame_of_joint_[joint] != joint_of(parent)) return false;
  if (!is_bare(parent)) return true;
  const int end = skeleton_.bones[bone_of(parent)].end;
  if (is_bare(frame)) return skeleton_.bones[bone_of(frame)].start == end;
  return std::any_of(bones_of_[frame].begin(), bones_of_[frame].end(),
                     [&](int b) { return skeleton_.bones[b].start == end; });
}

int LimbMap::image(int frame) const {
  if (!is_bare(frame)) return input_.mirror->joint[frame];
  return static_cast<int>(frame_of_joint_.size()) + skeleton_.mirror_bone[bone_of(frame)];
}

LimbPiece LimbMap::image(const LimbPiece& piece) const {
  LimbPiece result = piece;
  result.frame = image(piece.frame);
  if (piece.stretch.bone >= 0) result.stretch.bone = skeleton_.mirror_bone[piece.stretch.bone];
  return result;
}

void LimbMap::mirror(std::vector<Label>& labels) const {
  const CellComplex& complex = lattice_.complex;
  Points points(complex.points.rows(), 3);
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    points.row(v) = input_.unit_skin.to_unit(complex.points.row(v).transpose()).transpose();
  const PointFinder finder(points);
  std::vector<int> vertex;
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    vertex.push_back(finder.first_near(reflected(points.row(v).transpose()), kImageTolerance));
  using Key = std::array<int, 8>;
  std::map<Key, std::size_t> cell_of;
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    Key key = complex.cells[c].vertices;
    std::sort(key.begin(), key.end());
    cell_of[key] = c;
  }
  const std::vector<Label> own = labels;
  for (std::size_t c = 0; c < complex.cells.size(); ++c) {
    Key key = complex.cells[c].vertices;
    for (int& v : key)
      if (v >= 0) v = vertex[v];
    std::sort(key.begin(), key.end());
    const auto found = cell_of.find(key);
    if (found == cell_of.end()) continue;
    labels[c].has_skin = labels[c].has_skin || own[found->second].has_skin;
    for (const LimbPiece& piece : own[found->second].pieces) merge(labels[c].pieces, image(piece));
    for (const auto& [a, b] : own[found->second].joined) labels[c].joined.push_back({image(a), image(b)});
  }
}

/// Frames whose flesh hangs together in the cell.
void LimbMap::join_flesh(Label& label, const Cell& cell) const {
  const double reach = kLimbDistance * edge_at(cell.vertices);
  const std::vector<Limb> limbs = gather(label);
  std::vector<std::array<int, 2>> near;
  for (std::size_t i = 0; i < limbs.size(); ++i)
    for (std::size_t k = i + 1; k < limbs.size(); ++k)
      for (const LimbPiece& a : limbs[i])
        for (const LimbPiece& b : limbs[k])
          if (distance_.between(a.stretch, b.stretch) < reach) near.push_back({a.frame, b.frame});
  if (near.empty()) return;
  std::vector<Vector3d> corners;
  for (int k = 0; k < num_corners(cell.type); ++k)
    corners.push_back(input_.unit_skin.to_unit(lattice_.complex.points.row(cell.vertices[k]).transpose()));
  CellFlesh flesh(input_.unit_skin, grid_, frames_, corners);
  for (const auto& [frame, p] : label.bones) flesh.add(frame, p);
  const auto holds = [](const std::vector<int>& frames, int frame) {
    return std::find(frames.begin(), frames.end(), frame) != frames.end();
  };
  // A corner of a limb that no sample is in is flesh that reaches nothing here.
  const auto is_speck = [&](int frame) {
    return !flesh.has(frame) && holds(label.skins, frame) && !holds(label.sheets, frame);
  };
  for (const auto& [a, b] : near) {
    const bool both_known = flesh.has(a) && flesh.has(b);
    const CellFlesh::Contact contact = flesh.contact(a, b);
    const bool follow = is_above(a, b) || is_above(b, a);
    const bool are_one = both_known ? contact == CellFlesh::Contact::Continuous ||
                                          (contact == CellFlesh::Contact::Overlap && follow)
                                    : !is_speck(a) && !is_speck(b) && (follow || !(is_bare(a) || is_bare(b)));
    if (are_one) label.joined.push_back({a, b});
  }
}

/// Pieces of one frame, and of frames that are joined.
std::vector<Limb> LimbMap::gather(const Label& label) const {
  std::vector<LimbPiece> pieces = label.pieces;
  std::sort(pieces.begin(), pieces.end(), is_before);
  const int n = static_cast<int>(pieces.size());
  std::vector<int> group(n);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int i) {
    while (group[i] != i) i = group[i];
    return i;
  };
  const auto is_joined = [&](int a, int b) {
    return std::any_of(label.joined.begin(), label.joined.end(), [&](const std::array<int, 2>& pair) {
      return (pair[0] == a && pair[1] == b) || (pair[0] == b && pair[1] == a);
    });
  };
  for (int i = 0; i < n; ++i)
    for (int k = i + 1; k < n; ++k) {
      const int a = root(i), b = root(k);
      if (a != b && (pieces[i].frame == pieces[k].frame || is_joined(pieces[i].frame, pieces[k].frame)))
        group[std::max(a, b)] = std::min(a, b);
    }
  std::vector<Limb> limbs;
  std::vector<int> limb_of(n, -1);
  for (int i = 0; i < n; ++i) {
    int& limb = limb_of[root(i)];
    if (limb < 0) {
      limb = static_cast<int>(limbs.size());
      limbs.emplace_back();
    }
    limbs[limb].push_back(pieces[i]);
  }
  return limbs;
}

double LimbMap::distance(const Limb& a, const Limb& b) const {
  double shortest = std::numeric_limits<double>::infinity();
  for (const LimbPiece& x : a)
    for (const LimbPiece& y : b) {
      if (x.frame == y.frame) return 0.0;
      shortest = std::min(shortest, distance_.between(x.stretch, y.stretch));
    }
  return shortest;
}

bool LimbMap::share_frame(const Limb& a, const Limb& b) {
  return std::any_of(a.begin(), a.end(), [&](const LimbPiece& x) {
    return std::any_of(b.begin(), b.end(), [&](const LimbPiece& y) { return x.frame == y.frame; });
  });
}

/// Mean target edge at vertices of the lattice (-1: none), unit coordinates.
double LimbMap::edge_at(std::span<const int> vertices) const {
  if (lattice_.is_grid || input_.sizes.is_uniform(h_)) return h_;
  double sum = 0.0, count = 0.0;
  for (const int v : vertices) {
    if (v < 0) continue;
    Vector3d p = input_.unit_skin.to_unit(lattice_.complex.points.row(v).transpose());
    if (input_.mirror && p.x() < 0.0) p = reflected(p);  // so that both sides agree to the last bit
    sum += input_.sizes.edge_at(p, h_);
    count += 1.0;
  }
  return sum / count;
}

std::optional<Limb> LimbMap::own_flesh_at(const Vector3d& p) const {
  const UnitSkin& skin = input_.unit_skin;
  if (!skin.is_inside(p)) return std::nullopt;
  const SurfaceQuery::Closest closest = skin.query.closest(p);
  int nearest = -1;
  double best = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const int v = skin.triangles(closest.triangle, k);
    const double d = (skin.points.row(v).transpose() - closest.point).squaredNorm();
    if (d < best) best = d, nearest = frames_[closest.triangle][k];
  }
  return nearest < 0 ? Limb{} : Limb{piece_at(nearest, closest.point)};
}

std::vector<Limb> LimbMap::flesh_at(const Vector3d& p) const {
  std::vector<Limb> flesh;
  if (std::optional<Limb> own = own_flesh_at(p)) flesh.push_back(std::move(*own));
  if (!input_.mirror) return flesh;
  if (std::optional<Limb> other = own_flesh_at(reflected(p))) {
    for (LimbPiece& piece : *other) piece = image(piece);
    flesh.push_back(std::move(*other));
  }
  return flesh;
}

Limb LimbMap::bone_at(int bone, const Vector3d& p) const {
  const Vector3d start = skeleton_.nodes[skeleton_.bones[bone].start].position;
  const Vector3d end = skeleton_.nodes[skeleton_.bones[bone].end].position;
  const double s = std::clamp((p - start).dot(end - start) / (end - start).squaredNorm(), 0.0, 1.0);
  return {{frame_of_bone_[bone], {bone, s, s}}};
}

}  // namespace sinew::lattice::detail
