#include "assets/rig.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "assets/error.h"

namespace sinew::assets {

namespace {

using lattice::Influence;

/// Weights as close as this count as equal: normalising two copies of one 8-bit weight differs by rounding
/// only, and one step of such a weight is 4e-3.
constexpr double kWeightTolerance = 1e-5;

std::vector<Influence> sorted_by_frame(std::vector<Influence> influences) {
  std::sort(influences.begin(), influences.end(),
            [](const Influence& a, const Influence& b) { return a.frame < b.frame; });
  return influences;
}

/// Compares influences sorted by frame.
bool equal_weights(const std::vector<Influence>& a, const std::vector<Influence>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Influence& x, const Influence& y) {
    return x.frame == y.frame && std::abs(x.weight - y.weight) <= kWeightTolerance;
  });
}

double diagonal(const Rig& rig) {
  Eigen::AlignedBox3d box;
  for (const Part& part : rig.parts) {
    if (part.role != PartRole::Simulated) continue;
    for (Eigen::Index v = 0; v < part.points.rows(); ++v) box.extend(part.points.row(v).transpose());
  }
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

/// Finds the first earlier point that is the same for physics; a grid of cells one tolerance wide holds what
/// has been seen, so that a look at 27 cells finds every candidate.
class Welder {
 public:
  Welder(double tolerance, std::vector<Eigen::Vector3d>& points, std::vector<std::vector<Influence>>& weights)
      : tolerance_(tolerance), points_(points), weights_(weights) {}

  int find_or_add(const Eigen::Vector3d& p, std::vector<Influence> weights) {
    weights = sorted_by_frame(std::move(weights));
    const Key centre = key_of(p);
    int found = -1;
    for (std::int64_t i = -1; i <= 1; ++i) {
      for (std::int64_t j = -1; j <= 1; ++j) {
        for (std::int64_t k = -1; k <= 1; ++k) {
          const auto cell = cells_.find({centre[0] + i, centre[1] + j, centre[2] + k});
          if (cell == cells_.end()) continue;
          for (const int candidate : cell->second) {
            if (found >= 0 && candidate >= found) continue;
            if ((points_[index(candidate)] - p).norm() > tolerance_) continue;
            if (equal_weights(weights_[index(candidate)], weights)) found = candidate;
          }
        }
      }
    }
    if (found >= 0) return found;
    const int added = static_cast<int>(points_.size());
    points_.push_back(p);
    weights_.push_back(std::move(weights));
    cells_[centre].push_back(added);
    return added;
  }

 private:
  using Key = std::array<std::int64_t, 3>;
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  Key key_of(const Eigen::Vector3d& p) const {
    Key key{};
    for (int c = 0; c < 3; ++c) key[index(c)] = static_cast<std::int64_t>(std::floor(p[c] / tolerance_));
    return key;
  }

  double tolerance_;
  std::vector<Eigen::Vector3d>& points_;
  std::vector<std::vector<Influence>>& weights_;
  std::map<Key, std::vector<int>> cells_;
};

std::string list_of_clips(const Rig& rig) {
  std::string list;
  for (const skeleton::Clip& clip : rig.clips) list += (list.empty() ? "'" : ", '") + clip.name + "'";
  return list.empty() ? "none" : list;
}

}  // namespace

int num_vertices(const Rig& rig) {
  Eigen::Index count = 0;
  for (const Part& part : rig.parts) count += part.points.rows();
  return static_cast<int>(count);
}

std::vector<bool> flesh_vertices(const std::vector<Part>& parts, const std::vector<Prop>& props) {
  std::vector<bool> is_flesh;
  for (const Part& part : parts)
    is_flesh.insert(is_flesh.end(), static_cast<std::size_t>(part.points.rows()),
                    part.role == PartRole::Simulated);
  for (const Prop& prop : props)
    for (const int v : prop.vertices) is_flesh[static_cast<std::size_t>(v)] = false;
  return is_flesh;
}

