#include "fem/body/limb_radius.h"

#include <algorithm>
#include <limits>

#include "fem/material/weighted_quantile.h"

namespace sinew::fem {
namespace {

/// A third of the area of the triangles round each vertex [m^2].
std::vector<double> vertex_areas(const lattice::Surface& skin) {
  std::vector<double> areas(static_cast<std::size_t>(skin.points.rows()), 0.0);
  for (Eigen::Index t = 0; t < skin.triangles.rows(); ++t) {
    const Eigen::RowVector3i v = skin.triangles.row(t);
    const Eigen::Vector3d a = skin.points.row(v[0]), b = skin.points.row(v[1]), c = skin.points.row(v[2]);
    const double third = (b - a).cross(c - a).norm() / 6.0;
    for (int k = 0; k < 3; ++k) areas[static_cast<std::size_t>(v[k])] += third;
  }
  return areas;
}

int dominant_frame(const std::vector<lattice::Influence>& influences, const FrameTree& tree) {
  std::vector<double> sums(static_cast<std::size_t>(tree.num_frames()), 0.0);
  int best = -1;
  for (const auto& influence : influences) {
    const int f = tree.frame_of_joint[static_cast<std::size_t>(influence.frame)];
    if (f < 0) continue;
    sums[static_cast<std::size_t>(f)] += influence.weight;
  }
  for (int f = 0; f < tree.num_frames(); ++f) {
    if (sums[static_cast<std::size_t>(f)] > (best < 0 ? 0.0 : sums[static_cast<std::size_t>(best)])) best = f;
  }
  return best;
}

}  // namespace

LimbRadii::LimbRadii(const lattice::ControlLattice& lattice, const FrameTree& tree,
                     const lattice::Surface& skin, double window, const lattice::MirrorMap* mirror)
    : bones_(lattice.bones.size()), window_(window) {
  const std::vector<double> areas = vertex_areas(skin);
  std::vector<std::vector<int>> bones_of_frame(static_cast<std::size_t>(tree.num_frames()));
  for (int b = 0; b < static_cast<int>(lattice.bones.size()); ++b) {
    const int f =
        tree.frame_of_joint[static_cast<std::size_t>(lattice.bones[static_cast<std::size_t>(b)].frame)];
    bones_of_frame[static_cast<std::size_t>(f)].push_back(b);
  }
  for (Eigen::Index k = 0; k < skin.points.rows(); ++k) {
    const int f = dominant_frame(skin.weights[static_cast<std::size_t>(k)], tree);
    if (f < 0) continue;
    const Eigen::Vector3d p = skin.points.row(k).transpose();
    // The nearest of the frame's bones; one whose segment the point projects onto is preferred by distance
    // alone.
    int nearest = -1;
    Sample sample{0.0, std::numeric_limits<double>::infinity(), areas[static_cast<std::size_t>(k)]};
    for (int b : bones_of_frame[static_cast<std::size_t>(f)]) {
      const auto& bone = lattice.bones[static_cast<std::size_t>(b)];
      const Eigen::Vector3d span = bone.rest_end - bone.rest_start;
      const double length = span.norm();
      const double along = length > 0.0 ? (p - bone.rest_start).dot(span) / length : 0.0;
      const double clamped = std::clamp(along, 0.0, length);
      const Eigen::Vector3d foot =
          length > 0.0 ? Eigen::Vector3d(bone.rest_start + span * (clamped / length)) : bone.rest_start;
      const double distance = (p - foot).norm();
      if (distance < sample.distance) {
        nearest = b;
        sample.distance = distance;
        sample.along = along;
      }
    }
    if (nearest < 0) continue;
    const auto& bone = lattice.bones[static_cast<std::size_t>(nearest)];
    const double length = (bone.rest_end - bone.rest_start).norm();
    if (sample.along < -window || sample.along > length + window) continue;
    bones_[static_cast<std::size_t>(nearest)].samples.push_back(sample);
  }
  if (mirror != nullptr) share(mirror->bones);
  for (std::size_t b = 0; b < bones_.size(); ++b) {
    std::vector<WeightedValue> values;
    for (const Sample& s : bones_[b].samples) values.push_back({s.distance, s.area});
    bones_[b].median = weighted_quantile(std::move(values), 0.5);
    if (!(bones_[b].median > 0.0)) {
      bones_[b].median = 0.1 * (lattice.bones[b].rest_end - lattice.bones[b].rest_start).norm();
    }
  }
}

/// Gives each bone the samples of its mirror image too. A sample on the plane is as near to one as to the
/// other, and triangles split in two ways give their corners other areas.
void LimbRadii::share(const std::vector<int>& partner) {
  for (std::size_t b = 0; b < bones_.size(); ++b) {
    const auto other = static_cast<std::size_t>(partner[b]);
    if (other <= b) continue;
    std::vector<Sample>& samples = bones_[b].samples;
    samples.insert(samples.end(), bones_[other].samples.begin(), bones_[other].samples.end());
    bones_[other].samples = samples;
  }
}

double LimbRadii::near(int bone, double along) const {
  std::vector<WeightedValue> values;
  for (const Sample& s : bones_[static_cast<std::size_t>(bone)].samples) {
    if (std::abs(s.along - along) <= window_) values.push_back({s.distance, s.area});
  }
  const double local = weighted_quantile(std::move(values), 0.5);
  return local > 0.0 ? local : of_bone(bone);
}

}  // namespace sinew::fem
