#include "lattice/detail/separate_limbs.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <set>

#include "lattice/detail/limb_map.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;

/// Every limb in every cell is one instance: a cell to be. A cell of which nothing is known has one without
/// pieces.
class Separation {
 public:
  Separation(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice)
      : input_(input),
        lattice_(lattice),
        faces_(faces_of(lattice.complex)),
        limbs_(input, skeleton, lattice, faces_),
        is_touched_(lattice.complex.points.rows(), false) {}

  void run() {
    number_instances();
    for (const CellFace& face : faces_) {
      input_.poll();
      link_of_face_.push_back(link(face));
    }
    split_vertices();
    input_.poll();
    rebuild();
  }

 private:
  struct Instance {
    int cell;
    Limb limb;
    std::array<int, 8> vertices;
  };
  /// Pairs of instances that go on into each other through a face.
  using Links = std::vector<std::array<int, 2>>;
  static constexpr int kSimple = -1;  ///< link of a face that its cells just share.

  void number_instances();
  bool is_air(int cell) const { return air_[cell] != 0; }
  int link(const CellFace& face);
  bool is_single(int cell) const { return first_[cell + 1] - first_[cell] == 1; }
  std::vector<Limb> flesh_on(const CellFace& face) const;
  int owner(int cell, const Limb& flesh) const;
  std::vector<std::vector<int>> parts_at(const std::vector<int>& star, const std::vector<int>& faces) const;
  bool is_of_bone(const std::vector<int>& part, const std::vector<Limb>& bones) const;
  void split_vertices();
  void rebuild();
  void drop_unused_vertices();

  const RigInput& input_;
  ControlLattice& lattice_;
  std::vector<CellFace> faces_;
  LimbMap limbs_;
  std::vector<Instance> instances_;  ///< by cell.
  std::vector<int> first_;           ///< first instance of every cell, and the end.
  std::vector<std::uint8_t> air_;    ///< cells with neither flesh nor bone.
  std::vector<int> link_of_face_;    ///< index into links_ or kSimple.
  std::vector<Links> links_;
  std::vector<bool> is_touched_;  ///< vertices that may have to be split.
};

void Separation::number_instances() {
  const std::vector<Cell>& cells = lattice_.complex.cells;
  for (int c = 0; c < static_cast<int>(cells.size()); ++c) {
    first_.push_back(static_cast<int>(instances_.size()));
    const std::vector<Limb>& limbs = limbs_.limbs(c);
    for (const Limb& limb : limbs) instances_.push_back({c, limb, cells[c].vertices});
    if (limbs.empty()) instances_.push_back({c, {}, cells[c].vertices});
    // No skin crosses it, so it is flesh or air as a whole.
    Vector3d mean = Vector3d::Zero();
    const int n = num_corners(cells[c].type);
    for (int k = 0; k < n; ++k) mean += lattice_.complex.points.row(cells[c].vertices[k]).transpose() / n;
    air_.push_back(limbs.empty() && !limbs_.has_skin(c) &&
                   limbs_.flesh_at(input_.unit_skin.to_unit(mean)).empty());
    if (limbs.size() < 2) continue;
    for (int k = 0; k < num_corners(cells[c].type); ++k) is_touched_[cells[c].vertices[k]] = true;
  }
  first_.push_back(static_cast<int>(instances_.size()));
}

/// The flesh at some points of a face: its mean, corners (drawn in a little), edge midpoints and half-way to
/// the corners.
std::vector<Limb> Separation::flesh_on(const CellFace& face) const {
  const int n = face.vertices[3] < 0 ? 3 : 4;
  std::array<Vector3d, 4> corners;
  Vector3d mean = Vector3d::Zero();
  for (int k = 0; k < n; ++k) {
    corners[k] = input_.unit_skin.to_unit(lattice_.complex.points.row(face.vertices[k]).transpose());
    mean += corners[k] / n;
  }
  std::vector<Limb> flesh;
  const auto add = [&](const Vector3d& p) {
    for (Limb& limb : limbs_.flesh_at(p)) flesh.push_back(std::move(limb));
  };
  add(mean);
  for (int k = 0; k < n; ++k) {
    add(0.9 * corners[k] + 0.1 * mean);
    add(0.5 * corners[k] + 0.5 * mean);
    add(0.45 * (corners[k] + corners[(k + 1) % n]) + 0.1 * mean);
  }
  return flesh;
}

/// The instance of a cell that flesh belongs to: the nearest along the skeleton.
int Separation::owner(int cell, const Limb& flesh) const {
  int nearest = first_[cell];
  double best = std::numeric_limits<double>::infinity();
  for (int i = first_[cell]; i < first_[cell + 1]; ++i) {
    const double distance = limbs_.distance(instances_[i].limb, flesh);
    if (distance < best) best = distance, nearest = i;
  }
  return nearest;
}

