#pragma once

#include <string>
#include <vector>

#include "lattice/points.h"

/// Meshes as text: the rest mesh that goes with a point cache, and the meshes artists hand us.
namespace sinew::assets {

/// One named mesh with its own vertex indices.
struct NamedMesh {
  std::string name;
  lattice::Points points;        ///< num_vertices x 3.
  lattice::Triangles triangles;  ///< indices into points.
};

/// The text of a Wavefront OBJ file: one group (`g`) per part, vertices in the given order over all parts.
/// Not one object (`o`) per part: importers make a mesh of each, and a point cache fits only the whole.
/// Coordinates are rounded to float and printed with as many digits as bring the same float back. Throws
/// std::domain_error as to_float, std::invalid_argument for an index out of range.
std::string obj_text(const std::vector<NamedMesh>& parts, const std::string& comment = {});

/// All vertices of an OBJ or PLY file (by its extension) in the file's own order, polygons split into fans.
/// Materials, normals and other properties are left out. Throws IoError where it cannot be read, InputError
/// with the line (or the element) where it is wrong.
NamedMesh read_surface(const std::string& file);

}  // namespace sinew::assets
