#include "fem/models/detail/green_strain.h"

#include <cmath>

#include <tbb/parallel_for.h>

namespace sinew::fem {
namespace {

using Mandel = Eigen::Matrix<double, 6, 1>;
const double kRoot2 = std::sqrt(2.0);

Eigen::Matrix3d deformation_gradient(const CellGeometry& geometry, const CellPoints& x, int q) {
  return x * geometry.gradients[static_cast<std::size_t>(q)];
}

Mandel green_strain(const Eigen::Matrix3d& gradient) {
  const Eigen::Matrix3d c = gradient.transpose() * gradient;
  Mandel e;
  e << 0.5 * (c(0, 0) - 1.0), 0.5 * (c(1, 1) - 1.0), 0.5 * (c(2, 2) - 1.0), c(1, 2) / kRoot2,
      c(2, 0) / kRoot2, c(0, 1) / kRoot2;
  return e;
}

double trace(const Mandel& e) { return e.head<3>().sum(); }

Eigen::Matrix3d tensor(const Mandel& s) {
  Eigen::Matrix3d m;
  m << s[0], s[5] / kRoot2, s[4] / kRoot2,  //
      s[5] / kRoot2, s[1], s[3] / kRoot2,   //
      s[4] / kRoot2, s[3] / kRoot2, s[2];
  return m;
}

double quadratic(const CellGeometry& geometry, const GreenLaw& law, const GaussStrains& strains) {
  double energy = 0.0, dilatation = 0.0;
  for (int q = 0; q < 8; ++q) {
    const Mandel e = strains.col(q);
    const double w = geometry.weights[static_cast<std::size_t>(q)], t = trace(e);
    energy += w * law.mu * (e.squaredNorm() - t * t / 3.0);
    dilatation += w * t;
  }
  return energy + 0.5 * law.bulk * dilatation * dilatation / geometry.volume;
}

/// Second Piola-Kirchhoff stress per Gauss point, the derivative of the energy density by E; linear in E.
GaussStrains stresses(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x) {
  GaussStrains strains = (law.elastic + law.damping) * green_strains(geometry, x);
  if (law.damping > 0.0) strains -= law.damping * law.past;
  double mean = 0.0;
  for (int q = 0; q < 8; ++q)
    mean += geometry.weights[static_cast<std::size_t>(q)] * trace(strains.col(q)) / geometry.volume;
  for (int q = 0; q < 8; ++q) {
    const double t = trace(strains.col(q));
    strains.col(q) *= 2.0 * law.mu;
    strains.col(q).head<3>().array() += law.bulk * mean - 2.0 / 3.0 * law.mu * t;
  }
  return strains;
}

/// dE / dx at Gauss point q, 6 x 24, in Mandel's notation: dE = sym(F^T dx_a g_a^T).
Eigen::Matrix<double, 6, 24> strain_rows(const Eigen::Matrix3d& f, const lattice::HexGradients& g) {
  Eigen::Matrix<double, 6, 24> rows;
  const double r = 1.0 / kRoot2;
  for (int a = 0; a < 8; ++a) {
    for (int c = 0; c < 3; ++c) {
      const int dof = 3 * a + c;
      rows(0, dof) = f(c, 0) * g(a, 0);
      rows(1, dof) = f(c, 1) * g(a, 1);
      rows(2, dof) = f(c, 2) * g(a, 2);
      rows(3, dof) = r * (f(c, 1) * g(a, 2) + f(c, 2) * g(a, 1));
      rows(4, dof) = r * (f(c, 2) * g(a, 0) + f(c, 0) * g(a, 2));
      rows(5, dof) = r * (f(c, 0) * g(a, 1) + f(c, 1) * g(a, 0));
    }
  }
  return rows;
}

}  // namespace

GaussStrains green_strains(const CellGeometry& geometry, const CellPoints& x) {
  GaussStrains strains;
  for (int q = 0; q < 8; ++q) strains.col(q) = green_strain(deformation_gradient(geometry, x, q));
  return strains;
}

double green_energy(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x) {
  const GaussStrains strains = green_strains(geometry, x);
  double energy = law.elastic * quadratic(geometry, law, strains);
  if (law.damping > 0.0) energy += law.damping * quadratic(geometry, law, strains - law.past);
  return energy;
}

CellVector green_gradient(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x) {
  const GaussStrains s = stresses(geometry, law, x);
  CellPoints sum = CellPoints::Zero();
  for (int q = 0; q < 8; ++q) {
    const auto i = static_cast<std::size_t>(q);
    const Eigen::Matrix3d first_piola = deformation_gradient(geometry, x, q) * tensor(s.col(q));
    sum += geometry.weights[i] * first_piola * geometry.gradients[i].transpose();
  }
  return Eigen::Map<const CellVector>(sum.data());
}

void add_green_hessian(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x,
                       CellStiffness& hessian) {
  const GaussStrains s = stresses(geometry, law, x);
  const double scale = law.elastic + law.damping;
  // Rows whose squares sum up to the material part: six per Gauss point; the traces are subtracted after.
  Eigen::Matrix<double, 48, 24> rows;
  Eigen::Matrix<double, 8, 24> traces;
  Eigen::Matrix<double, 1, 24> mean = Eigen::Matrix<double, 1, 24>::Zero();
  Eigen::Matrix<double, 8, 8> geometric = Eigen::Matrix<double, 8, 8>::Zero();
  for (int q = 0; q < 8; ++q) {
    const auto i = static_cast<std::size_t>(q);
    const double w = geometry.weights[i];
    const lattice::HexGradients& g = geometry.gradients[i];
    const Eigen::Matrix<double, 6, 24> b = strain_rows(deformation_gradient(geometry, x, q), g);
    const Eigen::Matrix<double, 1, 24> t = b.topRows<3>().colwise().sum();
    rows.middleRows<6>(6 * q) = std::sqrt(2.0 * law.mu * scale * w) * b;
    traces.row(q) = std::sqrt(2.0 / 3.0 * law.mu * scale * w) * t;
    mean += w * t;
    geometric += w * (g * tensor(s.col(q)) * g.transpose());
  }
  hessian.noalias() += rows.transpose() * rows;
  hessian.noalias() -= traces.transpose() * traces;
  hessian.noalias() += (law.bulk * scale / geometry.volume) * mean.transpose() * mean;
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 8; ++a) hessian.block<3, 3>(3 * a, 3 * b).diagonal().array() += geometric(a, b);
  }
}

