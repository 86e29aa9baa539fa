#include "fem/forces/loads.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace sinew::fem {

using lattice::Points;

namespace {

void require_finite(const Eigen::Vector3d& v, const char* what) {
  if (!v.allFinite())
    throw std::invalid_argument(fmt::format("{}: got {:g}, expected finite numbers", what, v.sum()));
}

/// Integral of the bilinear weights times `density(normal dA)` over a face by 2 x 2 Gauss points; adds it to
/// `forces`. The normal's length is the area per unit square.
template <class Density>
void add_face(const BoundaryFace& face, const Points& x, const Density& density, Points& forces) {
  const double g = 0.5 / std::sqrt(3.0);
  for (double u : {0.5 - g, 0.5 + g}) {
    for (double v : {0.5 - g, 0.5 + g}) {
      const std::array<double, 4> weight{(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v};
      const std::array<double, 4> du{-(1 - v), 1 - v, v, -v}, dv{-(1 - u), -u, u, 1 - u};
      Eigen::Vector3d along_u = Eigen::Vector3d::Zero(), along_v = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < 4; ++k) {
        along_u += du[k] * x.row(face[k]).transpose();
        along_v += dv[k] * x.row(face[k]).transpose();
      }
      const Eigen::Vector3d force = 0.25 * density(along_u.cross(along_v).eval());
      for (std::size_t k = 0; k < 4; ++k) forces.row(face[k]) += weight[k] * force.transpose();
    }
  }
}

}  // namespace

std::vector<BoundaryFace> boundary_faces(const lattice::LeafMesh& mesh, const FaceSet& set) {
  // A face that one cell alone has is on the boundary.
  std::map<BoundaryFace, int> uses;
  std::vector<BoundaryFace> faces;
  const auto key_of = [](BoundaryFace face) {
    std::sort(face.begin(), face.end());
    return face;
  };
  for (const lattice::HexVertices& cell : mesh.cells) {
    for (const auto& corners : lattice::cell_faces(lattice::CellType::Hexahedron)) {
      BoundaryFace face;
      for (std::size_t k = 0; k < 4; ++k) face[k] = cell[static_cast<std::size_t>(corners[k])];
      ++uses[key_of(face)];
      faces.push_back(face);
    }
  }
  const auto outside = [&](int a) {
    const Eigen::Array3d x = mesh.points.row(a).transpose();
    return (x < set.min.array() - set.slack).any() || (x > set.max.array() + set.slack).any();
  };
  std::erase_if(faces, [&](const BoundaryFace& face) {
    return uses[key_of(face)] > 1 || std::any_of(face.begin(), face.end(), outside);
  });
  return faces;
}

LoadForces::LoadForces(const Body& body, const Loads& loads) {
  const lattice::LeafMesh& mesh = body.mesh;
  fixed_ = Points::Zero(mesh.num_vertices(), 3);
  if (!loads.points.empty()) {
    Points at(static_cast<Eigen::Index>(loads.points.size()), 3);
    for (std::size_t k = 0; k < loads.points.size(); ++k) {
      require_finite(loads.points[k].at, "point load");
      require_finite(loads.points[k].force, "point load");
      at.row(static_cast<Eigen::Index>(k)) = loads.points[k].at.transpose();
    }
    const lattice::Embedding embedded = lattice::embed(mesh, at);
    if (!embedded.outside.empty()) {
      const Eigen::RowVector3d p = at.row(embedded.outside.front());
      throw std::invalid_argument(fmt::format("point load {}: ({:g}, {:g}, {:g}) lies outside the lattice",
                                              embedded.outside.front() + 1, p[0], p[1], p[2]));
    }
    for (int k = 0; k < static_cast<int>(loads.points.size()); ++k) {
      for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(embedded.weights, k); it; ++it)
        fixed_.row(it.col()) += it.value() * loads.points[static_cast<std::size_t>(k)].force.transpose();
    }
  }
  Eigen::Vector3d density = Eigen::Vector3d::Zero(), acceleration = Eigen::Vector3d::Zero();
  for (const BodyLoad& load : loads.bodies) {
    require_finite(load.density, "body load");
    require_finite(load.acceleration, "body load");
    density += load.density;
    acceleration += load.acceleration;
  }
  for (int a = 0; a < mesh.num_vertices(); ++a)
    fixed_.row(a) += body.vertex_mass[static_cast<std::size_t>(a)] * acceleration.transpose();
  for (std::size_t c = 0; c < mesh.cells.size() && !loads.bodies.empty(); ++c) {
    const std::array<double, 8> weights =
        gauss_weights(lattice::hex_corners(mesh.points, mesh.cells[c]), body.fill[c]);
    for (int q = 0; q < 8; ++q) {
      const lattice::HexWeights phi = lattice::trilinear_weights(gauss_point(q));
      for (int a = 0; a < 8; ++a)
        fixed_.row(mesh.cells[c][static_cast<std::size_t>(a)]) +=
            weights[static_cast<std::size_t>(q)] * phi[a] * density.transpose();
    }
  }
  const auto faces_of = [&](const FaceSet& set, const char* what) {
    std::vector<BoundaryFace> faces = boundary_faces(mesh, set);
    if (faces.empty())
      throw std::invalid_argument(fmt::format("{}: no face of the lattice's boundary lies in its box", what));
    return faces;
  };
  for (const TractionLoad& load : loads.tractions) {
    require_finite(load.traction, "traction");
    for (const BoundaryFace& face : faces_of(load.faces, "traction"))
      add_face(
          face, mesh.points,
          [&](const Eigen::Vector3d& normal) -> Eigen::Vector3d { return normal.norm() * load.traction; },
          fixed_);
  }
  for (const PressureLoad& load : loads.pressures) {
    require_finite(Eigen::Vector3d::Constant(load.pressure), "pressure");
    pressures_.push_back({faces_of(load.faces, "pressure"), load.pressure});
  }
}

Points LoadForces::at(const Points& x) const {
  Points forces = fixed_;
  for (const Pressed& pressed : pressures_) {
    for (const BoundaryFace& face : pressed.faces)
      add_face(
          face, x,
          [&](const Eigen::Vector3d& normal) -> Eigen::Vector3d { return -pressed.pressure * normal; },
          forces);
  }
  return forces;
}

}  // namespace sinew::fem
