#pragma once

#include <numbers>

#include "fem/models/cell_energy.h"

/// The energy of a cell that is quadratic in the Green strain E = (F^T F - I)/2, with the mean dilatation of
/// fem/body/cell_matrices.h, so that it equals B-bar's at small strain:
///   Q(E) = sum_q w_q mu |dev E_q|^2 + kappa_b V/2 (sum_q w_q tr E_q / V)^2.
/// For a homogeneous strain that is St. Venant-Kirchhoff's lambda/2 tr(E)^2 + mu tr(E^2). With a strain of
/// the past it is an objective viscosity as well.
namespace sinew::fem {

/// One strain per Gauss point, in Mandel's notation: xx, yy, zz, sqrt(2) times yz, zx, xy; the dot product of
/// two columns is that of the tensors.
using GaussStrains = Eigen::Matrix<double, 6, 8>;

GaussStrains green_strains(const CellGeometry& geometry, const CellPoints& x);

/// elastic Q(E) + damping Q(E - past).
struct GreenLaw {
  double mu = 0.0, bulk = 0.0;               ///< [Pa].
  double elastic = 1.0;                      ///< [-].
  double damping = 0.0;                      ///< [-]: stiffness damping beta over the stage's kappa h.
  GaussStrains past = GaussStrains::Zero();  ///< read where damping > 0.
};

double green_energy(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x);
/// d energy / d x.
CellVector green_gradient(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x);
/// Adds d^2 energy / d x^2.
void add_green_hessian(const CellGeometry& geometry, const GreenLaw& law, const CellPoints& x,
                       CellStiffness& hessian);

/// The law on the cells of a body: StVK's energy, or with `elastic` 0 the viscosity alone.
class GreenStrainEnergy final : public CellEnergy {
 public:
  GreenStrainEnergy(const Body& body, double elastic);

  void set_damping(double rate, std::span<const PastPlace> past) override;
  double energy(int cell, const CellPoints& x) const override;
  CellVector gradient(int cell, const CellPoints& x) const override;
  CellStiffness hessian(int cell, const CellPoints& x) const override;

  /// A bar pressed to 1/sqrt(3) of its length presses back no harder: P = E s (s^2 - 1) / 2 is least there.
  double least_stretch() const override { return elastic_ > 0.0 ? 1.0 / std::numbers::sqrt3 : 0.0; }

  bool damped() const { return rate_ > 0.0; }
  const CellGeometry& geometry(int cell) const { return geometry_[static_cast<std::size_t>(cell)]; }
  const Material& material(int cell) const { return body_.materials[static_cast<std::size_t>(cell)]; }

 private:
  GreenLaw law(int cell) const;

  const Body& body_;
  double elastic_ = 1.0, rate_ = 0.0;
  std::vector<CellGeometry> geometry_;
  std::vector<GaussStrains> past_;
};

}  // namespace sinew::fem
