#include "fem/report/measures.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <tbb/parallel_for.h>

namespace sinew::fem {
namespace {

/// Octants filled less hold hardly any flesh to strain or to turn inside out.
constexpr double kFleshy = 0.5;
/// Smallest det of growth over that of the mean stretch cubed: between a joint that a clip scales and one
/// that it does not the grown shape may be flat or inside out, and no strain can be told from it.
constexpr double kLeastShape = 0.05;

bool has_shape(const Eigen::Matrix3d& growth) {
  return growth.determinant() >= kLeastShape * std::pow(growth.squaredNorm() / 3.0, 1.5);
}

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

/// A Gauss point of a cell.
struct PointMeasure {
  int index = 0;
  double rest_det = 0.0;      ///< of the rest Jacobian [m^3].
  Eigen::Matrix3d from_rest;  ///< dx/dX.
  Eigen::Matrix3d growth;     ///< of the shape that is free of strain, from the rest shape.
};

/// Calls use(PointMeasure) at the cell's Gauss points; `grown`: null where nothing grows.
template <class Use>
void for_gauss_points(const Body& body, std::size_t c, const lattice::Points& x, const lattice::Points* grown,
                      const Use& use) {
  const lattice::HexCorners rest = lattice::hex_corners(body.mesh.points, body.mesh.cells[c]);
  const lattice::HexCorners posed = lattice::hex_corners(x, body.mesh.cells[c]);
  for (int q = 0; q < 8; ++q) {
    const lattice::HexGradients gradients = lattice::trilinear_gradients(gauss_point(q));
    const Eigen::Matrix3d rest_jacobian = rest.transpose() * gradients, to_rest = rest_jacobian.inverse();
    Eigen::Matrix3d growth = Eigen::Matrix3d::Identity();
    if (grown != nullptr)
      growth = lattice::hex_corners(*grown, body.mesh.cells[c]).transpose() * gradients * to_rest;
    use(PointMeasure{q, rest_jacobian.determinant(), posed.transpose() * gradients * to_rest, growth});
  }
}

/// Elastic energy by the formula behind cell_stiffness, from the gradients themselves: the linear strain of
/// R^T F at the Gauss points, with the mean dilatation.
class CellEnergySum {
 public:
  void add(const PointMeasure& at, double fill, const Eigen::Matrix3d& rotation, double mu) {
    const Eigen::Matrix3d turned = rotation.transpose() * at.from_rest;
    const Eigen::Matrix3d strain =
        0.5 * (turned + turned.transpose()) - 0.5 * (at.growth + at.growth.transpose());
    const double weight = at.rest_det / 8.0 * (fill + kEmptyShare * (1.0 - fill));
    const double trace = strain.trace();
    shear_ += weight * mu * (strain.squaredNorm() - trace * trace / 3.0);
    volume_ += weight;
    dilatation_ += weight * trace;
  }
  double energy(double bulk) const { return shear_ + 0.5 * bulk * dilatation_ * dilatation_ / volume_; }

 private:
  double shear_ = 0.0, volume_ = 0.0, dilatation_ = 0.0;
};

CellMeasure measure_cell(const Body& body, std::size_t c, const lattice::Points& x,
                         const Eigen::Matrix3d& rotation, const lattice::Points* grown) {
  CellMeasure out;
  CellEnergySum sum;
  for_gauss_points(body, c, x, grown, [&](const PointMeasure& at) {
    Eigen::Matrix3d gradient = at.from_rest;  // F, from what is free of strain
    if (grown != nullptr) gradient *= at.growth.inverse();
    const double fill = body.fill[c][static_cast<std::size_t>(at.index)];
    if (fill >= kFleshy && has_shape(at.growth)) {
      out.det = std::min(out.det, gradient.determinant());
      out.strain = std::max(out.strain, stretch_strain(gradient));
    }
    sum.add(at, fill, rotation, body.materials[c].mu());
  });
  out.energy = sum.energy(body.materials[c].bulk());
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

/// 1/2 x^T S x, of what x is beside the grown shape where joints grow.
double ghost_energy(const Body& body, const lattice::Points& x, const PosedFrames& posed,
                    const Growth* growth) {
  const lattice::Points from = growth == nullptr ? lattice::Points(x.rowwise() - Eigen::RowVector3d(x.row(0)))
                                                 : lattice::Points(x - grown_places(body, posed, *growth));
  return 0.5 * from.cwiseProduct(apply_ghost(body.matrices, from)).sum();
}

/// -m g . x, relative to the rest pose's.
double potential_energy(const Body& body, const lattice::Points& x, const Eigen::Vector3d& gravity) {
  double energy = 0.0;
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    energy -= body.vertex_mass[static_cast<std::size_t>(a)] *
              gravity.dot((x.row(a) - body.mesh.points.row(a)).transpose());
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

double kinetic_energy(const Body& body, const lattice::Points& v) {
  return 0.5 * v.cwiseProduct(apply_mass(body.matrices, v)).sum();
}

StoredEnergy::StoredEnergy(const Body& body, const PosedFrames& posed, const Eigen::Vector3d& gravity)
    : body_(&body), posed_(posed), gravity_(gravity), rotations_(body.mesh.cells.size()) {
  if (body.grows) grown_ = growth(body, posed);
  tbb::parallel_for(std::size_t{0}, rotations_.size(),
                    [&](std::size_t c) { rotations_[c] = cell_rotation(body, c, posed); });
}

double StoredEnergy::of(const lattice::Points& x) const {
  const Body& body = *body_;
  std::vector<double> cells(rotations_.size());
  tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t c) {
    CellEnergySum sum;
    for_gauss_points(body, c, x, grown_ ? &grown_->shape : nullptr, [&](const PointMeasure& at) {
      sum.add(at, body.fill[c][static_cast<std::size_t>(at.index)], rotations_[c], body.materials[c].mu());
    });
    cells[c] = sum.energy(body.materials[c].bulk());
  });
  double energy = std::accumulate(cells.begin(), cells.end(), potential_energy(body, x, gravity_));
  const Growth* grown = grown_ ? &*grown_ : nullptr;
  if (!body.ties.empty()) energy += tie_energy(body, x, posed_, grown);
  return energy + ghost_energy(body, x, posed_, grown);
}

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
  m.ghost = ghost_energy(body, x, posed, grown ? &*grown : nullptr);
  m.kinetic = kinetic_energy(body, v);
  m.potential = potential_energy(body, x, gravity);
  m.largest_speed = v.rows() > 0 ? v.rowwise().norm().maxCoeff() : 0.0;
  for (const BoneVertex& bone : body.bones.vertices) {
    const double distance = (x.row(bone.vertex).transpose() - bone_position(bone, posed.joints)).norm();
    m.bone_residual = std::max(m.bone_residual, distance);
  }
  return m;
}

}  // namespace sinew::fem
