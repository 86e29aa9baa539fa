#include "fem/skin/skin_judge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>
#include <tbb/parallel_for.h>

#include "fem/skin/detail/judged_skin.h"
#include "fem/skin/detail/nearest_rotation.h"

namespace sinew::fem {

using detail::Gram;
using detail::JudgedSkin;
using lattice::Points;
using Rotations = std::vector<Eigen::Matrix3d>;

namespace {

constexpr int kRings = 3;  ///< over which turns and places are smoothed.
constexpr double kStretch = 2.5, kSqueeze = 0.2;
constexpr double kFoldCos =
    0.2;  ///< folded: the normals' cosine falls from above this to below its opposite.
constexpr double kCreaseAngle = 30.0 * std::numbers::pi / 180.0;
/// Plain skinning that leaves less of a triangle's area does not say which way it faces.
constexpr double kNoFace = 0.02;

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

/// Calls use(neighbour, rest length) for every neighbour of a vertex.
template <class Use>
void for_neighbours(const JudgedSkin& skin, int v, const Use& use) {
  const auto begin = at(skin.first[at(v)]), end = at(skin.first[at(v + 1)]);
  for (std::size_t i = begin; i < end; ++i) use(skin.neighbour[i], skin.length[i]);
}

double degree(const JudgedSkin& skin, int v) { return skin.first[at(v + 1)] - skin.first[at(v)]; }

void gather(const Points& x, const std::vector<int>& rows, Points& out) {
  out.resize(static_cast<Eigen::Index>(rows.size()), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = x.row(rows[i]);
}

/// Every value becomes the mean of itself and its neighbours' mean, kRings times. `next`: a buffer.
template <class Value>
void smooth(const JudgedSkin& skin, const Value& zero, std::vector<Value>& values, std::vector<Value>& next) {
  next.resize(values.size(), zero);
  for (int ring = 0; ring < kRings; ++ring) {
    tbb::parallel_for(0, skin.num_vertices(), [&](int v) {
      Value sum = zero;
      for_neighbours(skin, v, [&](int w, double) { sum += values[at(w)]; });
      next[at(v)] = 0.5 * values[at(v)] + (0.5 / degree(skin, v)) * sum;
    });
    values.swap(next);
  }
}

/// sum_w (x_w - x_v)(y_w - y_v)^T round every vertex, smoothed: its nearest rotation turns y into x there.
void local_maps(const JudgedSkin& skin, const Points& x, const Points& y, Rotations& maps,
                Rotations& buffer) {
  maps.resize(at(skin.num_vertices()));
  tbb::parallel_for(0, skin.num_vertices(), [&](int v) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for_neighbours(skin, v, [&](int w, double) {
      sum.noalias() += (x.row(w) - x.row(v)).transpose() * (y.row(w) - y.row(v));
    });
    maps[at(v)] = sum / degree(skin, v);
  });
  smooth(skin, Eigen::Matrix3d(Eigen::Matrix3d::Zero()), maps, buffer);
}

/// Principal stretches from one shape of a triangle to another; NaN where the first has no area.
struct Stretches {
  double most, least;
};
Stretches stretches(const Gram& to, const Gram& from) {
  const double det = from.aa * from.bb - from.ab * from.ab;
  const double longest = std::max(from.aa, from.bb);
  if (!(det > 1e-6 * longest * longest)) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    return {kNone, kNone};
  }
  const double half_trace = 0.5 * (from.bb * to.aa - 2.0 * from.ab * to.ab + from.aa * to.bb) / det;
  const double product = std::max((to.aa * to.bb - to.ab * to.ab) / det, 0.0);
  const double spread = std::sqrt(std::max(half_trace * half_trace - product, 0.0));
  return {std::sqrt(std::max(half_trace + spread, 0.0)), std::sqrt(std::max(half_trace - spread, 0.0))};
}

/// The least value that at most the share `above` of the weight exceeds.
double upper_quantile(const std::vector<double>& values, const std::vector<double>& weights, double above) {
  if (values.empty()) return 0.0;
  const double allowed = above * std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<int> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  // Ties by number, so that the order is one whichever way it is found.
  const auto larger = [&](int a, int b) {
    return values[at(a)] != values[at(b)] ? values[at(a)] > values[at(b)] : a < b;
  };
  double passed = 0.0;
  std::size_t sorted = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == sorted) {  // only as much as is looked at need be in order
      const std::size_t more = std::max<std::size_t>(
          16,
          sorted == 0 ? static_cast<std::size_t>(2.0 * above * static_cast<double>(order.size())) : sorted);
      sorted = std::min(order.size(), sorted + more);
      std::partial_sort(order.begin() + static_cast<std::ptrdiff_t>(i),
                        order.begin() + static_cast<std::ptrdiff_t>(sorted), order.end(), larger);
    }
    passed += weights[at(order[i])];
    if (passed > allowed) return values[at(order[i])];
  }
  return values[at(order.back())];
}

