#include "adapt/deformation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace sinew::adapt {
namespace {

/// Largest |principal stretch - 1| at the centre of a leaf cell.
double centre_strain(const fem::Body& body, const lattice::Points& x, std::size_t cell) {
  const Eigen::Vector3d centre(0.5, 0.5, 0.5);
  const auto rest = lattice::hex_corners(body.mesh.points, body.mesh.cells[cell]);
  const auto posed = lattice::hex_corners(x, body.mesh.cells[cell]);
  const Eigen::Matrix3d gradient =
      lattice::trilinear_jacobian(posed, centre) * lattice::trilinear_jacobian(rest, centre).inverse();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> squares;
  squares.computeDirect(gradient.transpose() * gradient, Eigen::EigenvaluesOnly);
  return (squares.eigenvalues().cwiseMax(0.0).cwiseSqrt().array() - 1.0).abs().maxCoeff();
}

}  // namespace

std::vector<double> deformation_magnitudes(const fem::Body& body, const lattice::Points& x) {
  const lattice::LeafMesh& mesh = body.mesh;
  if (x.rows() != mesh.num_vertices()) {
    throw std::invalid_argument("deformation_magnitudes: got " + std::to_string(x.rows()) +
                                " positions, expected " + std::to_string(mesh.num_vertices()));
  }
  // Largest strain of the leaf cells round each vertex, then over the vertices on which a hat does not
  // vanish.
  std::vector<double> at_vertex(static_cast<std::size_t>(mesh.num_vertices()), 0.0);
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const double strain = centre_strain(body, x, c);
    for (int a : mesh.cells[c])
      at_vertex[static_cast<std::size_t>(a)] = std::max(at_vertex[static_cast<std::size_t>(a)], strain);
  }
  std::vector<double> magnitudes(static_cast<std::size_t>(mesh.num_functions()), 0.0);
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(mesh.values_from_coefficients, a); it;
         ++it) {
      auto& magnitude = magnitudes[static_cast<std::size_t>(it.col())];
      magnitude = std::max(magnitude, at_vertex[static_cast<std::size_t>(a)]);
    }
  }
  for (int f = 0; f < mesh.num_functions(); ++f) {
    const int vertex = mesh.functions[static_cast<std::size_t>(f)];
    const int level = body.hierarchy.level(vertex);
    if (level == 0) continue;
    const auto parents = body.hierarchy.parents(vertex);
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    for (int p : parents) mean += x.row(mesh.leaf_of_vertex[static_cast<std::size_t>(p)]);
    mean /= static_cast<double>(parents.size());
    const Eigen::RowVector3d detail = x.row(mesh.leaf_of_vertex[static_cast<std::size_t>(vertex)]) - mean;
    magnitudes[static_cast<std::size_t>(f)] = detail.norm() / (body.lattice.edge_length * std::exp2(-level));
  }
  return magnitudes;
}

}  // namespace sinew::adapt