GreenStrainEnergy::GreenStrainEnergy(const Body& body, double elastic) : body_(body), elastic_(elastic) {
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    geometry_.push_back(
        cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]));
  }
}

void GreenStrainEnergy::set_damping(double rate, std::span<const PastPlace> past) {
  rate_ = rate;
  if (rate == 0.0) return;
  past_.resize(geometry_.size());
  tbb::parallel_for(std::size_t{0}, past_.size(), [&](std::size_t c) {
    past_[c].setZero();
    for (const PastPlace& p : past)
      past_[c] += p.share * green_strains(geometry_[c], cell_points(*p.x, body_.mesh.cells[c]));
  });
}

GreenLaw GreenStrainEnergy::law(int cell) const {
  GreenLaw law{material(cell).mu(), material(cell).bulk(), elastic_, rate_, {}};
  if (rate_ > 0.0) law.past = past_[static_cast<std::size_t>(cell)];
  return law;
}

double GreenStrainEnergy::energy(int cell, const CellPoints& x) const {
  return green_energy(geometry(cell), law(cell), x);
}
CellVector GreenStrainEnergy::gradient(int cell, const CellPoints& x) const {
  return green_gradient(geometry(cell), law(cell), x);
}
CellStiffness GreenStrainEnergy::hessian(int cell, const CellPoints& x) const {
  CellStiffness h = CellStiffness::Zero();
  add_green_hessian(geometry(cell), law(cell), x, h);
  return h;
}

}  // namespace sinew::fem
