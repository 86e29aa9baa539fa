#include "assets/detail/turned_shells.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "lattice/surface_query.h"

namespace sinew::assets::detail {

namespace {

/// A triangle of a simulated part over the welded points.
struct Face {
  std::size_t part = 0;
  int triangle = 0;
  std::array<int, 3> corners{};
};

/// One side of a face; `forward` where the face runs from the smaller point to the larger one.
struct Side {
  std::pair<int, int> edge;
  int face = -1;
  bool forward = false;
};

/// Faces that hang together by edges.
struct Shell {
  std::vector<int> faces;
  std::vector<bool> against;  ///< per face: wound against the first one.
  bool closed = true;         ///< every edge has two faces, and all can be wound alike.
  double volume = 0.0;        ///< [m^3], signed, as the first face is wound.
};

/// Points of all simulated parts; places with different weights are one.
PhysicsSkin weld_by_place(Rig rig) {
  for (Part& part : rig.parts) {
    part.turned.clear();
    for (auto& influences : part.weights) influences = {{0, 1.0}};
  }
  return physics_skin(rig);
}

std::vector<Face> faces_of(const Rig& rig, const PhysicsSkin& welded) {
  std::vector<Face> faces;
  std::size_t first = 0;
  for (std::size_t p = 0; p < rig.parts.size(); ++p) {
    const Part& part = rig.parts[p];
    for (int t = 0; t < part.triangles.rows() && part.role == PartRole::Simulated; ++t) {
      Face face{p, t, {}};
      for (int c = 0; c < 3; ++c)
        face.corners[static_cast<std::size_t>(c)] =
            welded.surface_of_vertex[first + static_cast<std::size_t>(part.triangles(t, c))];
      const auto& [a, b, c] = face.corners;
      if (a != b && b != c && c != a) faces.push_back(face);
    }
    first += static_cast<std::size_t>(part.points.rows());
  }
  return faces;
}

class ShellFinder {
 public:
  ShellFinder(const lattice::Points& points, const std::vector<Face>& faces)
      : points_(points), faces_(faces) {
    for (int f = 0; f < static_cast<int>(faces.size()); ++f) {
      const auto& corners = faces[static_cast<std::size_t>(f)].corners;
      for (std::size_t c = 0; c < 3; ++c) {
        const int from = corners[c], to = corners[(c + 1) % 3];
        sides_.push_back({std::minmax(from, to), f, from < to});
      }
    }
    std::sort(sides_.begin(), sides_.end(), [](const Side& a, const Side& b) {
      return std::pair(a.edge, a.face) < std::pair(b.edge, b.face);
    });
  }

  std::vector<Shell> run() {
    state_.assign(faces_.size(), State::Unseen);
    std::vector<Shell> shells;
    for (int f = 0; f < static_cast<int>(faces_.size()); ++f) {
      if (state_[static_cast<std::size_t>(f)] == State::Unseen) shells.push_back(grow(f));
    }
    return shells;
  }

 private:
  enum class State { Unseen, Along, Against };

  Shell grow(int seed) {
    Shell shell;
    std::vector<int> stack{seed};
    state_[static_cast<std::size_t>(seed)] = State::Along;
    while (!stack.empty()) {
      const int f = stack.back();
      stack.pop_back();
      const bool against = state_[static_cast<std::size_t>(f)] == State::Against;
      shell.faces.push_back(f);
      shell.against.push_back(against);
      const auto& corners = faces_[static_cast<std::size_t>(f)].corners;
      const Eigen::Vector3d a =
          points_.row(corners[0]) - points_.row(faces_[static_cast<std::size_t>(seed)].corners[0]);
      const Eigen::Vector3d b =
          points_.row(corners[1]) - points_.row(faces_[static_cast<std::size_t>(seed)].corners[0]);
      const Eigen::Vector3d c =
          points_.row(corners[2]) - points_.row(faces_[static_cast<std::size_t>(seed)].corners[0]);
      shell.volume += (against ? -1.0 : 1.0) * a.dot(b.cross(c)) / 6.0;
      for (std::size_t k = 0; k < 3; ++k)
        cross(f, against, std::minmax(corners[k], corners[(k + 1) % 3]), shell, stack);
    }
    return shell;
  }

  /// Goes on to the faces beyond an edge.
  void cross(int f, bool against, std::pair<int, int> edge, Shell& shell, std::vector<int>& stack) {
    const auto begin = std::lower_bound(sides_.begin(), sides_.end(), edge,
                                        [](const Side& side, const auto& e) { return side.edge < e; });
    auto end = begin;
    bool forward = false;
    for (; end != sides_.end() && end->edge == edge; ++end) {
      if (end->face == f) forward = end->forward;
    }
    shell.closed = shell.closed && end - begin == 2;
    for (auto side = begin; side != end; ++side) {
      if (side->face == f) continue;
      // Neighbours that are wound alike run along their edge in opposite directions.
      const State wanted = (side->forward == forward) != against ? State::Against : State::Along;
      State& state = state_[static_cast<std::size_t>(side->face)];
      if (state == State::Unseen) {
        state = wanted;
        stack.push_back(side->face);
      } else if (state != wanted) {
        shell.closed = false;
      }
    }
  }

