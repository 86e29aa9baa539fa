#include "lattice/limb_copies.h"

#include <algorithm>
#include <limits>
#include <map>

#include "lattice/detail/segments.h"

namespace sinew::lattice {

int skin_frame(const std::vector<Influence>& influences, const std::vector<int>& frame_of_joint) {
  std::map<int, double> weight;
  for (const Influence& influence : influences) {
    const int frame = frame_of_joint[static_cast<std::size_t>(influence.frame)];
    if (frame >= 0 && influence.weight > 0.0) weight[frame] += influence.weight;
  }
  int heaviest = -1;
  double largest = 0.0;
  for (const auto& [frame, sum] : weight)
    if (sum > largest) largest = sum, heaviest = frame;
  return heaviest;
}

LimbCopies::LimbCopies(const ControlLattice& lattice) : place_(lattice.complex.cells.size(), -1) {
  std::map<int, int> index;  // of a place by its name in the lattice
  for (const CellCopy& copy : lattice.copies) {
    const auto [found, fresh] = index.emplace(copy.place, static_cast<int>(places_.size()));
    if (fresh) places_.emplace_back();
    places_[static_cast<std::size_t>(found->second)].push_back({copy.cell, copy.frames});
    place_[static_cast<std::size_t>(copy.cell)] = found->second;
  }
  for (const LatticeBone& bone : lattice.bones)
    segments_.push_back({bone.frame, bone.rest_start, bone.rest_end});
  for (const SoftFrame& soft : lattice.soft_frames)
    segments_.push_back({soft.frame, soft.position, soft.position});
}

double LimbCopies::distance(const Copy& copy, const Eigen::Vector3d& p) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& segment : segments_)
    if (std::binary_search(copy.frames.begin(), copy.frames.end(), segment.frame))
      nearest = std::min(nearest, detail::point_segment_distance(p, segment.start, segment.end));
  return nearest;
}

int LimbCopies::own_copy(int cell, int frame, const Eigen::Vector3d& p) const {
  const int place = place_[static_cast<std::size_t>(cell)];
  if (place < 0) return cell;
  const std::vector<Copy>& copies = places_[static_cast<std::size_t>(place)];
  for (const Copy& copy : copies)
    if (std::binary_search(copy.frames.begin(), copy.frames.end(), frame)) return copy.cell;
  const auto nearer = [&](const Copy& a, const Copy& b) { return distance(a, p) < distance(b, p); };
  return std::min_element(copies.begin(), copies.end(), nearer)->cell;
}

}  // namespace sinew::lattice
