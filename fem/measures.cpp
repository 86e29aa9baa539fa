#include "fem/measures.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <tbb/parallel_for.h>

#include "fem/growth.h"

namespace sinew::fem {
namespace {

/// Octants filled less hold hardly any flesh to strain or to turn inside out.
constexpr double kFleshy = 0.5;

struct CellMeasure {
  double strain = 0.0;
  double det = std::numeric_limits<double>::infinity();
  double energy = 0.0;
};

/// Largest |principal stretch - 1| of F.
double stretch_strain(const Eigen::Matrix3d& gradient) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> squares;
  squares.computeDirect(gradient.transpose() * gradient,
                        Eigen::EigenvaluesOnly);  // to about 1e-8: ample for a report
  const Eigen::Vector3d stretches = squares.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return (stretches.array() - 1.0).abs().maxCoeff();
}

/// Elastic energy by the formula behind cell_stiffness, from the gradients themselves: the linear strain of
/// R^T F at the Gauss points, with the mean dilatation.
CellMeasure measure_cell(const Body& body, std::size_t c, const lattice::Points& x,
                         const Eigen::Matrix3d& rotation, const lattice::Points* grown) {
  CellMeasure out;
  const lattice::HexCorners rest = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]);
  const lattice::HexCorners posed = lattice::hex_corners(x, body.mesh.cells[c]);
  const Material& material = body.materials[c];
  double volume = 0.0, dilatation = 0.0;
  for (int q = 0; q < 8; ++q) {
    const lattice::HexGradients gradients = lattice::trilinear_gradients(gauss_point(q));
    const Eigen::Matrix3d rest_jacobian = rest.transpose() * gradients;
    const Eigen::Matrix3d from_rest = posed.transpose() * gradients * rest_jacobian.inverse();
    Eigen::Matrix3d growth = Eigen::Matrix3d::Identity(),
                    gradient = from_rest;  // F, from what is free of strain
    if (grown != nullptr) {
      growth =
          lattice::hex_corners(*grown, body.mesh.cells[c]).transpose() * gradients * rest_jacobian.inverse();
      gradient = from_rest * growth.inverse();
    }
    out.det = std::min(out.det, gradient.determinant());
    const double fill = body.fill[c][static_cast<std::size_t>(q)];
    if (fill >= 0.5)
      out.strain = std::max(out.strain, stretch_strain(gradient));  // else hardly any flesh to strain
    const Eigen::Matrix3d turned = rotation.transpose() * from_rest;
    const Eigen::Matrix3d strain = 0.5 * (turned + turned.transpose()) - 0.5 * (growth + growth.transpose());
    const double weight = rest_jacobian.determinant() / 8.0 * (fill + kEmptyShare * (1.0 - fill));
    const double trace = strain.trace();
    out.energy += weight * material.mu() * (strain.squaredNorm() - trace * trace / 3.0);
    volume += weight;
    dilatation += weight * trace;
  }
  out.energy += 0.5 * material.bulk() * dilatation * dilatation / volume;
  return out;
}

/// 1/2 sum_b (x - T_b X)^T P_b (x - T_b X), of which only the sum of the P_b and every P_b T_b X are known;
/// places are counted from the first tie's centre, so that far from the origin no digits are lost.
double tie_energy(const Body& body, const lattice::Points& x, const PosedFrames& posed,
                  const Growth* growth) {
  const Eigen::Vector3d origin =
      tie_target(body, body.ties.front(), posed, growth) * body.ties.front().centre_rest;
  const lattice::Points from = x.rowwise() - origin.transpose();
  double energy = 0.5 * from.cwiseProduct(apply_tie(body.matrices, from)).sum();
  for (const Tie& tie : body.ties) {
    const Eigen::Affine3d map = tie_target(body, tie, posed, growth);
    const Eigen::Vector3d centre = map * tie.centre_rest - origin;
    for (std::size_t k = 0; k < tie.vertices.size(); ++k) {
      const Eigen::Vector3d pull = map.linear() * tie.first[k] + tie.zeroth[k] * centre,
                            arm = body.mesh.points.row(tie.vertices[k]).transpose() - tie.centre_rest,
                            target = map.linear() * arm + centre;
      energy += pull.dot(0.5 * target - from.row(tie.vertices[k]).transpose());
    }
  }
  return energy;
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
  std::optional<Growth> grown;
  if (body.grows) grown = growth(body, posed);
  tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t c) {
    cells[c] = measure_cell(body, c, x, cell_rotation(body, c, posed), grown ? &grown->shape : nullptr);
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
  if (!body.ties.empty()) m.ties = tie_energy(body, x, posed, grown ? &*grown : nullptr);
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