lattice::Points skin(const Rig& rig, const std::vector<Eigen::Affine3d>& pose_from_rest) {
  if (static_cast<int>(pose_from_rest.size()) != rig.skeleton.num_joints()) {
    throw std::invalid_argument("skin: " + std::to_string(pose_from_rest.size()) + " joint maps for " +
                                std::to_string(rig.skeleton.num_joints()) + " joints");
  }
  lattice::Points posed(num_vertices(rig), 3);
  Eigen::Index row = 0;
  for (const Part& part : rig.parts) {
    for (Eigen::Index v = 0; v < part.points.rows(); ++v, ++row) {
      const Eigen::Vector3d p_rest = part.points.row(v).transpose();
      Eigen::Vector3d p = p_rest;
      if (!part.weights.empty()) {
        p.setZero();
        for (const Influence& influence : part.weights[static_cast<std::size_t>(v)]) {
          p += influence.weight * (pose_from_rest[static_cast<std::size_t>(influence.frame)] * p_rest);
        }
      } else if (part.joint >= 0) {
        p = pose_from_rest[static_cast<std::size_t>(part.joint)] * p_rest;
      }
      posed.row(row) = p.transpose();
    }
  }
  return posed;
}

PhysicsSkin physics_skin(const Rig& rig) {
  PhysicsSkin result;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  // A rig of one point has no diagonal; any positive width will do for the grid.
  const double size = diagonal(rig);
  Welder welder(size > 0.0 ? 1e-6 * size : 1.0, points, result.surface.weights);
  const std::vector<bool> is_flesh = flesh_vertices(rig.parts, rig.props);
  for (const Part& part : rig.parts) {
    const std::size_t first = result.surface_of_vertex.size();
    for (Eigen::Index v = 0; v < part.points.rows(); ++v) {
      result.surface_of_vertex.push_back(
          is_flesh[result.surface_of_vertex.size()]
              ? welder.find_or_add(part.points.row(v).transpose(), part.weights[static_cast<std::size_t>(v)])
              : -1);
    }
    if (part.role != PartRole::Simulated) continue;
    auto next_turned = part.turned.begin();
    for (Eigen::Index t = 0; t < part.triangles.rows(); ++t) {
      std::array<int, 3> corners{};
      for (int c = 0; c < 3; ++c) {
        corners[static_cast<std::size_t>(c)] =
            result.surface_of_vertex[first + static_cast<std::size_t>(part.triangles(t, c))];
      }
      if (next_turned != part.turned.end() && *next_turned == t) {
        std::swap(corners[1], corners[2]);
        ++next_turned;
      }
      if (corners[0] < 0) continue;  // of a prop, which has whole triangles
      if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]) {
        triangles.push_back(corners);
      }
    }
  }
  result.surface.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    result.surface.points.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  }
  result.surface.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      result.surface.triangles(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(c)) = triangles[t][c];
    }
  }
  return result;
}

double thickness(const lattice::Points& points) {
  if (points.rows() < 2) return 0.0;
  const lattice::Points centred = points.rowwise() - points.colwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(centred.transpose() * centred);
  const Eigen::VectorXd along = centred * axes.eigenvectors().col(0);
  return along.maxCoeff() - along.minCoeff();
}

int choose_clip(const Rig& rig, const std::string& name) {
  if (!name.empty()) {
    for (std::size_t i = 0; i < rig.clips.size(); ++i) {
      if (rig.clips[i].name == name) return static_cast<int>(i);
    }
    for (const FaultyClip& faulty : rig.faulty_clips) {
      if (faulty.name == name) throw InputError(rig.file, faulty.reason);
    }
    throw ConfigError(rig.file + ": clip '" + name + "': not in the file, which has " + list_of_clips(rig) +
                      "; hint: name one of these, or none for the first that moves");
  }
  for (std::size_t i = 0; i < rig.clips.size(); ++i) {
    if (rig.clips[i].num_keys >= 2 && rig.clips[i].duration() > 0.0) return static_cast<int>(i);
  }
  for (std::size_t i = 0; i < rig.clips.size(); ++i) {
    if (rig.clips[i].num_keys >= 1) return static_cast<int>(i);
  }
  throw InputError(rig.file, "clips: no motion, got " + list_of_clips(rig) +
                                 ", expected a clip with keys; hint: export the character together with an "
                                 "animation");
}

}  // namespace sinew::assets
