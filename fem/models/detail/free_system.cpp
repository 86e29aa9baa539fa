#include "fem/models/detail/free_system.h"

#include <algorithm>
#include <map>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace sinew::fem {

using lattice::Points;

namespace {

constexpr int kGrain = 64;  ///< rows per task.

template <class Action>
void over_rows(int count, const Action& action) {
  tbb::parallel_for(tbb::blocked_range<int>(0, count, kGrain), [&](const tbb::blocked_range<int>& range) {
    for (int i = range.begin(); i != range.end(); ++i) action(i);
  });
}

}  // namespace

FreeVertices free_vertices(const Body& body) {
  const lattice::LeafMesh& mesh = body.mesh;
  FreeVertices free;
  std::vector<std::map<int, double>> rows(static_cast<std::size_t>(mesh.num_vertices()));
  // Leaf vertices ascend with their hierarchy index, so parents come before children.
  for (int a = 0; a < mesh.num_vertices(); ++a) {
    const auto i = static_cast<std::size_t>(a);
    if (body.bones.is_bone[i]) continue;
    const int v = mesh.vertices[i];
    if (body.hierarchy.level(v) == 0 || std::binary_search(mesh.functions.begin(), mesh.functions.end(), v)) {
      rows[i][free.num_unknowns()] = 1.0;
      free.vertex.push_back(a);
      continue;
    }
    const auto parents = body.hierarchy.parents(v);
    for (int p : parents) {
      const auto parent = static_cast<std::size_t>(mesh.leaf_of_vertex[static_cast<std::size_t>(p)]);
      for (const auto& [unknown, weight] : rows[parent])
        rows[i][unknown] += weight / static_cast<double>(parents.size());
    }
  }
  free.row_start.push_back(0);
  for (const auto& row : rows) {
    for (const auto& [unknown, weight] : row) {
      free.unknown.push_back(unknown);
      free.weight.push_back(weight);
    }
    free.row_start.push_back(static_cast<int>(free.unknown.size()));
  }
  return free;
}

Points FreeVertices::spread(const Points& unknowns) const {
  Points leaves = Points::Zero(static_cast<Eigen::Index>(row_start.size()) - 1, 3);
  for (Eigen::Index a = 0; a < leaves.rows(); ++a) {
    const auto row = static_cast<std::size_t>(a);
    for (auto e = static_cast<std::size_t>(row_start[row]); e < static_cast<std::size_t>(row_start[row + 1]);
         ++e)
      leaves.row(a) += weight[e] * unknowns.row(unknown[e]);
  }
  return leaves;
}

Points FreeVertices::gather(const Points& leaf_forces) const {
  Points forces = Points::Zero(num_unknowns(), 3);
  for (Eigen::Index a = 0; a < leaf_forces.rows(); ++a) {
    const auto row = static_cast<std::size_t>(a);
    for (auto e = static_cast<std::size_t>(row_start[row]); e < static_cast<std::size_t>(row_start[row + 1]);
         ++e)
      forces.row(unknown[e]) += weight[e] * leaf_forces.row(a);
  }
  return forces;
}

