#include "fem/models/detail/corotational_cells.h"

#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <tbb/parallel_for.h>

#include "fem/body/frames.h"
#include "fem/models/detail/collapse.h"
#include "fem/models/detail/rotated_stiffness.h"

namespace sinew::fem {
namespace {

using Rows = Eigen::Matrix<double, 3, 24>;  ///< of a vector that is linear in the corners.

/// [v] a = v x a.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0;
  return m;
}

class CorotationalCells final : public CellEnergy {
 public:
  explicit CorotationalCells(const Body& body)
      : body_(body), polar_(body), stiffness_(body), collapse_(collapse_moduli(body)) {}

  void set_damping(double rate, std::span<const PastPlace> past) override {
    rate_ = rate;
    if (rate == 0.0) return;
    past_.assign(body_.mesh.cells.size(), CellPoints::Zero());
    for (const PastPlace& place : past) {
      tbb::parallel_for(std::size_t{0}, past_.size(), [&](std::size_t c) {
        const CellPoints x = cell_points(*place.x, body_.mesh.cells[c]);
        past_[c] += place.share * polar_rotation(x * polar_.mean_gradient(c)).transpose() * x;
      });
    }
  }

  double energy(int cell, const CellPoints& x) const override {
    const Place at(*this, cell, x);
    double energy = 0.5 * at.strain.cwiseProduct(at.apply(at.strain)).sum();
    if (rate_ > 0.0) {
      const CellPoints change = at.y - past_[static_cast<std::size_t>(cell)];
      energy += 0.5 * rate_ * change.cwiseProduct(at.apply(change)).sum();
    }
    if (at.deformation.near_collapse())
      energy += collapse_[static_cast<std::size_t>(cell)] * collapse_energy(at.deformation);
    return energy;
  }

  CellVector gradient(int cell, const CellPoints& x) const override {
    const Place at(*this, cell, x);
    CellPoints forces = at.rotation * at.turned_forces();
    if (at.deformation.near_collapse())
      forces +=
          collapse_[static_cast<std::size_t>(cell)] * collapse_stress(at.deformation) * at.mean.transpose();
    return Eigen::Map<const CellVector>(forces.data());
  }

  CellStiffness hessian(int cell, const CellPoints& x) const override;

 private:
  /// A cell in the axes that turn with it.
  struct Place {
    PrincipalStretches deformation;
    Eigen::Matrix3d rotation, stretch;  ///< F = R S.
    CellPoints y, strain, k;            ///< R^T x, y - X, and the forces of K with the viscous ones.
    CellStiffness stiffness;
    const lattice::HexGradients& mean;  ///< G.
    Eigen::Matrix3d from_turn;          ///< A^-1.
    Eigen::Vector3d spin;               ///< p.

    Place(const CorotationalCells& cells, int cell, const CellPoints& x)
        : deformation(x * cells.polar_.mean_gradient(static_cast<std::size_t>(cell))),
          stiffness(cells.stiffness_.at_rest(cell)),
          mean(cells.polar_.mean_gradient(static_cast<std::size_t>(cell))) {
      const auto c = static_cast<std::size_t>(cell);
      rotation = deformation.rotation();
      y = rotation.transpose() * x;
      const Eigen::Matrix3d s = y * mean;
      stretch = 0.5 * (s + s.transpose());
      strain = y - cell_points(cells.body_.mesh.points, cells.body_.mesh.cells[c]);
      CellPoints sum = strain;
      if (cells.rate_ > 0.0) sum += cells.rate_ * (y - cells.past_[c]);
      k = apply(sum);
      from_turn = turn_compliance(stretch);
      Eigen::Vector3d torque = Eigen::Vector3d::Zero();
      for (int i = 0; i < 8; ++i) torque += y.col(i).cross(k.col(i));
      spin = from_turn * torque;
    }
    CellPoints apply(const CellPoints& u) const {
      const CellVector f = stiffness * Eigen::Map<const CellVector>(u.data());
      return Eigen::Map<const CellPoints>(f.data());
    }
    /// k_i - p x G_i.
    CellPoints turned_forces() const {
      CellPoints h;
      for (int i = 0; i < 8; ++i) h.col(i) = k.col(i) - spin.cross(mean.row(i).transpose());
      return h;
    }
  };

  const Body& body_;
  PolarRotations polar_;
  RotatedStiffness stiffness_;
  double rate_ = 0.0;
  std::vector<double> collapse_;  ///< bulk modulus times volume [J].
  std::vector<CellPoints> past_;  ///< sum of the shares of R^T x.
};

/// In turned axes, for a move z: w = W z, dy_i = z_i - w x y_i =: (P z)_i, and of the forces h = k - p x G
/// the change w x h_i + dk_i - dp x G_i with A dp = sum_i (dy_i x k_i + y_i x dk_i) - dA p.
CellStiffness CorotationalCells::hessian(int cell, const CellPoints& x) const {
  const Place at(*this, cell, x);
  const CellPoints h = at.turned_forces();
  const Eigen::Vector3d stretched = at.stretch * at.spin;
  Rows turn;  // W
  CellStiffness p = CellStiffness::Identity();
  for (int i = 0; i < 8; ++i)
    turn.middleCols<3>(3 * i) = at.from_turn * cross_matrix(at.mean.row(i).transpose());
  for (int i = 0; i < 8; ++i) p.middleRows<3>(3 * i) += cross_matrix(at.y.col(i)) * turn;

  Rows torque = Rows::Zero();  // sum_i dy_i x k_i - dA p; dA = tr(dS) I - dS, dS = sum_i z_i G_i^T - [w] S
  for (int i = 0; i < 8; ++i) torque -= cross_matrix(at.k.col(i)) * p.middleRows<3>(3 * i);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d g = at.mean.row(i).transpose();
    torque.middleCols<3>(3 * i) += g.dot(at.spin) * Eigen::Matrix3d::Identity() - at.spin * g.transpose();
  }
  torque += cross_matrix(stretched) * turn;

  CellStiffness result = (1.0 + rate_) * (p.transpose() * (at.stiffness * p));
  // sum_i G_i x of what dp is: W^T is minus what -dp x G_i makes of A dp.
  result -= turn.transpose() * torque;
  for (int i = 0; i < 8; ++i) result.middleRows<3>(3 * i) -= cross_matrix(h.col(i)) * turn;
  for (int i = 0; i < 8; ++i)
    result.middleRows<3>(3 * i) = (at.rotation * result.middleRows<3>(3 * i)).eval();
  for (int i = 0; i < 8; ++i)
    result.middleCols<3>(3 * i) = (result.middleCols<3>(3 * i) * at.rotation.transpose()).eval();
  if (at.deformation.near_collapse()) {
    const Eigen::Matrix<double, 9, 9> stress =
        collapse_[static_cast<std::size_t>(cell)] * collapse_hessian(at.deformation);
    Eigen::Matrix<double, 9, 24> slope = Eigen::Matrix<double, 9, 24>::Zero();  // of F by the corners
    for (int i = 0; i < 8; ++i) {
      for (int c = 0; c < 3; ++c) slope.block<3, 3>(3 * c, 3 * i).diagonal().setConstant(at.mean(i, c));
    }
    result += slope.transpose() * stress * slope;
  }
  return 0.5 * (result + result.transpose());
}

}  // namespace

std::unique_ptr<CellEnergy> corotational_cells(const Body& body) {
  return std::make_unique<CorotationalCells>(body);
}

}  // namespace sinew::fem
