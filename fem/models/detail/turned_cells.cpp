#include "fem/models/detail/turned_cells.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "fem/body/frames.h"
#include "fem/models/detail/collapse.h"

namespace sinew::fem::detail {
namespace {

constexpr int kCells = CellGroups::kCells;
using Vector = Double4[CellGroups::kDofs];  ///< of a group.
using Matrix = Double4[3][3];               ///< row, column.

SINEW_INLINE void load_rotations(const CellGroups& groups, int group,
                                 const std::vector<Eigen::Matrix3d>& rotations, Matrix& r) {
  const double* of[kCells];
  for (int lane = 0; lane < kCells; ++lane)
    of[lane] = rotations[static_cast<std::size_t>(groups.cell(group, lane))].data();
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      const int at = 3 * j + i;
      r[i][j] = Double4{of[0][at], of[1][at], of[2][at], of[3][at]};
    }
  }
}

/// Adds share x to u, x relative to the first corners.
SINEW_INLINE void add(const int* vertices, const double* x, double share, Vector& u) {
  Double4 first[3];
  for (int k = 0; k < 8; ++k, vertices += kCells) {
    const double *a = x + 3 * std::ptrdiff_t{vertices[0]}, *b = x + 3 * std::ptrdiff_t{vertices[1]},
                 *c = x + 3 * std::ptrdiff_t{vertices[2]}, *d = x + 3 * std::ptrdiff_t{vertices[3]};
    for (int i = 0; i < 3; ++i) {
      const Double4 at{a[i], b[i], c[i], d[i]};
      if (k == 0) first[i] = at;
      u[3 * k + i] += share * (at - first[i]);
    }
  }
}

/// Adds share R^T x to u.
SINEW_INLINE void add_turned(const int* vertices, const double* x, double share, const Matrix& r, Vector& u) {
  Vector p = {};
  add(vertices, x, share, p);
  for (int k = 0; k < CellGroups::kDofs; k += 3) {
    for (int j = 0; j < 3; ++j) u[k + j] += (r[0][j] * p[k] + r[1][j] * p[k + 1]) + r[2][j] * p[k + 2];
  }
}

/// y = K u from the upper blocks.
SINEW_INLINE void multiply(const double* block, const Vector& u, Vector& y) {
  Double4 k;
  for (int a = 0; a < CellGroups::kDofs; a += 3) {
    Double4 sum[3] = {y[a], y[a + 1], y[a + 2]};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j, block += kCells) {
        load(block, k);
        sum[i] += k * u[a + j];
      }
    }
    for (int b = a + 3; b < CellGroups::kDofs; b += 3) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j, block += kCells) {
          load(block, k);
          sum[i] += k * u[b + j];
          y[b + j] += k * u[a + i];
        }
      }
    }
    for (int i = 0; i < 3; ++i) y[a + i] = sum[i];
  }
}

/// result = R y.
SINEW_INLINE void store_turned(const Matrix& r, const Vector& y, double* result) {
  for (int k = 0; k < CellGroups::kDofs; k += 3) {
    for (int i = 0; i < 3; ++i, result += kCells)
      store((r[i][0] * y[k] + r[i][1] * y[k + 1]) + r[i][2] * y[k + 2], result);
  }
}

SINEW_INLINE void add_places(const CellGroups& groups, int group, std::span<const TurnedPlace> places,
                             Vector& u) {
  const int* vertices = groups.vertices(group);
  Matrix r = {};
  for (const TurnedPlace& place : places) {
    if (place.rotations == nullptr) {
      add(vertices, place.x->data(), place.share, u);
      continue;
    }
    load_rotations(groups, group, *place.rotations, r);
    add_turned(vertices, place.x->data(), place.share, r, u);
  }
}

struct Kernel {
  const CellGroups& groups;
  const std::vector<Eigen::Matrix3d>& rotations;
  std::span<const TurnedPlace> places;

  SINEW_INLINE void run(int group, const double* stiffness, double* result) const {
    Vector u = {}, y = {};
    Matrix r;
    add_places(groups, group, places, u);
    multiply(stiffness, u, y);
    load_rotations(groups, group, rotations, r);
    store_turned(r, y, result);
  }
  SINEW_WIDE_LANES static void run_wide(const Kernel& k, int group, const double* stiffness, double* result) {
    k.run(group, stiffness, result);
  }
  static void run_any(const Kernel& k, int group, const double* stiffness, double* result) {
    k.run(group, stiffness, result);
  }
};

