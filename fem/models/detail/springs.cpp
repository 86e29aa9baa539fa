#include "fem/models/detail/springs.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <tbb/parallel_for.h>

#include "fem/models/detail/newton_model.h"

namespace sinew::fem {
namespace {

using Mandel = Eigen::Matrix<double, 6, 1>;

/// n n^T in Mandel's notation.
Mandel dyad(const Eigen::Vector3d& n) {
  const double r = std::sqrt(2.0);
  Mandel m;
  m << n[0] * n[0], n[1] * n[1], n[2] * n[2], r * n[1] * n[2], r * n[2] * n[0], r * n[0] * n[1];
  return m;
}

/// min |matrix k - right|^2 with k >= 0 for a matrix of full column rank ([Lawson74, ch. 23], started from
/// the free minimum).
Eigen::VectorXd non_negative_fit(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  const Eigen::MatrixXd normal = matrix.transpose() * matrix;
  const Eigen::VectorXd pull = matrix.transpose() * right;
  const Eigen::Index n = normal.rows();
  std::vector<bool> is_free(static_cast<std::size_t>(n), true);
  Eigen::VectorXd k = Eigen::VectorXd::Zero(n);
  for (Eigen::Index round = 0; round < 10 * n; ++round) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (is_free[static_cast<std::size_t>(i)]) free.push_back(i);
    }
    k.setZero();
    const Eigen::MatrixXd part = normal(free, free);
    const Eigen::VectorXd pulled = pull(free), solution = part.llt().solve(pulled);
    k(free) = solution;
    bool negative = false;
    for (Eigen::Index i : free) {
      if (k[i] >= 0.0) continue;
      is_free[static_cast<std::size_t>(i)] = false;
      negative = true;
    }
    if (negative) continue;
    // All non-negative: done unless one that is held at zero would rather grow.
    const Eigen::VectorXd gain = pull - normal * k;
    Eigen::Index best = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (is_free[static_cast<std::size_t>(i)] || gain[i] <= 1e-9 * pull.cwiseAbs().maxCoeff()) continue;
      if (best < 0 || gain[i] > gain[best]) best = i;
    }
    if (best < 0) return k;
    is_free[static_cast<std::size_t>(best)] = true;
  }
  return k.cwiseMax(0.0);
}

class SpringEnergy final : public CellEnergy {
 public:
  explicit SpringEnergy(const Body& body) : body_(body), springs_(body.mesh.cells.size()) {
    tbb::parallel_for(std::size_t{0}, springs_.size(), [&](std::size_t c) {
      double volume = 0.0;
      for (double w : gauss_weights(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]))
        volume += w;
      springs_[c] =
          matched_springs(cell_points(body.mesh.points, body.mesh.cells[c]), volume, body.materials[c].young);
    });
  }

  void set_damping(double rate, std::span<const PastPlace> past) override {
    rate_ = rate;
    if (rate == 0.0) return;
    past_.resize(springs_.size());
    tbb::parallel_for(std::size_t{0}, springs_.size(), [&](std::size_t c) {
      past_[c].assign(springs_[c].size(), 0.0);
      for (const PastPlace& p : past) {
        const CellPoints x = cell_points(*p.x, body_.mesh.cells[c]);
        for (std::size_t s = 0; s < past_[c].size(); ++s)
          past_[c][s] += p.share * (x.col(springs_[c][s].b) - x.col(springs_[c][s].a)).norm();
      }
    });
  }

  double energy(int cell, const CellPoints& x) const override {
    double sum = 0.0;
    each(cell, x, [&](const Spring& s, const Eigen::Vector3d&, double length, double past) {
      const double stretch = length - s.length, change = length - past;
      sum += 0.5 * s.stiffness * (stretch * stretch + rate_ * change * change);
    });
    return sum;
  }

  CellVector gradient(int cell, const CellPoints& x) const override {
    CellVector g = CellVector::Zero();
    each(cell, x, [&](const Spring& s, const Eigen::Vector3d& n, double length, double past) {
      const Eigen::Vector3d force = tension(s, length, past) * n;
      g.segment<3>(3 * s.b) += force;
      g.segment<3>(3 * s.a) -= force;
    });
    return g;
  }

  CellStiffness hessian(int cell, const CellPoints& x) const override { return hessian(cell, x, false); }
  CellStiffness semidefinite_hessian(int cell, const CellPoints& x) const override {
    return hessian(cell, x, true);
  }

 private:
  double tension(const Spring& s, double length, double past) const {
    return s.stiffness * (length - s.length + rate_ * (length - past));
  }

  template <class Action>
  void each(int cell, const CellPoints& x, const Action& action) const {
    const auto c = static_cast<std::size_t>(cell);
    for (std::size_t k = 0; k < springs_[c].size(); ++k) {
      const Spring& s = springs_[c][k];
      const Eigen::Vector3d span = x.col(s.b) - x.col(s.a);
      const double length = span.norm();
      // A spring without length pulls nowhere.
      const Eigen::Vector3d n =
          length > 1e-12 * s.length ? Eigen::Vector3d(span / length) : Eigen::Vector3d::Zero();
      action(s, n, length, rate_ > 0.0 ? past_[c][k] : 0.0);
    }
  }

  /// `semidefinite`: pressed springs buckle; their negative stiffness across is left out.
  CellStiffness hessian(int cell, const CellPoints& x, bool semidefinite) const {
    CellStiffness h = CellStiffness::Zero();
    each(cell, x, [&](const Spring& s, const Eigen::Vector3d& n, double length, double past) {
      double across = length > 1e-12 * s.length ? tension(s, length, past) / length : 0.0;
      if (semidefinite) across = std::max(0.0, across);
      Eigen::Matrix3d block = ((1.0 + rate_) * s.stiffness - across) * n * n.transpose();
      block.diagonal().array() += across;
      h.block<3, 3>(3 * s.a, 3 * s.a) += block;
      h.block<3, 3>(3 * s.b, 3 * s.b) += block;
      h.block<3, 3>(3 * s.a, 3 * s.b) -= block;
      h.block<3, 3>(3 * s.b, 3 * s.a) -= block;
    });
    return h;
  }

  const Body& body_;
  std::vector<std::vector<Spring>> springs_;
  std::vector<std::vector<double>> past_;  ///< lengths of the past.
  double rate_ = 0.0;
};

}  // namespace