/// Cells share a face where both hold flesh of one frame, or flesh passes through it; copies where they hold
/// flesh of one frame, or own the same flesh on the face.
int Separation::link(const CellFace& face) {
  // Cells of two limbs may meet in nothing but an edge or a vertex, and only round the outside.
  if (face.second < 0) {
    for (int v : face.vertices)
      if (v >= 0) is_touched_[v] = true;
    return kSimple;
  }
  const bool are_single = is_single(face.first) && is_single(face.second);
  const bool is_open = is_air(face.first) || is_air(face.second);
  if (are_single && !is_open) {
    const Limb &a = instances_[first_[face.first]].limb, &b = instances_[first_[face.second]].limb;
    if (a.empty() || b.empty() || LimbMap::share_frame(a, b) || !flesh_on(face).empty()) return kSimple;
  }
  std::set<std::array<int, 2>> links;
  if (!are_single && !is_open) {
    for (int i = first_[face.first]; i < first_[face.first + 1]; ++i)
      for (int k = first_[face.second]; k < first_[face.second + 1]; ++k)
        if (LimbMap::share_frame(instances_[i].limb, instances_[k].limb)) links.insert({i, k});
    for (const Limb& flesh : flesh_on(face)) {
      links.insert({owner(face.first, flesh), owner(face.second, flesh)});
    }
  }
  for (int v : face.vertices)
    if (v >= 0) is_touched_[v] = true;
  links_.emplace_back(links.begin(), links.end());
  return static_cast<int>(links_.size()) - 1;
}

/// The instances round a vertex in groups that hang together through faces or belong to one limb.
std::vector<std::vector<int>> Separation::parts_at(const std::vector<int>& star,
                                                   const std::vector<int>& faces) const {
  std::vector<int> members;
  for (int c : star)
    for (int i = first_[c]; i < first_[c + 1]; ++i) members.push_back(i);
  std::vector<int> group(members.size());
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int i) {
    while (group[i] != i) i = group[i] = group[group[i]];
    return i;
  };
  const auto join = [&](int i, int k) {
    const int a = root(i), b = root(k);
    group[std::max(a, b)] = std::min(a, b);
  };
  const auto place = [&](int instance) {
    return static_cast<int>(std::lower_bound(members.begin(), members.end(), instance) - members.begin());
  };
  for (int f : faces) {
    const CellFace& face = faces_[f];
    if (face.second < 0) continue;
    if (link_of_face_[f] == kSimple) {
      join(place(first_[face.first]), place(first_[face.second]));
      continue;
    }
    for (const auto& [i, k] : links_[link_of_face_[f]]) join(place(i), place(k));
  }
  const int n = static_cast<int>(members.size());
  for (int i = 0; i < n; ++i)
    for (int k = i + 1; k < n; ++k)
      if (root(i) != root(k) &&
          LimbMap::share_frame(instances_[members[i]].limb, instances_[members[k]].limb))
        join(i, k);
  std::vector<std::vector<int>> parts;
  std::vector<int> part_of(members.size(), -1);
  for (int i = 0; i < n; ++i) {
    int& part = part_of[root(i)];
    if (part < 0) {
      part = static_cast<int>(parts.size());
      parts.emplace_back();
    }
    parts[part].push_back(members[i]);
  }
  return parts;
}

bool Separation::is_of_bone(const std::vector<int>& part, const std::vector<Limb>& bones) const {
  return std::any_of(part.begin(), part.end(), [&](int i) {
    return std::any_of(bones.begin(), bones.end(),
                       [&](const Limb& bone) { return LimbMap::share_frame(instances_[i].limb, bone); });
  });
}