/// k_i - p x G_i for k in `forces`, with the spin p = (tr(S) I - S)^-1 sum_i y_i x k_i of S = sum_i y_i
/// G_i^T. All of it is the same for y that is too long by `share`. Returns what is at most `slim` where the
/// least two stretches sum to kCollapse.
SINEW_INLINE void take_spin(const Vector& y, const double* mean, double share, Vector& forces, double* slim) {
  Double4 torque[3] = {}, s[3][3] = {}, g[3];
  for (int k = 0; k < CellGroups::kDofs; k += 3) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3;
      load(mean + (k + i) * kCells, g[i]);
      torque[i] += y[k + j] * forces[k + l] - y[k + l] * forces[k + j];
      for (int m = 0; m < 3; ++m) s[m][i] += y[k + m] * g[i];
    }
  }
  Double4 a[3], b[3], cofactor[3][3];  // diagonal of tr(S) I - S, and off it the entry of the other two axes
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, l = (i + 2) % 3;
    a[i] = s[j][j] + s[l][l];
    b[i] = -0.5 * (s[j][l] + s[l][j]);
  }
  Double4 size = {};
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, l = (i + 2) % 3;
    cofactor[i][i] = a[j] * a[l] - b[i] * b[i];
    cofactor[j][l] = cofactor[l][j] = b[j] * b[l] - a[i] * b[i];
    size += a[i] * a[i] + 2.0 * (b[i] * b[i]);
  }
  const Double4 det = (a[0] * cofactor[0][0] + b[2] * cofactor[0][1]) + b[1] * cofactor[0][2];
  const Double4 minors = (cofactor[0][0] + cofactor[1][1]) + cofactor[2][2];
  const Double4 scale = det / (det * det + (kLeastTurn * kLeastTurn) * (size * size * size));
  Double4 spin[3];
  for (int i = 0; i < 3; ++i)
    spin[i] =
        scale * ((cofactor[i][0] * torque[0] + cofactor[i][1] * torque[1]) + cofactor[i][2] * torque[2]);
  for (int k = 0; k < CellGroups::kDofs; k += 3) {
    for (int i = 0; i < 3; ++i) load(mean + (k + i) * kCells, g[i]);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, l = (i + 2) % 3;
      forces[k + i] -= spin[j] * g[l] - spin[l] * g[j];
    }
  }
  store(det - (share * kCollapse) * minors, slim);
}

struct PolarKernel {
  const CellGroups& groups;
  std::span<const TurnedPlace> places;

  SINEW_INLINE void run(int group, const double* stiffness, const double* mean, double* result,
                        double* slim) const {
    Vector y = {}, u = {}, forces = {};
    Matrix r = {};
    add_places(groups, group, places.first(1), y);
    add_places(groups, group, places.subspan(1), u);
    for (int k = 0; k < CellGroups::kDofs; ++k) u[k] += y[k];
    multiply(stiffness, u, forces);
    take_spin(y, mean, places[0].share, forces, slim);
    load_rotations(groups, group, *places[0].rotations, r);
    store_turned(r, forces, result);
  }
  SINEW_WIDE_LANES static void run_wide(const PolarKernel& k, int group, const double* stiffness,
                                        const double* mean, double* result, double* slim) {
    k.run(group, stiffness, mean, result, slim);
  }
  static void run_any(const PolarKernel& k, int group, const double* stiffness, const double* mean,
                      double* result, double* slim) {
    k.run(group, stiffness, mean, result, slim);
  }
};

/// Polar rotations by Newton's iteration M <- (M + M^-T) / 2 ([Higham86]): a few products where a singular
/// value decomposition takes hundreds. `done` where it arrived; cells near collapse do not.
struct Polar {
  SINEW_INLINE static void run(Double4 (&m)[9], std::array<bool, kCells>& done) {
    constexpr double kFlat = 1e-4;     // of a cube of the norm: below, the first steps are wasted
    constexpr double kSettled = 1e-8;  // its square, the next change, is below rounding
    constexpr int kMost = 30;
    Double4 change = {};
    bool is_flat[kCells] = {};
    for (int n = 0; n < kMost; ++n) {
      Double4 cofactor[9], square = {};
      for (int j = 0; j < 3; ++j) {
        const Double4 *a = m + (3 * j + 3) % 9, *b = m + (3 * j + 6) % 9;
        for (int i = 0; i < 3; ++i)
          cofactor[3 * j + i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
      }
      const Double4 det = (m[0] * cofactor[0] + m[1] * cofactor[1]) + m[2] * cofactor[2];
      if (n == 0) {
        for (const Double4& entry : m) square += entry * entry;
        for (int lane = 0; lane < kCells; ++lane) {
          const double s = square[lane], d = det[lane];
          is_flat[lane] = !(d > 0.0 && d * d > kFlat * kFlat * s * s * s);
        }
      }
      const Double4 half = 0.5 / det;
      change = Double4{};
      for (int e = 0; e < 9; ++e) {
        const Double4 next = 0.5 * m[e] + half * cofactor[e], step = next - m[e];
        change += step * step;
        m[e] = next;
      }
      bool all = true;
      for (int lane = 0; lane < kCells; ++lane) {
        done[static_cast<std::size_t>(lane)] = !is_flat[lane] && change[lane] < kSettled * kSettled;
        all = all && (is_flat[lane] || done[static_cast<std::size_t>(lane)]);
      }
      if (all) return;
    }
  }
  SINEW_WIDE_LANES static void run_wide(Double4 (&m)[9], std::array<bool, kCells>& done) { run(m, done); }
  static void run_any(Double4 (&m)[9], std::array<bool, kCells>& done) { run(m, done); }
};

void polar_group(std::span<Eigen::Matrix3d> matrices, Code code) {
  const auto at = [&](int lane) -> Eigen::Matrix3d& {
    return matrices[std::min(static_cast<std::size_t>(lane), matrices.size() - 1)];
  };
  Double4 m[9];
  for (int e = 0; e < 9; ++e)
    m[e] = Double4{at(0).data()[e], at(1).data()[e], at(2).data()[e], at(3).data()[e]};
  std::array<bool, kCells> done{};
  code == Code::Wide ? Polar::run_wide(m, done) : Polar::run_any(m, done);
  for (int lane = 0; lane < static_cast<int>(matrices.size()); ++lane) {
    if (!done[static_cast<std::size_t>(lane)]) {
      at(lane) = polar_rotation(at(lane));
      continue;
    }
    for (int e = 0; e < 9; ++e) at(lane).data()[e] = m[e][lane];
  }
}

}  // namespace

