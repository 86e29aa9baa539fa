#include "assets/riding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include <Eigen/SVD>

#include "assets/detail/rest_points.h"
#include "assets/detail/text.h"
#include "assets/error.h"
#include "lattice/surface_query.h"

namespace sinew::assets {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using lattice::Influence;
using lattice::Points;

/// How far round a prop flesh carries it, in the prop's mean radii [-].
constexpr double kReach = 2.0;
/// Flesh farther away than this, in its diagonals, does not touch [-].
constexpr double kTouch = 0.02;
/// Less of the weight near a prop than this is a trace of a joint [-].
constexpr double kTrace = 0.05;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Matrix3d nearest_rotation(const Matrix3d& m) {
  const Eigen::JacobiSVD<Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d flip = Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * flip * svd.matrixV().transpose();
}

Vector3d middle_of(const std::vector<Anchor>& anchors, const Points& points) {
  Vector3d middle = Vector3d::Zero();
  for (const Anchor& a : anchors) middle += a.weight * points.row(a.vertex).transpose();
  return middle;
}

/// The flesh of a rig as plain vertices.
struct Flesh {
  Flesh(const Rig& rig, const std::vector<Prop>& props) {
    const std::vector<bool> is_flesh = flesh_vertices(rig.parts, props);
    points = detail::rest_points(rig);
    area.assign(is_flesh.size(), 0.0);
    std::vector<Eigen::RowVector3i> list;
    int first = 0;
    for (const Part& part : rig.parts) {
      for (Eigen::Index t = 0; t < part.triangles.rows(); ++t) {
        const Eigen::RowVector3i corners = part.triangles.row(t).array() + first;
        if (!is_flesh[at(corners[0])]) continue;
        list.push_back(corners);
        const Vector3d a = points.row(corners[0]), b = points.row(corners[1]), c = points.row(corners[2]);
        for (const int v : corners) area[at(v)] += (b - a).cross(c - a).norm() / 6.0;
      }
      for (Eigen::Index v = 0; v < part.points.rows(); ++v)
        weights.push_back(part.weights.empty() ? nullptr : &part.weights[static_cast<std::size_t>(v)]);
      first += static_cast<int>(part.points.rows());
    }
    triangles.resize(static_cast<Eigen::Index>(list.size()), 3);
    for (std::size_t t = 0; t < list.size(); ++t) triangles.row(static_cast<Eigen::Index>(t)) = list[t];
    for (std::size_t v = 0; v < is_flesh.size(); ++v) {
      if (!is_flesh[v] || !(area[v] > 0.0)) continue;
      vertices.push_back(static_cast<int>(v));
      box.extend(points.row(static_cast<Eigen::Index>(v)).transpose());
    }
  }
  double weight_on(int vertex, int joint) const {
    double sum = 0.0;
    for (const Influence& i : *weights[at(vertex)])
      if (i.frame == joint) sum += i.weight;
    return sum;
  }

  Points points;             ///< of all vertices of the rig.
  std::vector<double> area;  ///< a third of the triangles round each [m^2].
  std::vector<const std::vector<Influence>*> weights;
  std::vector<int> vertices;  ///< of flesh.
  lattice::Triangles triangles;
  Eigen::AlignedBox3d box;
};

struct Group {
  int joint = -1;
  std::vector<std::size_t> props;
  std::vector<int> vertices;
  Eigen::AlignedBox3d box;
};

/// Props of one joint whose boxes meet.
std::vector<Group> group_props(const std::vector<Prop>& props, const Flesh& flesh) {
  const Vector3d margin = Vector3d::Constant(0.25 * kTouch * flesh.box.diagonal().norm());
  std::vector<Group> groups;
  for (std::size_t i = 0; i < props.size(); ++i) {
    Group own{props[i].joint, {i}, props[i].vertices, {}};
    for (const int v : own.vertices) own.box.extend(flesh.points.row(v).transpose());
    own.box.min() -= margin;
    own.box.max() += margin;
    for (bool met = true; met;) {
      met = false;
      for (std::size_t g = 0; g < groups.size(); ++g) {
        if (groups[g].joint != own.joint || !groups[g].box.intersects(own.box)) continue;
        own.props.insert(own.props.end(), groups[g].props.begin(), groups[g].props.end());
        own.vertices.insert(own.vertices.end(), groups[g].vertices.begin(), groups[g].vertices.end());
        own.box.extend(groups[g].box);
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(g));
        met = true;
        break;
      }
    }
    groups.push_back(std::move(own));
  }
  return groups;
}

