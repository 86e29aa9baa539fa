#include "fem/models/detail/region_systems.h"

#include <algorithm>

#include <tbb/parallel_for.h>

namespace sinew::fem::detail {
namespace {

using RowSparse = RegionSystem::RowSparse;

/// Flags of the cells that share a vertex with a flagged one.
std::vector<std::uint8_t> grow(const lattice::LeafMesh& mesh, const std::vector<std::uint8_t>& cells) {
  std::vector<std::uint8_t> touched(static_cast<std::size_t>(mesh.num_vertices()), 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (!cells[c]) continue;
    for (int a : mesh.cells[c]) touched[static_cast<std::size_t>(a)] = 1;
  }
  std::vector<std::uint8_t> grown(cells.size(), 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (int a : mesh.cells[c]) grown[c] = grown[c] || touched[static_cast<std::size_t>(a)];
  }
  return grown;
}

/// What the systems of all regions are made from.
struct Neighbours {
  std::vector<std::vector<int>> vertex_cells;      ///< leaf cells round a leaf vertex.
  std::vector<std::vector<int>> vertex_functions;  ///< functions that do not vanish there.

  Neighbours(const lattice::LeafMesh& mesh, const Coordinates& coordinates)
      : vertex_cells(static_cast<std::size_t>(mesh.num_vertices())), vertex_functions(vertex_cells.size()) {
    for (int c = 0; c < static_cast<int>(mesh.cells.size()); ++c) {
      for (int a : mesh.cells[static_cast<std::size_t>(c)])
        vertex_cells[static_cast<std::size_t>(a)].push_back(c);
    }
    for (int a = 0; a < mesh.num_vertices(); ++a) {
      for (RowSparse::InnerIterator it(coordinates.values, a); it; ++it)
        vertex_functions[static_cast<std::size_t>(a)].push_back(static_cast<int>(it.col()));
    }
  }
};

class SystemBuilder {
 public:
  SystemBuilder(const Body& body, const Coordinates& coordinates, const Neighbours& neighbours)
      : body_(body), coordinates_(coordinates), neighbours_(neighbours) {}

  RegionSystem build(const Region& region, int rings) {
    system_.region = &region;
    find_unknowns(rings);
    find_rows();
    find_values();
    for (int a : region.vertices) {
      const auto vertex = static_cast<std::size_t>(a);
      system_.blended.push_back(body_.bones.is_bone[vertex] ? -1 : local_vertex_[vertex]);
    }
    find_ties();
    size_buffers();
    return std::move(system_);
  }

 private:
  void find_unknowns(int rings);
  void find_rows();
  void find_values();
  void find_ties();
  void size_buffers();

  const Body& body_;
  const Coordinates& coordinates_;
  const Neighbours& neighbours_;
  RegionSystem system_;
  std::vector<std::uint8_t> is_unknown_;            ///< per function.
  std::vector<int> local_function_, local_vertex_;  ///< -1: not in the system.
};

/// Core: leaf cells with a vertex of w > 0. Unknown: functions whose support meets the core, and those whose
/// own vertex lies in the rings round it.
void SystemBuilder::find_unknowns(int rings) {
  const lattice::LeafMesh& mesh = body_.mesh;
  std::vector<std::uint8_t> core(mesh.cells.size(), 0);
  for (int a : system_.region->vertices) {
    for (int c : neighbours_.vertex_cells[static_cast<std::size_t>(a)]) core[static_cast<std::size_t>(c)] = 1;
  }
  std::vector<std::uint8_t> ringed = core;
  for (int r = 0; r < rings; ++r) ringed = grow(mesh, ringed);
  is_unknown_.assign(static_cast<std::size_t>(coordinates_.num_functions()), 0);
  std::vector<std::uint8_t> in_ring(static_cast<std::size_t>(mesh.num_vertices()), 0);
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    for (int a : mesh.cells[c]) {
      if (ringed[c]) in_ring[static_cast<std::size_t>(a)] = 1;
      if (!core[c]) continue;
      for (int f : neighbours_.vertex_functions[static_cast<std::size_t>(a)])
        is_unknown_[static_cast<std::size_t>(f)] = 1;
    }
  }
  local_function_.assign(is_unknown_.size(), -1);
  for (int f = 0; f < coordinates_.num_functions(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    if (in_ring[static_cast<std::size_t>(coordinates_.vertex[i])]) is_unknown_[i] = 1;
    if (coordinates_.is_known[i]) is_unknown_[i] = 0;
    if (!is_unknown_[i]) continue;
    local_function_[i] = static_cast<int>(system_.functions.size());
    system_.functions.push_back(f);
  }
  system_.num_unknown = static_cast<int>(system_.functions.size());
}

/// Vertices where an unknown function does not vanish; then their neighbours.
void SystemBuilder::find_rows() {
  const lattice::LeafMesh& mesh = body_.mesh;
  local_vertex_.assign(static_cast<std::size_t>(mesh.num_vertices()), -1);
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const auto& functions = neighbours_.vertex_functions[static_cast<std::size_t>(a)];
    if (std::none_of(functions.begin(), functions.end(),
                     [&](int f) { return is_unknown_[static_cast<std::size_t>(f)]; }))
      continue;
    local_vertex_[static_cast<std::size_t>(a)] = static_cast<int>(system_.vertices.size());
    system_.vertices.push_back(a);
  }
  system_.num_rows = static_cast<int>(system_.vertices.size());
  const LeafMatrices& matrices = body_.matrices;
  system_.row_start.push_back(0);
  for (int r = 0; r < system_.num_rows; ++r) {
    const auto a = static_cast<std::size_t>(system_.vertices[static_cast<std::size_t>(r)]);
    system_.entry.push_back(matrices.row_start[a]);
    for (int e = matrices.row_start[a]; e < matrices.row_start[a + 1]; ++e) {
      const auto b = static_cast<std::size_t>(matrices.column[static_cast<std::size_t>(e)]);
      if (local_vertex_[b] < 0) {
        local_vertex_[b] = static_cast<int>(system_.vertices.size());
        system_.vertices.push_back(static_cast<int>(b));
      }
      system_.column.push_back(local_vertex_[b]);
    }
    system_.row_start.push_back(static_cast<int>(system_.column.size()));
  }
}

/// What the functions are at the vertices; known ones that are not zero there join the system.
void SystemBuilder::find_values() {
  std::vector<Eigen::Triplet<double>> triplets, transposed;
  for (std::size_t r = 0; r < system_.vertices.size(); ++r) {
    for (RowSparse::InnerIterator it(coordinates_.values, system_.vertices[r]); it; ++it) {
      int& local = local_function_[static_cast<std::size_t>(it.col())];
      if (local < 0) {
        local = static_cast<int>(system_.functions.size());
        system_.functions.push_back(static_cast<int>(it.col()));
      }
      triplets.emplace_back(static_cast<int>(r), local, it.value());
      if (local < system_.num_unknown) transposed.emplace_back(local, static_cast<int>(r), it.value());
    }
  }
  RowSparse& values = system_.values;
  values.resize(static_cast<Eigen::Index>(system_.vertices.size()),
                static_cast<Eigen::Index>(system_.functions.size()));
  values.setFromTriplets(triplets.begin(), triplets.end());
  RowSparse identity(values.rows(), values.rows());
  identity.setIdentity();
  system_.values_are_coefficients =
      values.rows() == values.cols() && RowSparse(values - identity).squaredNorm() == 0.0;
  system_.rows_to_unknown.resize(system_.num_unknown, system_.num_rows);
  system_.rows_to_unknown.setFromTriplets(transposed.begin(), transposed.end());
}

void SystemBuilder::find_ties() {
  for (std::size_t t = 0; t < body_.ties.size(); ++t) {
    std::vector<std::pair<int, int>> rows;
    for (std::size_t k = 0; k < body_.ties[t].vertices.size(); ++k) {
      const int r = local_vertex_[static_cast<std::size_t>(body_.ties[t].vertices[k])];
      if (r >= 0 && r < system_.num_rows) rows.emplace_back(static_cast<int>(k), r);
    }
    if (!rows.empty()) system_.ties.emplace_back(static_cast<int>(t), std::move(rows));
  }
}

void SystemBuilder::size_buffers() {
  system_.coefficients.resize(system_.functions.size());
  system_.inputs.resize(system_.vertices.size());
  system_.velocity.resize(static_cast<Eigen::Index>(system_.functions.size()), 3);
  system_.row_force.resize(system_.num_rows, 3);
  system_.solution.resize(3 * system_.num_unknown);
  system_.result.resize(static_cast<Eigen::Index>(system_.region->vertices.size()), 3);
}

}  // namespace

