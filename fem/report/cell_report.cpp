#include "fem/report/cell_report.h"

#include <cmath>

#include <Eigen/LU>
#include <tbb/parallel_for.h>

#include "fem/models/cell_energy.h"

namespace sinew::fem {

double von_mises(const Eigen::Matrix3d& stress) {
  const Eigen::Matrix3d deviator = stress - stress.trace() / 3.0 * Eigen::Matrix3d::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

std::vector<CellReport> report_cells(const Body& body, Model& model, const lattice::Points& x,
                                     const PosedFrames& pose) {
  const CellForces forces = model.cell_forces(x, pose);
  std::vector<CellReport> reports(body.mesh.cells.size());
  tbb::parallel_for(std::size_t{0}, reports.size(), [&](std::size_t c) {
    CellReport& report = reports[c];
    const CellGeometry geometry =
        cell_geometry(lattice::hex_corners(body.mesh.points, body.mesh.cells[c]), body.fill[c]);
    const CellPoints points = cell_points(x, body.mesh.cells[c]);
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    for (std::size_t q = 0; q < 8; ++q) {
      const Eigen::Matrix3d gradient = points * geometry.gradients[q];
      mean += geometry.weights[q] / geometry.volume * gradient;
      report.volume += geometry.weights[q] * gradient.determinant();
    }
    report.strain = 0.5 * (mean.transpose() * mean - Eigen::Matrix3d::Identity());
    report.energy = forces.energy[c];
    if (report.volume <= 0.0) return;
    const CellPoints force = Eigen::Map<const CellPoints>(forces.force[c].data());
    const Eigen::Matrix3d stress = force * points.transpose() / report.volume;
    // Forces without moment make it symmetric; rounding and rotations that lag behind do not.
    report.stress = 0.5 * (stress + stress.transpose());
    report.von_mises = von_mises(report.stress);
  });
  return reports;
}

}  // namespace sinew::fem