double volume(const Points& x, const lattice::Triangles& triangles, const Eigen::RowVector3d& centre) {
  double sum = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::RowVector3d a = x.row(triangles(t, 0)) - centre, b = x.row(triangles(t, 1)) - centre,
                             c = x.row(triangles(t, 2)) - centre;
    sum += a.dot(b.cross(c));
  }
  return sum / 6.0;
}

int largest(const std::vector<double>& values) {
  return static_cast<int>(std::max_element(values.begin(), values.end()) - values.begin());
}

/// One frame after the other: flesh x against plain skinning p and rest. Its buffers are kept, as memory
/// asked for anew in every frame costs a quarter of the whole.
class FrameMeasure {
 public:
  explicit FrameMeasure(JudgedSkin skin) : skin_(std::move(skin)) {
    if (skin_.num_triangles() > 0)
      volume_at_rest_ = volume(skin_.rest, skin_.triangles, skin_.rest.colwise().mean());
  }

  SkinFrame measure(const Points& flesh, const Points& plain, FrameKind kind) {
    frame_ = {};
    if (skin_.num_triangles() == 0) return frame_;
    gather(flesh, skin_.vertex, x_);
    gather(plain, skin_.vertex, p_);
    detail::triangle_normals(x_, skin_.triangles, normal_x_);
    detail::triangle_normals(p_, skin_.triangles, normal_p_);
    compare_vertices();
    compare_triangles();
    compare_hinges();
    compare_volumes(plain);
    frame_.worst_vertex = skin_.vertex[at(worst_place(judge(frame_, kind).fault))];
    return frame_;
  }

  const JudgedSkin& skin() const { return skin_; }

 private:
  /// Roughness and distance from plain skinning.
  void compare_vertices() {
    local_maps(skin_, x_, p_, turn_, buffer_);
    roughness_.resize(at(skin_.num_vertices()));
    away_.resize(roughness_.size());
    tbb::parallel_for(0, skin_.num_vertices(), [&](int v) {
      turn_[at(v)] = detail::nearest_rotation(turn_[at(v)]);
      Eigen::Vector3d bend_x = Eigen::Vector3d::Zero(), bend_p = bend_x;
      double edge = 0.0;
      for_neighbours(skin_, v, [&](int w, double rest) {
        bend_x += (x_.row(w) - x_.row(v)).transpose();
        const Eigen::Vector3d side = (p_.row(w) - p_.row(v)).transpose();
        bend_p += side;
        edge += std::max(side.norm(), rest);
      });
      // Laplacians and mean edge have the same divisor.
      roughness_[at(v)] =
          (bend_x - turn_[at(v)] * bend_p).norm() / std::max(edge, 1e-12 * skin_.height * degree(skin_, v));
      away_[at(v)] = (x_.row(v) - p_.row(v)).norm() / skin_.height;
    });
    frame_.roughness = upper_quantile(roughness_, skin_.share, 0.005);
    frame_.away_95 = upper_quantile(away_, skin_.share, 0.05);
    frame_.away_99 = upper_quantile(away_, skin_.share, 0.01);
    farthest_ = largest(away_);
    frame_.away_most = away_[at(farthest_)];
    frame_.farthest_vertex = skin_.vertex[at(farthest_)];
  }

