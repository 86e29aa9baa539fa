#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "lattice/build.h"

namespace sinew::lattice {
namespace {

constexpr double kSmallestFactor = 0.25, kLargestFactor = 4.0;

void require(bool holds, const char* field, auto value, const char* expected) {
  if (!holds) throw std::invalid_argument(fmt::format("{}: got {}, expected {}", field, value, expected));
}

void check_joint(const char* field, int joint, int num_joints) {
  if (joint < 0 || joint >= num_joints) {
    throw std::invalid_argument(
        fmt::format("{}: got joint {}, expected 0 ... {}", field, joint, num_joints - 1));
  }
}

}  // namespace

std::size_t estimated_build_bytes(int cells) {
  // Measured peaks of whole runs: 37 MB at 9922 cells, 100 MB at 39712.
  constexpr std::size_t kPerCell = 2000, kBase = 20'000'000;
  return kBase + kPerCell * static_cast<std::size_t>(cells);
}

void BuildOptions::validate() const {
  require(cells >= 20, "cells", cells, "at least 20");
  if (cell_size) {
    require(std::isfinite(*cell_size) && *cell_size > 0.0, "cell_size", *cell_size, "a length above 0 [m]");
  }
  std::set<int> sized;
  for (const SizeFactor& size : size_factors) {
    require(size.joint >= 0, "size_factors", size.joint, "the index of a joint");
    require(size.factor >= kSmallestFactor && size.factor <= kLargestFactor, "size_factors", size.factor,
            "a factor in [0.25, 4]");
    require(sized.insert(size.joint).second, "size_factors", size.joint, "every joint at most once");
  }
  for (const int joint : include) require(joint >= 0, "include", joint, "the index of a joint");
  for (const int joint : exclude) require(joint >= 0, "exclude", joint, "the index of a joint");
  require(max_retries >= 0, "max_retries", max_retries, "at least 0");
  require(min_dihedral_degrees >= 0.0 && min_dihedral_degrees < 70.0, "min_dihedral_degrees",
          min_dihedral_degrees, "a value in [0, 70)");
  require(min_scaled_jacobian >= 0.0 && min_scaled_jacobian < 0.7, "min_scaled_jacobian", min_scaled_jacobian,
          "a value in [0, 0.7)");
}

std::vector<bool> excluded_joints(const BuildOptions& options, int num_joints) {
  for (const SizeFactor& size : options.size_factors) check_joint("size_factors", size.joint, num_joints);
  std::vector<bool> excluded(num_joints, !options.include.empty());
  for (const int joint : options.include) {
    check_joint("include", joint, num_joints);
    excluded[joint] = false;
  }
  for (const int joint : options.exclude) {
    check_joint("exclude", joint, num_joints);
    excluded[joint] = true;
  }
  for (int joint = 0; joint < num_joints; ++joint)
    if (!excluded[joint]) return excluded;
  throw std::invalid_argument(fmt::format("exclude: all {} joints, expected at least one left", num_joints));
}

}  // namespace sinew::lattice
