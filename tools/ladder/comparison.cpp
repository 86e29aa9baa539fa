#include "tools/ladder/comparison.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::tools {
namespace {

using assets::InputError;
using assets::Result;
using lattice::Points;

/// Rest positions are stored as floats, in units and axes that may differ: 1e-6 of the size is eight
/// roundings.
constexpr double kSameRest = 1e-6;

void check_same_rest(const Result& a, const Result& b) {
  if (a.rest().rows() == 0 || b.rest().rows() == 0) return;
  Eigen::Index vertex = 0;
  const double apart = (a.rest() - b.rest()).rowwise().norm().maxCoeff(&vertex);
  const double size = a.rest().cwiseAbs().maxCoeff();
  if (apart > kSameRest * size) {
    throw InputError(
        b.path(), fmt::format("rest shape: vertex {} lies {:.3g} m from where {} has it, expected the same "
                              "mesh; hint: compare results of one rig, with the same --output-mesh",
                              vertex, apart, a.path()));
  }
}

void check_comparable(const Result& a, const Result& b) {
  if (a.num_points() != b.num_points()) {
    throw InputError(b.path(),
                     fmt::format("vertices: got {}, expected {} as in {}; hint: compare results of one rig",
                                 b.num_points(), a.num_points(), a.path()));
  }
  check_same_rest(a, b);
  if (a.fps() > 0.0 && b.fps() > 0.0 && a.fps() != b.fps()) {
    throw InputError(
        b.path(), fmt::format("frames per second: got {:g}, expected {:g} as in {}; hint: run both with the "
                              "same --fps",
                              b.fps(), a.fps(), a.path()));
  }
}

}  // namespace

FrameDifference difference(int frame, const Points& a, const Points& b) {
  FrameDifference d;
  d.frame = frame;
  const Eigen::VectorXd squares = (a - b).rowwise().squaredNorm();
  Eigen::Index vertex = 0;
  d.largest = std::sqrt(squares.maxCoeff(&vertex));
  d.vertex = static_cast<int>(vertex);
  d.rms = std::sqrt(squares.mean());
  return d;
}

Comparison compare(const Result& a, const Result& b) {
  check_comparable(a, b);
  const int first = std::max(a.first_frame(), b.first_frame());
  const int end = std::min(a.first_frame() + a.num_frames(), b.first_frame() + b.num_frames());
  if (first >= end) {
    throw InputError(b.path(), fmt::format("frames: got {} to {}, expected some of {} to {} as in {}",
                                           b.first_frame(), b.first_frame() + b.num_frames() - 1,
                                           a.first_frame(), a.first_frame() + a.num_frames() - 1, a.path()));
  }
  Comparison result;
  result.height = a.height();
  result.frame = first;
  double squares = 0.0;
  for (int k = first; k < end; ++k) {
    const FrameDifference d = difference(k, a.frame(k), b.frame(k));
    squares += d.rms * d.rms;
    if (d.largest > result.largest) {
      result.largest = d.largest;
      result.vertex = d.vertex;
      result.frame = k;
    }
    result.frames.push_back(d);
  }
  result.rms = std::sqrt(squares / (end - first));
  return result;
}

}  // namespace sinew::tools