  bool faces_away(int t, const Rotations& turn, const Points& normal) const {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) sum += turn[at(skin_.triangles(t, k))];
    return normal_x_.row(t).dot(sum * normal.row(t).transpose()) < 0.0;
  }

  /// Of the triangles that face away against plain skinning those that do so against rest too.
  void confirm_flips() {
    if (std::none_of(flipped_.begin(), flipped_.end(), [](char f) { return f != 0; })) return;
    local_maps(skin_, x_, skin_.rest, rest_turn_, buffer_);
    std::vector<char> wanted(rest_turn_.size(), 0);
    for (int t = 0; t < skin_.num_triangles(); ++t) {
      for (int k = 0; k < 3 && flipped_[at(t)]; ++k) wanted[at(skin_.triangles(t, k))] = 1;
    }
    tbb::parallel_for(0, skin_.num_vertices(), [&](int v) {
      if (wanted[at(v)]) rest_turn_[at(v)] = detail::nearest_rotation(rest_turn_[at(v)]);
    });
    for (int t = 0; t < skin_.num_triangles(); ++t)
      flipped_[at(t)] = flipped_[at(t)] && faces_away(t, rest_turn_, skin_.normal);
  }

  void compare_triangles() {
    const auto n = at(skin_.num_triangles());
    flipped_.assign(n, 0);
    std::vector<char> stretched(n, 0), squeezed(n, 0);
    tbb::parallel_for(0, skin_.num_triangles(), [&](int t) {
      flipped_[at(t)] =
          normal_p_.row(t).norm() > kNoFace * 2.0 * skin_.area[at(t)] && faces_away(t, turn_, normal_p_);
      const Gram now = detail::gram(x_, skin_.triangles, t);
      const Stretches plain = stretches(now, detail::gram(p_, skin_.triangles, t));
      if (plain.most <= kStretch && plain.least >= kSqueeze) return;
      const Stretches rest = stretches(now, skin_.gram[at(t)]);
      stretched[at(t)] = std::fmin(plain.most, rest.most) > kStretch;  // of a NaN and a number, the number
      squeezed[at(t)] = std::fmax(plain.least, rest.least) < kSqueeze;
    });
    confirm_flips();
    torn_.assign(n, 0);
    double area = 0.0;
    for (std::size_t t = 0; t < n; ++t) {
      torn_[t] = flipped_[t] || stretched[t] || squeezed[t];
      frame_.flipped += flipped_[t];
      frame_.stretched += stretched[t];
      frame_.squeezed += squeezed[t];
      if (torn_[t]) area += skin_.area[t];
    }
    frame_.torn_area = area / skin_.total_area;
  }

  void compare_hinges() {
    const auto n = static_cast<int>(skin_.hinges.size());
    creased_.assign(at(n), 0);
    std::vector<char> folded(at(n), 0);
    const auto cosine = [](const Points& normals, const detail::Hinge& h) {
      const Eigen::RowVector3d a = normals.row(h.triangle_a), b = normals.row(h.triangle_b);
      const double length = std::sqrt(a.squaredNorm() * b.squaredNorm());
      return length > 0.0 ? a.dot(b) / length : 0.0;
    };
    const auto angle = [](double cosine_of_it) { return std::acos(std::clamp(cosine_of_it, -1.0, 1.0)); };
    tbb::parallel_for(0, n, [&](int i) {
      const detail::Hinge& hinge = skin_.hinges[at(i)];
      const double now = cosine(normal_x_, hinge);
      if (now > 0.8661) return;  // less than 30 degrees altogether: bent by less
      const double plain = cosine(normal_p_, hinge);
      folded[at(i)] = now < -kFoldCos && plain > kFoldCos && hinge.cos_rest > kFoldCos;
      creased_[at(i)] = angle(now) - std::max(angle(plain), angle(hinge.cos_rest)) > kCreaseAngle;
    });
    for (std::size_t i = 0; i < at(n); ++i) {
      frame_.folds += folded[i];
      if (creased_[i]) frame_.creases += skin_.hinges[i].length / skin_.height;
    }
  }

  /// About the centre of the whole skin in plain skinning, as a skin may be open.
  void compare_volumes(const Points& plain) {
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (int v : skin_.all) centre += plain.row(v);
    centre /= static_cast<double>(skin_.all.size());
    const double now = volume(x_, skin_.triangles, centre), before = volume(p_, skin_.triangles, centre);
    const double none = 1e-9 * std::pow(skin_.height, 3);
    if (std::abs(before) > none) frame_.volume_ratio = now / before;
    if (std::abs(volume_at_rest_) > none) frame_.volume_of_rest = now / volume_at_rest_;
  }

  /// The judged vertex with most of the fault round it.
  int worst_place(SkinFault fault) const {
    std::vector<double> score(at(skin_.num_vertices()), 0.0);
    switch (fault) {
      case SkinFault::TornArea:
        for (int t = 0; t < skin_.num_triangles(); ++t) {
          for (int k = 0; k < 3 && torn_[at(t)]; ++k) score[at(skin_.triangles(t, k))] += skin_.area[at(t)];
        }
        break;
      case SkinFault::Creases:
        for (std::size_t i = 0; i < skin_.hinges.size(); ++i) {
          if (!creased_[i]) continue;
          score[at(skin_.hinges[i].vertex_a)] += skin_.hinges[i].length;
          score[at(skin_.hinges[i].vertex_b)] += skin_.hinges[i].length;
        }
        break;
      case SkinFault::Roughness:
        return largest(roughness_);
      case SkinFault::FarAway:
        return farthest_;
    }
    std::vector<double> buffer;
    smooth(skin_, 0.0, score, buffer);
    return largest(score);
  }

  JudgedSkin skin_;
  double volume_at_rest_ = 0.0;  ///< [m^3].
  Points x_, p_, normal_x_, normal_p_;
  Rotations turn_, rest_turn_, buffer_;  ///< from plain skinning and from rest to flesh.
  std::vector<double> roughness_, away_;
  std::vector<char> flipped_, torn_, creased_;
  int farthest_ = 0;
  SkinFrame frame_;
};

}  // namespace