void Separation::split_vertices() {
  const CellComplex& complex = lattice_.complex;
  const int count = static_cast<int>(complex.points.rows());
  std::vector<std::vector<int>> stars(count), faces_at(count);
  for (int c = 0; c < static_cast<int>(complex.cells.size()); ++c)
    for (int k = 0; k < num_corners(complex.cells[c].type); ++k)
      if (is_touched_[complex.cells[c].vertices[k]]) stars[complex.cells[c].vertices[k]].push_back(c);
  for (int f = 0; f < static_cast<int>(faces_.size()); ++f)
    for (int v : faces_[f].vertices)
      if (v >= 0 && is_touched_[v]) faces_at[v].push_back(f);
  std::vector<std::vector<Limb>> bones_at(count);
  for (int b = 0; b < static_cast<int>(lattice_.bones.size()); ++b)
    for (int v : lattice_.bones[b].chain)
      bones_at[v].push_back(limbs_.bone_at(b, input_.unit_skin.to_unit(complex.points.row(v).transpose())));

  std::vector<int> original;  // of each new vertex
  for (int v = 0; v < count; ++v) {
    if (!is_touched_[v]) continue;
    input_.poll();
    const std::vector<std::vector<int>> parts = parts_at(stars[v], faces_at[v]);
    // The vertex stays with every part of its bones' limbs; off the bones with the first part.
    std::vector<bool> stays(parts.size(), false);
    for (std::size_t p = 0; p < parts.size(); ++p) stays[p] = is_of_bone(parts[p], bones_at[v]);
    if (std::find(stays.begin(), stays.end(), true) == stays.end()) stays[0] = true;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (stays[p]) continue;
      const int copy = count + static_cast<int>(original.size());
      original.push_back(v);
      for (int i : parts[p])
        std::replace(instances_[i].vertices.begin(), instances_[i].vertices.end(), v, copy);
    }
  }
  Points& points = lattice_.complex.points;
  points.conservativeResize(count + static_cast<Eigen::Index>(original.size()), 3);
  for (std::size_t i = 0; i < original.size(); ++i)
    points.row(count + static_cast<Eigen::Index>(i)) = points.row(original[i]).eval();
}

/// Air is left out: it would hold limbs together that meet in it alone. Instances with all their vertices in
/// common are one cell after all.
void Separation::rebuild() {
  std::vector<Cell>& cells = lattice_.complex.cells;
  std::vector<CellCopy> copies;
  std::vector<Cell> kept, more;
  const int count = static_cast<int>(cells.size()),
            num_kept = count - static_cast<int>(std::count(air_.begin(), air_.end(), 1));
  for (int c = 0; c < count; ++c) {
    if (is_air(c)) continue;
    const int place = static_cast<int>(kept.size());
    std::vector<std::array<int, 8>> distinct;
    std::vector<std::set<int>> frames, bare_joints;
    for (int i = first_[c]; i < first_[c + 1]; ++i) {
      const auto same = std::find(distinct.begin(), distinct.end(), instances_[i].vertices);
      const auto at = static_cast<std::size_t>(same - distinct.begin());
      if (same == distinct.end()) {
        distinct.push_back(instances_[i].vertices);
        frames.emplace_back();
        bare_joints.emplace_back();
      }
      for (const LimbPiece& piece : instances_[i].limb)
        (limbs_.is_bare(piece.frame) ? bare_joints : frames)[at].insert(limbs_.joint_of(piece.frame));
    }
    // Bones of one joint that no skin follows may be in several copies: then it counts for none of them.
    for (std::size_t k = 0; k < distinct.size(); ++k)
      for (const int joint : bare_joints[k])
        if (std::count_if(bare_joints.begin(), bare_joints.end(),
                          [&](const std::set<int>& others) { return others.contains(joint); }) == 1)
          frames[k].insert(joint);
    for (std::size_t k = 0; k < distinct.size(); ++k) {
      const int cell = k == 0 ? place : num_kept + static_cast<int>(more.size());
      (k == 0 ? kept : more).push_back({cells[c].type, distinct[k]});
      if (distinct.size() > 1) copies.push_back({cell, place, {frames[k].begin(), frames[k].end()}});
    }
  }
  cells = std::move(kept);
  cells.insert(cells.end(), more.begin(), more.end());
  drop_unused_vertices();
  std::sort(copies.begin(), copies.end(),
            [](const CellCopy& a, const CellCopy& b) { return a.cell < b.cell; });
  lattice_.copies = std::move(copies);
}

/// Those of cells that are gone; the others keep their order.
void Separation::drop_unused_vertices() {
  CellComplex& complex = lattice_.complex;
  std::vector<int> number(complex.points.rows(), -1);
  for (const Cell& cell : complex.cells)
    for (int k = 0; k < num_corners(cell.type); ++k) number[cell.vertices[k]] = 0;
  for (const LatticeBone& bone : lattice_.bones)
    for (int v : bone.chain) number[v] = 0;
  int count = 0;
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    number[v] = count;
    complex.points.row(count++) = complex.points.row(static_cast<Eigen::Index>(v)).eval();
  }
  complex.points.conservativeResize(count, 3);
  for (Cell& cell : complex.cells)
    for (int k = 0; k < num_corners(cell.type); ++k) cell.vertices[k] = number[cell.vertices[k]];
  for (LatticeBone& bone : lattice_.bones)
    for (int& v : bone.chain) v = number[v];
}

}  // namespace

void separate_limbs(const RigInput& input, const ReducedSkeleton& skeleton, ControlLattice& lattice) {
  if (skeleton.bones.empty() || lattice.complex.cells.empty()) return;
  Separation(input, skeleton, lattice).run();
}

}  // namespace sinew::lattice::detail