std::vector<RegionSystem> region_systems(const Body& body, const Coordinates& coordinates, int rings) {
  const Neighbours neighbours(body.mesh, coordinates);
  std::vector<RegionSystem> systems(body.regions.size());
  tbb::parallel_for(std::size_t{0}, systems.size(), [&](std::size_t i) {
    systems[i] = SystemBuilder(body, coordinates, neighbours).build(body.regions[i], rings);
  });
  return systems;
}

Eigen::SparseMatrix<double> region_matrix(const Body& body, const RegionSystem& system,
                                          const SystemFactors& factors) {
  const LeafMatrices& matrices = body.matrices;
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(9 * system.column.size());
  for (int r = 0; r < system.num_rows; ++r) {
    const auto row = static_cast<std::size_t>(r);
    for (int k = system.row_start[row]; k < system.row_start[row + 1]; ++k) {
      const int column = system.column[static_cast<std::size_t>(k)];
      if (column >= system.num_rows) continue;
      const auto e = static_cast<std::size_t>(system.entry[row] + k - system.row_start[row]);
      Eigen::Matrix3d block = factors.stiffness * matrices.stiffness[e];
      block.diagonal().array() += factors.mass * matrices.mass[e] + factors.tie * matrices.tie[e];
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) triplets.emplace_back(3 * r + i, 3 * column + j, block(i, j));
      }
    }
  }
  Eigen::SparseMatrix<double> nodal(3 * system.num_rows, 3 * system.num_rows);
  nodal.setFromTriplets(triplets.begin(), triplets.end());
  triplets.clear();
  for (int f = 0; f < system.num_unknown; ++f) {
    for (RowSparse::InnerIterator it(system.rows_to_unknown, f); it; ++it) {
      for (int c = 0; c < 3; ++c)
        triplets.emplace_back(3 * static_cast<int>(it.col()) + c, 3 * f + c, it.value());
    }
  }
  Eigen::SparseMatrix<double> basis(3 * system.num_rows, 3 * system.num_unknown);
  basis.setFromTriplets(triplets.begin(), triplets.end());
  return basis.transpose() * (nodal * basis);
}

std::vector<std::uint8_t> wanted_rows(const RegionSystem& system) {
  std::vector<std::uint8_t> wanted(static_cast<std::size_t>(3 * system.num_unknown), 0);
  for (int vertex : system.blended) {
    if (vertex < 0) continue;
    for (RowSparse::InnerIterator it(system.values, vertex); it; ++it) {
      if (it.col() >= system.num_unknown) continue;
      for (int c = 0; c < 3; ++c) wanted[static_cast<std::size_t>(3 * it.col() + c)] = 1;
    }
  }
  return wanted;
}

}  // namespace sinew::fem::detail
