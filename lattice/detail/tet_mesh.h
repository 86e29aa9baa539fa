#pragma once

#include <array>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace sinew::lattice::detail {

/// Smallest scaled Jacobian over the corners of the four hexahedra into which one subdivision cuts the
/// tetrahedron: 0.707 for a regular one. In closed form, as it is asked for more often than anything else.
double level1_jacobian(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                       const Eigen::Vector3d& d);

/// Smallest sine of the six dihedral angles and 1.4 times the level-1 Jacobian, whichever is less; about 0.94
/// for a regular tetrahedron, 0 for a flat one, -1 for an inverted one.
double tetrahedron_quality(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                           const Eigen::Vector3d& d);

/// True where p lies in the tetrahedron, or within `slack` (a share of its size) of it.
bool tetrahedron_contains(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                          const Eigen::Vector3d& d, const Eigen::Vector3d& p, double slack);

/// Tetrahedra that change: cells die and are born, every vertex knows its cells.
class TetMesh {
 public:
  using Tet = std::array<int, 4>;

  /// With Half::PositiveX the mesh is one half of a mirrored one: faces in x = 0 are not on its boundary.
  enum class Half { No, PositiveX };
  TetMesh(std::vector<Eigen::Vector3d> points, const std::vector<Tet>& tets, Half half = Half::No);

  std::vector<Eigen::Vector3d> points;

  bool is_in_plane(int vertex) const { return half_ == Half::PositiveX && points[vertex].x() == 0.0; }
  int num_slots() const { return static_cast<int>(tets_.size()); }
  bool is_alive(int t) const { return alive_[t]; }
  const Tet& tet(int t) const { return tets_[t]; }
  const std::vector<int>& star(int vertex) const { return stars_[vertex]; }
  double quality(int t) const { return quality(tets_[t]); }
  double quality(const Tet& t) const {
    return tetrahedron_quality(points[t[0]], points[t[1]], points[t[2]], points[t[3]]);
  }
  /// Smallest quality over the cells of a vertex.
  double star_quality(int vertex) const;

  int add(const Tet& t);
  void remove(int t);

  /// The living cells, in slot order.
  std::vector<Tet> cells() const;
  /// Per vertex the other two corners of the faces that it shares with no second cell.
  std::vector<std::vector<std::array<int, 2>>> boundary_faces() const;

  /// The cells round the edge a-b in cyclic order with their rim, counter-clockwise seen from b; empty where
  /// the edge lies on the boundary. Cell i holds rim vertices i and i + 1. Round an edge in the plane of a
  /// half the rim is open, from one vertex in the plane to another.
  struct Ring {
    std::vector<int> cells;
    std::vector<int> rim;
  };
  Ring ring(int a, int b) const;

 private:
  Half half_;
  std::vector<Tet> tets_;
  std::vector<char> alive_;
  std::vector<std::vector<int>> stars_;
};

/// Edges that no flip may remove, as ordered pairs.
using EdgeSet = std::set<std::pair<int, int>>;

/// Removes the edge a-b by the best re-triangulation of its rim, 3 to 7 vertices, if that raises the smallest
/// quality of the cells involved. Returns whether it did.
bool remove_edge(TetMesh& mesh, int a, int b, const EdgeSet& keep);

/// Replaces the two cells at the face opposite to corner `k` of cell `t` by three round a new edge, if that
/// raises their smallest quality. Returns whether it did.
bool remove_face(TetMesh& mesh, int t, int k);

}  // namespace sinew::lattice::detail