class Holder {
 public:
  Holder(const Rig& rig, const std::vector<Prop>& props)
      : rig_(rig), flesh_(rig, props), surface_(flesh_.points, flesh_.triangles) {}

  const Flesh& flesh() const { return flesh_; }

  Hold hold(const Group& group) const {
    Hold hold;
    Vector3d middle = Vector3d::Zero();
    for (const int v : group.vertices) middle += flesh_.points.row(v).transpose();
    middle /= static_cast<double>(group.vertices.size());
    double squares = 0.0;
    for (const int v : group.vertices) squares += (flesh_.points.row(v).transpose() - middle).squaredNorm();
    const double radius = std::sqrt(squares / static_cast<double>(group.vertices.size()));
    const double near = kTouch * flesh_.box.diagonal().norm();
    hold.touches = std::any_of(group.vertices.begin(), group.vertices.end(), [&](int v) {
      return surface_.is_within(flesh_.points.row(v).transpose(), near);
    });
    hold.anchors = anchors_of(group, std::max(radius, near));
    if (hold.anchors.empty()) return hold;
    measure(group, hold);
    return hold;
  }

 private:
  /// Distance of a point from the nearest of the group's vertices [m].
  double distance(const Group& group, const Vector3d& p) const {
    double least = std::numeric_limits<double>::infinity();
    for (const int v : group.vertices)
      least = std::min(least, (flesh_.points.row(v).transpose() - p).squaredNorm());
    return std::sqrt(least);
  }

  std::vector<Anchor> anchors_of(const Group& group, double radius) const {
    double closest = std::numeric_limits<double>::infinity();
    for (const int v : flesh_.vertices)
      closest = std::min(closest, group.box.exteriorDistance(Vector3d(flesh_.points.row(v).transpose())));
    // No vertex of the group is farther from the closest one than its box is long.
    const double outer = closest + group.box.diagonal().norm() + kReach * radius;
    std::vector<std::pair<int, double>> near;
    double least = std::numeric_limits<double>::infinity();
    for (const int v : flesh_.vertices) {
      const Vector3d p = flesh_.points.row(v).transpose();
      if (group.box.exteriorDistance(p) > std::min(outer, least + kReach * radius)) continue;
      near.emplace_back(v, distance(group, p));
      least = std::min(least, near.back().second);
    }
    const double reach = least + kReach * radius;
    std::vector<Anchor> anchors;
    std::map<int, double> of_joint;
    double total = 0.0;
    for (const auto& [v, d] : near) {
      if (d >= reach) continue;
      const double fall = 1.0 - d * d / (reach * reach);
      const double weight = flesh_.area[at(v)] * fall * fall;
      anchors.push_back({v, weight});
      total += weight;
      for (const Influence& i : *flesh_.weights[at(v)]) of_joint[i.frame] += weight * i.weight;
    }
    int own = group.joint;
    while (own >= 0 && of_joint[own] < kTrace * total) own = rig_.skeleton.joint(own).parent;
    if (group.joint >= 0 && own < 0) return {};
    double sum = 0.0;
    for (Anchor& anchor : anchors) {
      if (own >= 0) anchor.weight *= flesh_.weight_on(anchor.vertex, own);
      sum += anchor.weight;
    }
    std::erase_if(anchors, [&](const Anchor& a) { return a.weight <= 1e-6 * sum; });
    for (Anchor& anchor : anchors) anchor.weight /= sum;
    return anchors;
  }

  void measure(const Group& group, Hold& hold) const {
    const Vector3d middle = middle_of(hold.anchors, flesh_.points);
    double squares = 0.0, farthest = 0.0;
    for (const Anchor& a : hold.anchors)
      squares += a.weight * (flesh_.points.row(a.vertex).transpose() - middle).squaredNorm();
    for (const int v : group.vertices)
      farthest = std::max(farthest, (flesh_.points.row(v).transpose() - middle).norm());
    hold.lever = farthest / std::max(std::sqrt(squares), 1e-12 * farthest);
  }

  const Rig& rig_;
  Flesh flesh_;
  lattice::SurfaceQuery surface_;
};

}  // namespace

std::vector<Hold> hold_props(const Rig& rig, const std::vector<Prop>& props) {
  std::vector<Hold> holds(props.size());
  const std::vector<bool> is_flesh = flesh_vertices(rig.parts, props);
  if (std::find(is_flesh.begin(), is_flesh.end(), true) == is_flesh.end()) return holds;
  const Holder holder(rig, props);
  for (const Group& group : group_props(props, holder.flesh())) {
    const Hold hold = holder.hold(group);
    for (const std::size_t i : group.props) holds[i] = hold;
  }
  return holds;
}

