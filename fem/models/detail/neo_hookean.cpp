#include "fem/models/detail/neo_hookean.h"

#include <cmath>

#include "fem/models/detail/green_strain.h"
#include "fem/models/detail/newton_model.h"

namespace sinew::fem {
namespace {

Eigen::Matrix3d cofactor(const Eigen::Matrix3d& f) {
  Eigen::Matrix3d c;
  c.col(0) = f.col(1).cross(f.col(2));
  c.col(1) = f.col(2).cross(f.col(0));
  c.col(2) = f.col(0).cross(f.col(1));
  return c;
}

/// F, J and cof F at the Gauss points, and the mean of J.
struct Kinematics {
  std::array<Eigen::Matrix3d, 8> f, cofactor;
  std::array<double, 8> j{};
  double mean_j = 0.0;

  Kinematics(const CellGeometry& geometry, const CellPoints& x) {
    for (std::size_t q = 0; q < 8; ++q) {
      f[q] = x * geometry.gradients[q];
      cofactor[q] = fem::cofactor(f[q]);
      j[q] = f[q].col(0).dot(cofactor[q].col(0));
      mean_j += geometry.weights[q] * j[q] / geometry.volume;
    }
  }
  /// d psi / d J at Gauss point q, the mean's part included.
  double pressure(const Material& m, std::size_t q) const {
    return -m.mu() + m.mu() / 3.0 * (j[q] - 1.0) + m.bulk() * (mean_j - 1.0);
  }
};

class NeoHookean final : public CellEnergy {
 public:
  explicit NeoHookean(const Body& body) : viscosity_(body, 0.0) {}

  void set_damping(double rate, std::span<const PastPlace> past) override {
    viscosity_.set_damping(rate, past);
  }
  double energy(int cell, const CellPoints& x) const override {
    const double viscous = viscosity_.damped() ? viscosity_.energy(cell, x) : 0.0;
    return neo_hookean_energy(viscosity_.geometry(cell), viscosity_.material(cell), x) + viscous;
  }
  CellVector gradient(int cell, const CellPoints& x) const override {
    CellVector g = neo_hookean_gradient(viscosity_.geometry(cell), viscosity_.material(cell), x);
    if (viscosity_.damped()) g += viscosity_.gradient(cell, x);
    return g;
  }
  CellStiffness hessian(int cell, const CellPoints& x) const override {
    CellStiffness h = viscosity_.damped() ? viscosity_.hessian(cell, x) : CellStiffness::Zero().eval();
    add_neo_hookean_hessian(viscosity_.geometry(cell), viscosity_.material(cell), x, h);
    return h;
  }

 private:
  GreenStrainEnergy viscosity_;
};

}  // namespace

double neo_hookean_energy(const CellGeometry& geometry, const Material& m, const CellPoints& x) {
  const Kinematics k(geometry, x);
  double energy = 0.5 * m.bulk() * geometry.volume * (k.mean_j - 1.0) * (k.mean_j - 1.0);
  for (std::size_t q = 0; q < 8; ++q) {
    const double j = k.j[q] - 1.0;
    energy += geometry.weights[q] * m.mu() * (0.5 * (k.f[q].squaredNorm() - 3.0) - j + j * j / 6.0);
  }
  return energy;
}

CellVector neo_hookean_gradient(const CellGeometry& geometry, const Material& m, const CellPoints& x) {
  const Kinematics k(geometry, x);
  CellPoints sum = CellPoints::Zero();
  for (std::size_t q = 0; q < 8; ++q) {
    const Eigen::Matrix3d first_piola = m.mu() * k.f[q] + k.pressure(m, q) * k.cofactor[q];
    sum += geometry.weights[q] * first_piola * geometry.gradients[q].transpose();
  }
  return Eigen::Map<const CellVector>(sum.data());
}

void add_neo_hookean_hessian(const CellGeometry& geometry, const Material& m, const CellPoints& x,
                             CellStiffness& hessian) {
  const Kinematics k(geometry, x);
  // dJ/dx of the Gauss points and of the mean: rank-one parts.
  Eigen::Matrix<double, 9, 24> rows;
  Eigen::Matrix<double, 1, 24> mean = Eigen::Matrix<double, 1, 24>::Zero();
  Eigen::Matrix<double, 8, 8> laplacian = Eigen::Matrix<double, 8, 8>::Zero();
  for (std::size_t q = 0; q < 8; ++q) {
    const double w = geometry.weights[q];
    const lattice::HexGradients& g = geometry.gradients[q];
    const CellPoints slope = k.cofactor[q] * g.transpose();
    const Eigen::Map<const Eigen::Matrix<double, 1, 24>> row(slope.data());
    rows.row(static_cast<Eigen::Index>(q)) = std::sqrt(m.mu() / 3.0 * w) * row;
    mean += w * row;
    laplacian.noalias() += (w * m.mu()) * g * g.transpose();
    // d^2 J / dx_a dx_b = -[F (g_a x g_b)]_x: antisymmetric in a and b as well, so the whole is symmetric.
    const double s = w * k.pressure(m, q);
    for (int b = 0; b < 8; ++b) {
      for (int a = 0; a < b; ++a) {
        const Eigen::Vector3d ga = g.row(a).transpose(), gb = g.row(b).transpose();
        const Eigen::Vector3d v = s * (k.f[q] * ga.cross(gb));
        hessian(3 * a, 3 * b + 1) += v[2];
        hessian(3 * a + 1, 3 * b) -= v[2];
        hessian(3 * a + 1, 3 * b + 2) += v[0];
        hessian(3 * a + 2, 3 * b + 1) -= v[0];
        hessian(3 * a + 2, 3 * b) += v[1];
        hessian(3 * a, 3 * b + 2) -= v[1];
        hessian(3 * b + 1, 3 * a) += v[2];
        hessian(3 * b, 3 * a + 1) -= v[2];
        hessian(3 * b + 2, 3 * a + 1) += v[0];
        hessian(3 * b + 1, 3 * a + 2) -= v[0];
        hessian(3 * b, 3 * a + 2) += v[1];
        hessian(3 * b + 2, 3 * a) -= v[1];
      }
    }
  }
  rows.row(8) = std::sqrt(m.bulk() / geometry.volume) * mean;
  hessian.noalias() += rows.transpose() * rows;
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 8; ++a) hessian.block<3, 3>(3 * a, 3 * b).diagonal().array() += laplacian(a, b);
  }
}

std::unique_ptr<CellEnergy> neo_hookean_cells(const Body& body) { return std::make_unique<NeoHookean>(body); }

std::unique_ptr<Model> make_neo_hookean(const Body& body, const SolverOptions&) {
  return make_newton_model("neo-hookean", body, neo_hookean_cells(body));
}

}  // namespace sinew::fem