void TurnedCells::set(int cell, const CellStiffness& stiffness) {
  double* to = values_.data() + kGroupSize * static_cast<std::size_t>(cell / kCells) + cell % kCells;
  for (int a = 0; a < 24; a += 3) {
    for (int b = a; b < 24; b += 3) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j, to += kCells) *to = stiffness(a + i, b + j);
      }
    }
  }
}

CellStiffness TurnedCells::stiffness(int cell) const {
  const double* from = values_.data() + kGroupSize * static_cast<std::size_t>(cell / kCells) + cell % kCells;
  CellStiffness k;
  for (int a = 0; a < 24; a += 3) {
    for (int b = a; b < 24; b += 3) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j, from += kCells) k(a + i, b + j) = k(b + j, a + i) = *from;
      }
    }
  }
  return k;
}

void TurnedCells::forces(const std::vector<Eigen::Matrix3d>& rotations, std::span<const TurnedPlace> places,
                         std::vector<double>& result, Code code) const {
  result.resize(groups_.vector_size());
  const Kernel kernel{groups_, rotations, places};
  tbb::parallel_for(tbb::blocked_range<int>(0, groups_.num_groups(), 16),
                    [&](const tbb::blocked_range<int>& range) {
                      for (int g = range.begin(); g != range.end(); ++g) {
                        const double* stiffness = values_.data() + kGroupSize * static_cast<std::size_t>(g);
                        double* to = result.data() + CellGroups::vector_of(g);
                        code == Code::Wide ? Kernel::run_wide(kernel, g, stiffness, to)
                                           : Kernel::run_any(kernel, g, stiffness, to);
                      }
                    });
}

void TurnedCells::polar_forces(const std::vector<double>& mean, std::span<const TurnedPlace> places,
                               std::vector<double>& result, std::vector<char>& slim, Code code) const {
  result.resize(groups_.vector_size());
  slim.resize(static_cast<std::size_t>(groups_.num_cells()));
  const PolarKernel kernel{groups_, places};
  tbb::parallel_for(tbb::blocked_range<int>(0, groups_.num_groups(), 16),
                    [&](const tbb::blocked_range<int>& range) {
                      for (int g = range.begin(); g != range.end(); ++g) {
                        const double* stiffness = values_.data() + kGroupSize * static_cast<std::size_t>(g);
                        const double* of_group = mean.data() + CellGroups::vector_of(g);
                        double* to = result.data() + CellGroups::vector_of(g);
                        double over[kCells];
                        code == Code::Wide ? PolarKernel::run_wide(kernel, g, stiffness, of_group, to, over)
                                           : PolarKernel::run_any(kernel, g, stiffness, of_group, to, over);
                        for (int lane = 0; lane < kCells && kCells * g + lane < groups_.num_cells(); ++lane)
                          slim[static_cast<std::size_t>(kCells * g + lane)] = !(over[lane] > 0.0);
                      }
                    });
}

std::vector<double> packed(const CellGroups& groups, std::span<const lattice::HexGradients> cells) {
  std::vector<double> result;
  result.reserve(groups.vector_size());
  for (int g = 0; g < groups.num_groups(); ++g) {
    for (int dof = 0; dof < CellGroups::kDofs; ++dof) {
      for (int lane = 0; lane < kCells; ++lane)
        result.push_back(cells[static_cast<std::size_t>(groups.cell(g, lane))](dof / 3, dof % 3));
    }
  }
  return result;
}

void polar_rotations(std::span<Eigen::Matrix3d> matrices, Code code) {
  const std::size_t groups = (matrices.size() + kCells - 1) / kCells;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups, 16), [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t g = range.begin(); g != range.end(); ++g)
          polar_group(
              matrices.subspan(kCells * g, std::min<std::size_t>(kCells, matrices.size() - kCells * g)),
              code);
      });
}

}  // namespace sinew::fem::detail