std::vector<Spring> matched_springs(const CellPoints& x, double volume, double young) {
  std::vector<Spring> springs;
  // Share of E V / L^2 that is exact in a cube: edges lie in four cells, face diagonals in two.
  std::vector<double> cube;
  for (int a = 0; a < 8; ++a) {
    for (int b = a + 1; b < 8; ++b) {
      int steps = 0;
      for (std::size_t c = 0; c < 3; ++c)
        steps += lattice::kCorners[static_cast<std::size_t>(a)][c] !=
                 lattice::kCorners[static_cast<std::size_t>(b)][c];
      springs.push_back({a, b, (x.col(b) - x.col(a)).norm(), 0.0});
      cube.push_back(steps == 1 ? 0.1 : steps == 2 ? 0.4 : 0.0);
    }
  }
  // Isotropic tensor with E = 1 and nu = 1/4: lambda = mu = 2/5.
  Eigen::Matrix<double, 6, 6> target = 0.8 * Eigen::Matrix<double, 6, 6>::Identity();
  target.topLeftCorner<3, 3>().array() += 0.4;
  // Many fits of 28 springs are equally good: the one nearest to the cube's is taken, by a weight that moves
  // the fit itself by a millionth.
  constexpr double kNear = 1e-3;
  const auto n = static_cast<Eigen::Index>(springs.size());
  Eigen::MatrixXd matrix(36 + n, n);
  Eigen::VectorXd right(36 + n);
  right.head<36>() = target.reshaped();
  matrix.bottomRows(n) = kNear * Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index s = 0; s < n; ++s) {
    const Spring& spring = springs[static_cast<std::size_t>(s)];
    const Mandel m = dyad((x.col(spring.b) - x.col(spring.a)) / spring.length);
    const Eigen::Matrix<double, 6, 6> outer = m * m.transpose();
    matrix.col(s).head<36>() = outer.reshaped();
    right[36 + s] = kNear * cube[static_cast<std::size_t>(s)];
  }
  const Eigen::VectorXd share = non_negative_fit(matrix, right);
  for (Eigen::Index s = 0; s < n; ++s) {
    Spring& spring = springs[static_cast<std::size_t>(s)];
    spring.stiffness = share[s] * young * volume / (spring.length * spring.length);
  }
  double stiffest = 0.0;
  for (const Spring& s : springs) stiffest = std::max(stiffest, s.stiffness);
  std::erase_if(springs, [&](const Spring& s) { return s.stiffness <= 1e-9 * stiffest; });
  return springs;
}

std::unique_ptr<CellEnergy> spring_cells(const Body& body) { return std::make_unique<SpringEnergy>(body); }

std::unique_ptr<Model> make_springs(const Body& body, const SolverOptions&) {
  return make_newton_model("springs", body, spring_cells(body));
}

}  // namespace sinew::fem
