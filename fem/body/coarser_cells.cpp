#include "fem/body/coarser_cells.h"

#include <algorithm>

#include "fem/body/cell_matrices.h"

namespace sinew::fem {
namespace {

/// Gauss weights of a cell that is full [m^3].
std::array<double, 8> full_weights(const lattice::HexCorners& corners) {
  lattice::FillFractions full;
  full.fill(1.0);
  return gauss_weights(corners, full);
}

}  // namespace

lattice::FillFractions coarser_fill(const lattice::HexCorners& corners,
                                    const std::array<lattice::HexCorners, 8>& children,
                                    const std::array<lattice::FillFractions, 8>& fill) {
  lattice::FillFractions result{};
  double wanted = 0.0;  // flesh of the children [m^3]
  for (std::size_t k = 0; k < 8; ++k) {
    const auto all = [&](double f) {
      return std::all_of(fill[k].begin(), fill[k].end(), [&](double own) { return own == f; });
    };
    const std::array<double, 8> weights = full_weights(children[k]);
    double flesh = 0.0, volume = 0.0;
    for (std::size_t q = 0; q < 8; ++q) {
      flesh += weights[q] * fill[k][q];
      volume += weights[q];
    }
    wanted += flesh;
    result[k] = all(fill[k][0]) ? fill[k][0] : std::clamp(flesh / volume, 0.0, 1.0);
  }
  if (std::all_of(result.begin(), result.end(), [&](double f) { return f == result[0]; }) &&
      (result[0] == 0.0 || result[0] == 1.0))
    return result;
  const std::array<double, 8> weights = full_weights(corners);
  double flesh = 0.0, volume = 0.0;
  for (std::size_t q = 0; q < 8; ++q) {
    flesh += weights[q] * result[q];
    volume += weights[q];
  }
  for (double& f : result)
    f = flesh >= wanted ? f * (wanted / flesh) : 1.0 - (1.0 - f) * ((volume - wanted) / (volume - flesh));
  return result;
}

Material coarser_material(const std::array<Material, 8>& materials, const std::array<double, 8>& volumes) {
  const auto as_first = [&](const Material& m) {
    return m.young == materials[0].young && m.poisson == materials[0].poisson &&
           m.density == materials[0].density;
  };
  if (std::all_of(materials.begin(), materials.end(), as_first)) return materials[0];
  double shear = 0.0, bulk = 0.0, mass = 0.0, volume = 0.0;
  for (std::size_t k = 0; k < 8; ++k) {
    shear += volumes[k] * materials[k].mu();
    bulk += volumes[k] * materials[k].bulk();
    mass += volumes[k] * materials[k].density;
    volume += volumes[k];
  }
  shear /= volume;
  bulk /= volume;
  return {9.0 * bulk * shear / (3.0 * bulk + shear),
          (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear)), mass / volume};
}

}  // namespace sinew::fem