void hang_riders(Rig& rig) {
  const std::vector<Hold> holds = hold_props(rig, rig.props);
  for (std::size_t i = 0; i < rig.props.size(); ++i) {
    Prop& prop = rig.props[i];
    if (prop.role != PartRole::Riding) continue;
    prop.anchors = holds[i].anchors;
    if (prop.anchors.empty())
      throw ConfigError("part '" + detail::printable(prop.name) +
                        "': cannot ride, as no flesh of its joint is near; hint: role = \"skinned\"");
  }
}

Matrix3d best_turn(const std::vector<Anchor>& anchors, const Points& from, const Points& to) {
  const Vector3d from_middle = middle_of(anchors, from), to_middle = middle_of(anchors, to);
  Matrix3d turn = Matrix3d::Zero();
  double spread = 0.0;
  for (const Anchor& a : anchors) {
    const Vector3d p = from.row(a.vertex).transpose() - from_middle;
    turn += a.weight * (to.row(a.vertex).transpose() - to_middle) * p.transpose();
    spread += a.weight * p.squaredNorm();
  }
  if (!(spread > 0.0)) return Matrix3d::Identity();
  // Points on a line leave the turn about it free: this much of a rest shape keeps it from turning.
  constexpr double kStay = 1e-9;
  return nearest_rotation(turn + kStay * spread * Matrix3d::Identity());
}

PropMotion::PropMotion(const Rig& rig) : rig_(rig), rest_(detail::rest_points(rig)) {
  const bool any = std::any_of(rig.props.begin(), rig.props.end(),
                               [](const Prop& prop) { return prop.role == PartRole::Riding; });
  joint_of_prop_.assign(rig.props.size(), -1);
  if (!any) return;
  const Flesh flesh(rig, rig.props);
  for (std::size_t i = 0; i < rig.props.size(); ++i) {
    if (rig.props[i].role != PartRole::Riding) continue;
    std::map<int, double> of_joint;
    for (const Anchor& anchor : rig.props[i].anchors)
      for (const Influence& influence : *flesh.weights[at(anchor.vertex)])
        of_joint[influence.frame] += anchor.weight * influence.weight;
    const auto most = std::max_element(of_joint.begin(), of_joint.end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    joint_of_prop_[i] = most->first;
    flesh_of_joint_[most->first];
  }
  for (auto& [joint, anchors] : flesh_of_joint_) {
    double sum = 0.0;
    for (const int v : flesh.vertices) {
      const double weight = flesh.area[at(v)] * flesh.weight_on(v, joint);
      if (weight > 0.0) anchors.push_back({v, weight});
      sum += weight;
    }
    for (Anchor& anchor : anchors) anchor.weight /= sum;
  }
}

namespace {

/// A turn less the first few degrees of it: eyes look where the artist has them look while the flesh round
/// them ripples, and a hat goes with a head that swings.
Matrix3d beyond_gaze(const Matrix3d& turn) {
  constexpr double kGaze = 5.0 * std::numbers::pi / 180.0;
  const Eigen::AngleAxisd whole(turn);
  return Eigen::AngleAxisd(std::max(0.0, whole.angle() - kGaze), whole.axis()).toRotationMatrix();
}

}  // namespace

void PropMotion::place(const std::vector<Eigen::Affine3d>& pose_from_rest, const Points& skinned,
                       Points& frame) const {
  std::map<int, Matrix3d> turn_of;
  for (const auto& [joint, anchors] : flesh_of_joint_) turn_of[joint] = best_turn(anchors, skinned, frame);
  for (std::size_t i = 0; i < rig_.props.size(); ++i) {
    const Prop& prop = rig_.props[i];
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    const Points* source = &skinned;
    if (prop.role == PartRole::Rigid) {
      const Eigen::Affine3d& joint = pose_from_rest[at(prop.joint)];
      const Vector3d origin = rig_.skeleton.joint(prop.joint).rest_from_joint.translation();
      motion.linear() = nearest_rotation(joint.linear());
      motion.translation() = joint * origin - motion.linear() * origin;
      source = &rest_;
    } else if (prop.role == PartRole::Riding) {
      motion.linear() = beyond_gaze(turn_of[joint_of_prop_[i]]);
      motion.translation() =
          middle_of(prop.anchors, frame) - motion.linear() * middle_of(prop.anchors, skinned);
    }
    for (const int v : prop.vertices) frame.row(v) = (motion * source->row(v).transpose()).transpose();
  }
}

}  // namespace sinew::assets
