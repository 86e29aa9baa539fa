#include "fem/models/detail/coordinates.h"

#include <algorithm>

namespace sinew::fem::detail {

void Coordinates::analyse(const lattice::Points& from, lattice::Points& to) const {
  to.resize(num_functions(), 3);
  for (int f = 0; f < num_functions(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    Eigen::RowVector3d value = from.row(vertex[i]);
    const int begin = parent_start[i], end = parent_start[i + 1];
    if (begin < end) {
      Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
      for (int p = begin; p < end; ++p) mean += from.row(parents[static_cast<std::size_t>(p)]);
      value -= mean / static_cast<double>(end - begin);
    }
    to.row(f) = value;
  }
}

Coordinates hierarchical_coordinates(const Body& body) {
  Coordinates c;
  c.values = body.mesh.values_from_coefficients;
  c.parent_start.push_back(0);
  for (int v : body.mesh.functions) {
    const int leaf = body.mesh.leaf_of_vertex[static_cast<std::size_t>(v)];
    c.vertex.push_back(leaf);
    for (int p : body.hierarchy.parents(v))
      c.parents.push_back(body.mesh.leaf_of_vertex[static_cast<std::size_t>(p)]);
    c.parent_start.push_back(static_cast<int>(c.parents.size()));
    c.is_value.push_back(body.hierarchy.level(v) == 0);
    c.is_known.push_back(body.bones.is_bone[static_cast<std::size_t>(leaf)]);
  }
  return c;
}

Coordinates nodal_coordinates(const Body& body) {
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const auto i = static_cast<std::size_t>(a);
    if (!body.bones.is_bone[i] &&
        !std::binary_search(body.mesh.functions.begin(), body.mesh.functions.end(), body.mesh.vertices[i]))
      return hierarchical_coordinates(body);
  }
  Coordinates c;
  const int n = body.mesh.num_vertices();
  c.values.resize(n, n);
  c.values.setIdentity();
  c.parent_start.assign(static_cast<std::size_t>(n) + 1, 0);
  c.is_value.assign(static_cast<std::size_t>(n), 1);
  c.is_known = body.bones.is_bone;
  for (int a = 0; a < n; ++a) c.vertex.push_back(a);
  return c;
}

}  // namespace sinew::fem::detail
