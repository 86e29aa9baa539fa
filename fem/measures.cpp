#include "fem/measures.h"

#include <algorithm>
#include <limits>
#include <vector>

#include <Eigen/SVD>
#include <tbb/parallel_for.h>

namespace sinew::fem {
namespace {

struct CellMeasure {
  double strain = 0.0;
  double det = std::numeric_limits<double>::infinity();
  double energy = 0.0;
};

CellMeasure measure_cell(const Body& body, std::size_t c, const lattice::Points& x,
                         const Eigen::Matrix3d& rotation) {
  CellMeasure out;
  const lattice::HexCorners rest = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]);
  const lattice::HexCorners posed = lattice::hex_corners(x, body.mesh.cells[c]);
  const Eigen::RowVector3d centre = posed.colwise().mean(), rest_centre = rest.colwise().mean();
  for (int q = 0; q < 8; ++q) {
    const Eigen::Vector3d xi = gauss_point(q);
    const Eigen::Matrix3d gradient =
        lattice::trilinear_jacobian(posed, xi) * lattice::trilinear_jacobian(rest, xi).inverse();  // F
    out.det = std::min(out.det, gradient.determinant());
    if (body.fill[c][static_cast<std::size_t>(q)] < 0.5)
      continue;  // an empty octant carries no flesh to strain
    const Eigen::Vector3d stretch = Eigen::JacobiSVD<Eigen::Matrix3d>(gradient).singularValues();
    out.strain = std::max({out.strain, std::abs(stretch[0] - 1.0), std::abs(stretch[2] - 1.0)});
  }
  Eigen::Matrix<double, 24, 1> u;
  for (int k = 0; k < 8; ++k) {
    u.segment<3>(3 * k) =
        rotation.transpose() * (posed.row(k) - centre).transpose() - (rest.row(k) - rest_centre).transpose();
  }
  out.energy = 0.5 * u.dot(cell_stiffness(rest, body.fill[c], body.materials[c]) * u);
  return out;
}

/// Weight-blended rotation of a cell's frames.
Eigen::Matrix3d cell_rotation(const Body& body, std::size_t c, const PosedFrames& posed) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int a : body.mesh.cells[c]) {
    for (FrameWeights::InnerIterator it(body.weights, a); it; ++it) {
      sum += it.value() * posed.frames[static_cast<std::size_t>(it.col())].rotation;
    }
  }
  return polar_rotation(sum);
}

}  // namespace

Measures measure(const Body& body, const lattice::Points& x, const lattice::Points& v,
                 const PosedFrames& posed, const Eigen::Vector3d& gravity) {
  Measures m;
  std::vector<CellMeasure> cells(body.mesh.cells.size());
  tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t c) {
    cells[c] = measure_cell(body, c, x, cell_rotation(body, c, posed));
  });
  m.min_det = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < cells.size(); ++c) {
    m.elastic += cells[c].energy;
    m.largest_strain = std::max(m.largest_strain, cells[c].strain);
    if (cells[c].det < m.min_det) {
      m.min_det = cells[c].det;
      m.min_det_cell = static_cast<int>(c);
    }
    if (cells[c].det <= 0.0) ++m.inverted_cells;
  }
  m.kinetic = 0.5 * v.cwiseProduct(apply_mass(body.matrices, v)).sum();
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    m.potential -= body.vertex_mass[static_cast<std::size_t>(a)] *
                   gravity.dot((x.row(a) - body.mesh.points.row(a)).transpose());
    m.largest_speed = std::max(m.largest_speed, v.row(a).norm());
  }
  for (const BoneVertex& bone : body.bones.vertices) {
    const double distance = (x.row(bone.vertex).transpose() - bone_position(bone, posed.joints)).norm();
    m.bone_residual = std::max(m.bone_residual, distance);
  }
  return m;
}

}  // namespace sinew::fem