  const lattice::Points& points_;
  const std::vector<Face>& faces_;
  std::vector<Side> sides_;  ///< sorted by edge.
  std::vector<State> state_;
};

/// Whether most of the shell is wound inwards in the file.
bool is_inside_out(const Shell& shell) {
  const auto against = std::count(shell.against.begin(), shell.against.end(), true);
  const bool mostly_against = 2 * against > static_cast<std::ptrdiff_t>(shell.against.size());
  return mostly_against ? shell.volume > 0.0 : shell.volume < 0.0;
}

/// Which shells lie within one that the file has the right way round.
std::vector<bool> find_cavities(const lattice::Points& points, const std::vector<Face>& faces,
                                const std::vector<Shell>& shells) {
  std::vector<bool> cavity(shells.size(), false);
  std::vector<int> outward;
  bool any_inside_out = false;
  for (const Shell& shell : shells) {
    if (!shell.closed) continue;
    any_inside_out = any_inside_out || is_inside_out(shell);
    if (!is_inside_out(shell)) outward.insert(outward.end(), shell.faces.begin(), shell.faces.end());
  }
  if (!any_inside_out || outward.empty()) return cavity;
  lattice::Triangles triangles(static_cast<Eigen::Index>(outward.size()), 3);
  for (std::size_t i = 0; i < outward.size(); ++i) {
    const auto& corners = faces[static_cast<std::size_t>(outward[i])].corners;
    triangles.row(static_cast<Eigen::Index>(i)) << corners[0], corners[1], corners[2];
  }
  const lattice::SurfaceQuery query(points, triangles);
  for (std::size_t s = 0; s < shells.size(); ++s) {
    if (!shells[s].closed || !is_inside_out(shells[s])) continue;
    const auto& corners = faces[static_cast<std::size_t>(shells[s].faces.front())].corners;
    const Eigen::Vector3d p =
        (points.row(corners[0]) + points.row(corners[1]) + points.row(corners[2])).transpose() / 3.0;
    cavity[s] = query.winding_number(p) > 0.5;
  }
  return cavity;
}

void report(Rig& rig, std::size_t num_shells, std::size_t num_faces, const std::string& parts) {
  if (num_shells > 0) {
    rig.findings.push_back({Finding::Severity::Warning, "shells-inside-out", parts,
                            std::to_string(num_shells) + " closed shell" + (num_shells == 1 ? "" : "s") +
                                " inside out, taken the right way round; what is written stays as it is",
                            "turn the normals of these faces in the modelling program"});
  }
  if (num_faces > 0) {
    rig.findings.push_back(
        {Finding::Severity::Warning, "faces-turned", parts,
         std::to_string(num_faces) +
             " triangles of closed shells are wound against their neighbours; physics takes "
             "them the right way round, what is written stays as it is",
         "make the normals of the mesh consistent in the modelling program"});
  }
}

}  // namespace

void turn_shells(Rig& rig) {
  const PhysicsSkin welded = weld_by_place(rig);
  const std::vector<Face> faces = faces_of(rig, welded);
  const std::vector<Shell> shells = ShellFinder(welded.surface.points, faces).run();
  const std::vector<bool> cavity = find_cavities(welded.surface.points, faces, shells);
  std::size_t num_shells = 0, num_faces = 0;
  std::vector<bool> named(rig.parts.size(), false);
  for (std::size_t s = 0; s < shells.size(); ++s) {
    const Shell& shell = shells[s];
    if (!shell.closed || shell.volume == 0.0) continue;
    const bool turn_first = (shell.volume < 0.0) != cavity[s];
    const auto against = std::count(shell.against.begin(), shell.against.end(), !turn_first);
    const auto num_turned = static_cast<std::size_t>(against);
    if (num_turned == 0) continue;
    const bool whole = 2 * num_turned > shell.faces.size();
    if (whole) ++num_shells;
    num_faces += whole ? shell.faces.size() - num_turned : num_turned;
    for (std::size_t i = 0; i < shell.faces.size(); ++i) {
      if (shell.against[i] == turn_first) continue;
      const Face& face = faces[static_cast<std::size_t>(shell.faces[i])];
      rig.parts[face.part].turned.push_back(face.triangle);
      named[face.part] = true;
    }
  }
  std::string parts;
  for (std::size_t p = 0; p < rig.parts.size(); ++p) {
    std::sort(rig.parts[p].turned.begin(), rig.parts[p].turned.end());
    if (named[p]) parts += (parts.empty() ? "" : ", ") + rig.parts[p].name;
  }
  report(rig, num_shells, num_faces, parts);
}

}  // namespace sinew::assets::detail