BlockSystem::BlockSystem(const Body& body, const FreeVertices& free) {
  struct Entry {
    double mass = 0.0, tie = 0.0, ghost = 0.0;
    std::vector<Part> parts;
  };
  std::vector<std::map<int, Entry>> rows(free.vertex.size());
  const auto each_pair = [&](int a, int b, const auto& action) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    for (auto e = static_cast<std::size_t>(free.row_start[i]);
         e < static_cast<std::size_t>(free.row_start[i + 1]); ++e) {
      for (auto f = static_cast<std::size_t>(free.row_start[j]);
           f < static_cast<std::size_t>(free.row_start[j + 1]); ++f)
        action(rows[static_cast<std::size_t>(free.unknown[e])][free.unknown[f]],
               free.weight[e] * free.weight[f]);
    }
  };
  const LeafMatrices& m = body.matrices;
  for (int a = 0; a < m.num_vertices(); ++a) {
    for (auto e = static_cast<std::size_t>(m.row_start[static_cast<std::size_t>(a)]);
         e < static_cast<std::size_t>(m.row_start[static_cast<std::size_t>(a) + 1]); ++e) {
      each_pair(a, m.column[e], [&](Entry& entry, double weight) {
        entry.mass += weight * m.mass[e];
        entry.tie += weight * m.tie[e];
        entry.ghost += weight * m.ghost[e];
      });
    }
  }
  for (std::size_t c = 0; c < body.mesh.cells.size(); ++c) {
    const lattice::HexVertices& cell = body.mesh.cells[c];
    for (std::int8_t a = 0; a < 8; ++a) {
      for (std::int8_t b = 0; b < 8; ++b) {
        each_pair(cell[static_cast<std::size_t>(a)], cell[static_cast<std::size_t>(b)],
                  [&](Entry& entry, double weight) {
                    entry.parts.push_back({static_cast<int>(c), a, b, weight});
                  });
      }
    }
  }
  row_start_.push_back(0);
  part_start_.push_back(0);
  for (const auto& row : rows) {
    for (const auto& [column, entry] : row) {
      column_.push_back(column);
      mass_.push_back(entry.mass);
      tie_.push_back(entry.tie);
      ghost_.push_back(entry.ghost);
      parts_.insert(parts_.end(), entry.parts.begin(), entry.parts.end());
      part_start_.push_back(static_cast<int>(parts_.size()));
    }
    row_start_.push_back(static_cast<int>(column_.size()));
  }
  block_.resize(column_.size());

  std::vector<Eigen::Triplet<double>> pattern;
  for (int i = 0; i < static_cast<int>(rows.size()); ++i) {
    for (int e = row_start_[static_cast<std::size_t>(i)]; e < row_start_[static_cast<std::size_t>(i) + 1];
         ++e) {
      const int j = column_[static_cast<std::size_t>(e)];
      if (j < i) continue;
      for (int c = 0; c < 3; ++c) {
        for (int r = j == i ? c : 0; r < 3; ++r) pattern.emplace_back(3 * j + r, 3 * i + c, 1.0);
      }
    }
  }
  const Eigen::Index size = 3 * static_cast<Eigen::Index>(rows.size());
  lower_.resize(size, size);
  lower_.setFromTriplets(pattern.begin(), pattern.end());
}

void BlockSystem::assemble(const Shares& shares, const std::vector<CellStiffness>& cells) {
  over_rows(static_cast<int>(row_start_.size()) - 1, [&](int row) {
    const auto i = static_cast<std::size_t>(row);
    for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
         ++e) {
      Block sum = Block::Zero();
      sum.diagonal().array() += shares.mass * mass_[e] + shares.tie * tie_[e] + shares.ghost * ghost_[e];
      for (auto k = static_cast<std::size_t>(part_start_[e]);
           k < static_cast<std::size_t>(part_start_[e + 1]); ++k) {
        const Part& p = parts_[k];
        sum += p.weight * cells[static_cast<std::size_t>(p.cell)].block<3, 3>(3 * p.row, 3 * p.column);
      }
      block_[e] = sum;
    }
  });
}

void BlockSystem::apply(const Points& x, Points& y) const {
  const auto n = static_cast<int>(row_start_.size()) - 1;
  y.resize(n, 3);
  over_rows(n, [&](int row) {
    const auto i = static_cast<std::size_t>(row);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
         ++e)
      sum += block_[e] * x.row(column_[e]).transpose();
    y.row(row) = sum.transpose();
  });
}

void BlockSystem::shift_diagonal(double shift) {
  for (std::size_t i = 0; i + 1 < row_start_.size(); ++i) {
    for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
         ++e) {
      if (column_[e] == static_cast<int>(i)) block_[e].diagonal().array() += shift;
    }
  }
}

Eigen::VectorXd BlockSystem::diagonal() const {
  Eigen::VectorXd diagonal(3 * static_cast<Eigen::Index>(row_start_.size()) - 3);
  for (std::size_t i = 0; i + 1 < row_start_.size(); ++i) {
    for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
         ++e) {
      if (column_[e] == static_cast<int>(i))
        diagonal.segment<3>(3 * static_cast<Eigen::Index>(i)) = block_[e].diagonal();
    }
  }
  return diagonal;
}

const Eigen::SparseMatrix<double>& BlockSystem::lower() {
  // Column i of the lower triangle is row i of the upper one, as blocks are stored in both.
  double* value = lower_.valuePtr();
  for (std::size_t i = 0; i + 1 < row_start_.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      for (auto e = static_cast<std::size_t>(row_start_[i]); e < static_cast<std::size_t>(row_start_[i + 1]);
           ++e) {
        const int j = column_[e];
        if (j < static_cast<int>(i)) continue;
        for (int r = j == static_cast<int>(i) ? c : 0; r < 3; ++r) *value++ = block_[e](c, r);
      }
    }
  }
  return lower_;
}

}  // namespace sinew::fem
