#pragma once

#include <utility>
#include <vector>

#include "lattice/points.h"

namespace sinew::fem {
struct SkinJudgeInput;
}

namespace sinew::fem::detail {

/// An edge between two triangles, and how it stood at rest.
struct Hinge {
  int triangle_a = 0, triangle_b = 0;
  int vertex_a = 0, vertex_b = 0;  ///< its ends.
  double length = 0.0;             ///< at rest [m].
  double cos_rest = 1.0;           ///< of the angle between the triangles' normals at rest.
};

/// Lengths of a triangle's sides as inner products: what its stretch is measured against.
struct Gram {
  double aa = 0.0, ab = 0.0, bb = 0.0;  ///< of the sides from its first corner [m^2].
};

/// What of a skin is judged and does not change: vertices that coincide at rest and in plain skinning are
/// one, triangles without area, doubled ones and ones without flesh are left out.
struct JudgedSkin {
  std::vector<int> all;     ///< input vertex of every place of the whole skin: for its centre.
  std::vector<int> vertex;  ///< input vertex of every judged vertex.
  lattice::Points rest;     ///< of judged vertices [m].
  lattice::Triangles triangles;
  std::vector<double> area;    ///< of triangles at rest [m^2].
  std::vector<Gram> gram;      ///< of triangles at rest.
  lattice::Points normal;      ///< of triangles at rest, as long as twice their area [m^2].
  std::vector<int> first;      ///< num_vertices + 1: where a vertex's neighbours begin.
  std::vector<int> neighbour;  ///< by vertex, ascending.
  std::vector<double> length;  ///< at rest, of the edge to each neighbour [m].
  std::vector<double> share;   ///< a third of the area round every vertex [m^2].
  std::vector<Hinge> hinges;   ///< edges of exactly two triangles.
  double total_area = 0.0;     ///< [m^2].
  double height = 0.0;         ///< unit of lengths [m].

  int num_vertices() const { return static_cast<int>(vertex.size()); }
  int num_triangles() const { return static_cast<int>(triangles.rows()); }
};

JudgedSkin judged_skin(const SkinJudgeInput& input);

/// Normals of triangles, num_triangles x 3, as long as twice their area [m^2].
void triangle_normals(const lattice::Points& x, const lattice::Triangles& triangles,
                      lattice::Points& normals);

Gram gram(const lattice::Points& x, const lattice::Triangles& triangles, Eigen::Index t);

}  // namespace sinew::fem::detail
