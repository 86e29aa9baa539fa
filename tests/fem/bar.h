#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>

#include "fem/body/body.h"
#include "fem/linear/factor.h"
#include "lattice/box.h"

/// A bar of box cells: plain flesh, one region, no ties, full cells; its answers are known.
namespace sinew::tests {

struct BarOptions {
  /// The bar of ../shared/reference: 1 x 0.2 x 0.2 m.
  lattice::BoxOptions box{{0.0, -0.1, -0.1}, {1.0, 0.1, 0.1}, {5, 1, 1}, lattice::CellType::Hexahedron, {}};
  int levels = 1;  ///< all functions up to this level; hexahedral leaf cells are 2^levels times the blocks.
  fem::Material material{1e5, 0.3, 1000.0};
  fem::Damping damping{0.0, 1.0};
  bool clamped = true;  ///< the face x = min as bone vertices of the one frame.
  /// Rest points that are bone vertices instead; empty: as `clamped` says.
  std::function<bool(const Eigen::Vector3d&)> held;
  /// Moves the vertices of the box before anything else; empty: they stay.
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> distort;
  /// Changes the active set; the hierarchy has one level more than `levels` then.
  std::function<void(const lattice::Hierarchy&, lattice::ActiveSet&)> refine;
  /// Fill of the Gauss point at x; full where empty.
  std::function<double(const Eigen::Vector3d&)> fill;
  /// None: answers for cells that are partly filled are those of their flesh alone.
  fem::GhostPenalty ghost{0.0, 0.0};
};

/// Rayleigh damping C = alpha M + beta K as a ratio at a frequency.
inline fem::Damping rayleigh(double alpha, double beta) {
  return {std::sqrt(alpha * beta), std::sqrt(alpha / beta) / (2.0 * M_PI)};
}

inline fem::Flesh bar_flesh(const BarOptions& options) {
  fem::PlainFlesh plain;
  plain.cells = lattice::box_lattice(options.box);
  for (Eigen::Index a = 0; options.distort && a < plain.cells.points.rows(); ++a) {
    plain.cells.points.row(a) = options.distort(plain.cells.points.row(a).transpose()).transpose();
  }
  plain.edge_length =
      (options.box.max - options.box.min).cwiseQuotient(options.box.blocks.cast<double>()).maxCoeff();
  plain.levels = options.levels + (options.refine ? 1 : 0);
  plain.frame.joint = 0;
  plain.frame.direction_rest = {1, 0, 0};
  plain.frame.length = options.box.max[0] - options.box.min[0];
  plain.frame.name = "base";
  plain.material = options.material;
  plain.damping = options.damping;
  plain.ghost = options.ghost;
  plain.fill = options.fill;
  plain.held = options.held;
  if (!options.held && options.clamped)
    plain.held = [x_min = options.box.min[0]](const Eigen::Vector3d& x) { return x[0] <= x_min + 1e-9; };
  return fem::make_flesh(plain);
}

inline fem::Body bar_body(const BarOptions& options) {
  const auto flesh = std::make_shared<const fem::Flesh>(bar_flesh(options));
  lattice::ActiveSet active = fem::uniform_set(*flesh, options.levels);
  if (options.refine) options.refine(flesh->hierarchy, active);
  return fem::make_body(flesh, active);
}

/// Leaf vertex at rest point x.
inline int vertex_at(const fem::Body& body, const Eigen::Vector3d& x) {
  Eigen::Index nearest = 0;
  const double distance = (body.mesh.points.rowwise() - x.transpose()).rowwise().norm().minCoeff(&nearest);
  if (distance > 1e-9) throw std::logic_error("no leaf vertex there");
  return static_cast<int>(nearest);
}

/// K and M of the functions that no bone holds, dof 3 f + c.
struct FreeSystem {
  std::vector<int> functions;  ///< free ones.
  Eigen::SparseMatrix<double> stiffness, mass;
  Eigen::SparseMatrix<double> basis;  ///< leaf values from free coefficients, per component.
};

inline Eigen::SparseMatrix<double> picked(const Eigen::SparseMatrix<double>& m,
                                          const std::vector<int>& functions) {
  Eigen::SparseMatrix<double> pick(m.cols(), 3 * static_cast<Eigen::Index>(functions.size()));
  for (std::size_t f = 0; f < functions.size(); ++f) {
    for (int c = 0; c < 3; ++c) pick.insert(3 * functions[f] + c, 3 * static_cast<Eigen::Index>(f) + c) = 1.0;
  }
  return pick.transpose() * (m * pick);
}

/// K, ties in it, and M of the leaf vertices' values, dof 3 i + c of the i-th vertex that is not held. Unlike
/// the functions of two levels these are as many as cut cells have.
inline FreeSystem nodal_system(const fem::LeafMatrices& of, const std::vector<std::uint8_t>& held) {
  std::vector<int> row(held.size(), -1);
  int count = 0;
  for (std::size_t a = 0; a < held.size(); ++a)
    if (!held[a]) row[a] = count++;
  std::vector<Eigen::Triplet<double>> stiffness, mass;
  for (int a = 0; a < of.num_vertices(); ++a)
    for (int e = of.row_start[a]; e < of.row_start[a + 1]; ++e) {
      const int i = row[a], k = row[of.column[e]];
      for (int c = 0; i >= 0 && k >= 0 && c < 3; ++c) {
        mass.emplace_back(3 * i + c, 3 * k + c, of.mass[e]);
        for (int d = 0; d < 3; ++d)
          stiffness.emplace_back(3 * i + c, 3 * k + d, of.stiffness[e](c, d) + (c == d ? of.tie[e] : 0.0));
      }
    }
  FreeSystem s;
  for (Eigen::SparseMatrix<double>* matrix : {&s.stiffness, &s.mass}) matrix->resize(3 * count, 3 * count);
  s.stiffness.setFromTriplets(stiffness.begin(), stiffness.end());
  s.mass.setFromTriplets(mass.begin(), mass.end());
  return s;
}

inline FreeSystem free_system(const fem::Body& body) {
  FreeSystem s;
  for (int f = 0; f < body.mesh.num_functions(); ++f) {
    const int leaf =
        body.mesh.leaf_of_vertex[static_cast<std::size_t>(body.mesh.functions[static_cast<std::size_t>(f)])];
    if (!body.bones.is_bone[static_cast<std::size_t>(leaf)]) s.functions.push_back(f);
  }
  s.stiffness = picked(fem::function_stiffness(body.matrices, body.mesh), s.functions);
  s.mass = picked(fem::function_mass(body.matrices, body.mesh), s.functions);
  Eigen::SparseMatrix<double> pick(body.mesh.num_functions(), static_cast<Eigen::Index>(s.functions.size()));
  for (std::size_t f = 0; f < s.functions.size(); ++f)
    pick.insert(s.functions[f], static_cast<Eigen::Index>(f)) = 1.0;
  s.basis = body.mesh.values_from_coefficients * pick;
  return s;
}

/// Coefficient vector of nodal forces, and leaf values of a coefficient vector.
inline Eigen::VectorXd restricted(const FreeSystem& s, const lattice::Points& force) {
  const lattice::Points rows = s.basis.transpose() * force;
  return Eigen::Map<const Eigen::VectorXd>(rows.data(), rows.size());
}
inline lattice::Points leaf_values(const FreeSystem& s, const Eigen::VectorXd& coefficients) {
  return s.basis * Eigen::Map<const lattice::Points>(coefficients.data(), coefficients.size() / 3, 3);
}

inline lattice::Points gravity_force(const fem::Body& body, const Eigen::Vector3d& gravity) {
  return Eigen::Map<const Eigen::VectorXd>(body.vertex_mass.data(), body.mesh.num_vertices()) *
         gravity.transpose();
}

/// Static displacement of the leaf vertices under nodal forces; bone vertices do not move.
inline lattice::Points static_displacement(const fem::Body& body, const lattice::Points& force) {
  const FreeSystem s = free_system(body);
  fem::Factor factor;
  if (!factor.factorise(s.stiffness).ok)
    throw std::logic_error("the bar's stiffness is not positive definite");
  Eigen::VectorXd x = restricted(s, force), workspace;
  factor.solve(x, workspace);
  return leaf_values(s, x);
}

/// Tip displacement along z of the bar under its weight, gravity 9.81 m/s^2 along -z.
inline double tip_sag(const fem::Body& body) {
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  const lattice::Points u = static_displacement(body, gravity_force(body, gravity));
  return u(vertex_at(body, {1.0, 0.0, 0.0}), 2);
}

/// The `count` lowest natural frequencies [Hz] by subspace iteration on (K + shift M)^-1 M; shift > 0 for a
/// body that nothing holds.
inline std::vector<double> natural_frequencies(const FreeSystem& s, int count, double shift) {
  fem::Factor factor;
  const Eigen::SparseMatrix<double> shifted = s.stiffness + shift * s.mass;
  if (!factor.factorise(shifted).ok) throw std::logic_error("the shifted stiffness is not positive definite");
  const Eigen::Index n = s.mass.rows(), block = count + 10;
  Eigen::MatrixXd x(n, block);
  std::uint64_t seed = 1;  // any start that is not deficient; the same every time
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    x.data()[i] = static_cast<double>(seed >> 11) * 0x1p-53 - 0.5;
  }
  Eigen::VectorXd workspace, previous = Eigen::VectorXd::Zero(count), values;
  for (int iteration = 0; iteration < 200; ++iteration) {
    x = s.mass * x;
    for (Eigen::Index k = 0; k < block; ++k) {
      Eigen::VectorXd column = x.col(k);
      factor.solve(column, workspace);
      x.col(k) = column;
    }
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(x.transpose() * (shifted * x),
                                                                         x.transpose() * (s.mass * x));
    x = x * ritz.eigenvectors();
    values = ritz.eigenvalues().head(count);
    if ((values - previous).cwiseAbs().maxCoeff() < 1e-9 * values.maxCoeff()) break;
    previous = values;
  }
  std::vector<double> frequencies;
  for (double value : values) frequencies.push_back(std::sqrt(std::max(0.0, value - shift)) / (2.0 * M_PI));
  return frequencies;
}

inline std::vector<double> natural_frequencies(const fem::Body& body, int count, double shift = 0.0) {
  return natural_frequencies(free_system(body), count, shift);
}

}  // namespace sinew::tests