struct SkinJudge::Impl {
  FrameMeasure frame;
  Eigen::Index num_input_vertices = 0;
};

SkinJudge::SkinJudge(const SkinJudgeInput& input) {
  const Eigen::Index n = input.rest.rows();
  if (!(input.height > 0.0))
    throw std::invalid_argument("height: got " + std::to_string(input.height) + ", expected a positive one");
  const bool same = std::all_of(input.plain.begin(), input.plain.end(),
                                [&](const Points& plain) { return plain.rows() == n; });
  if (input.flesh.size() != at(n) || !same)
    throw std::invalid_argument("skin to judge: expected " + std::to_string(n) +
                                " vertices in rest, flesh and plain skinning alike");
  if (input.triangles.size() > 0 && (input.triangles.minCoeff() < 0 || input.triangles.maxCoeff() >= n))
    throw std::invalid_argument("skin to judge: a triangle names a vertex outside of 0 ... " +
                                std::to_string(n - 1));
  impl_ = std::make_unique<Impl>(Impl{FrameMeasure(detail::judged_skin(input)), n});
}

SkinJudge::~SkinJudge() = default;
SkinJudge::SkinJudge(SkinJudge&&) noexcept = default;
SkinJudge& SkinJudge::operator=(SkinJudge&&) noexcept = default;

int SkinJudge::num_triangles() const { return impl_->frame.skin().num_triangles(); }

SkinFrame SkinJudge::measure(const Points& flesh, const Points& plain, FrameKind kind) {
  if (flesh.rows() != impl_->num_input_vertices || plain.rows() != impl_->num_input_vertices)
    throw std::invalid_argument("frame to judge: got " + std::to_string(flesh.rows()) + " and " +
                                std::to_string(plain.rows()) + " vertices, expected " +
                                std::to_string(impl_->num_input_vertices));
  return impl_->frame.measure(flesh, plain, kind);
}

}  // namespace sinew::fem
