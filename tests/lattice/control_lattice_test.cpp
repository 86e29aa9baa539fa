#include "lattice/control_lattice.h"

#include <map>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;

CellComplex one_cell(CellType type) {
  CellComplex complex;
  Cell cell;
  cell.type = type;
  for (int k = 0; k < num_corners(type); ++k) cell.vertices[k] = k;
  complex.points.resize(num_corners(type), 3);
  if (type == CellType::Tetrahedron) complex.points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  if (type == CellType::Wedge) complex.points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 2, 1, 0, 2, 0, 1, 2;
  if (type == CellType::Hexahedron)
    complex.points << 0, 0, 0, 2, 0, 0, 2, 3, 0, 0, 3, 0, 0, 0, 4, 2, 0, 4, 2, 3, 4, 0, 3, 4;
  complex.cells = {cell};
  return complex;
}

TEST(CellVolume, IsThatOfTheClosedForm) {
  // Corner of a cube 1/6; prism 1/2 * 2; box 2 * 3 * 4. Sums of at most 24 rounded terms.
  const CellComplex tetrahedron = one_cell(CellType::Tetrahedron), wedge = one_cell(CellType::Wedge),
                    box = one_cell(CellType::Hexahedron);
  EXPECT_NEAR(cell_volume(tetrahedron, tetrahedron.cells[0]), 1.0 / 6.0, 1e-15);
  EXPECT_NEAR(cell_volume(wedge, wedge.cells[0]), 1.0, 1e-14);
  EXPECT_NEAR(cell_volume(box, box.cells[0]), 24.0, 1e-13);
}

TEST(CellFaces, TurnOutwardAndUseEveryEdgeTwice) {
  for (const CellType type : {CellType::Tetrahedron, CellType::Wedge, CellType::Hexahedron}) {
    const CellComplex complex = one_cell(type);
    const Vector3d mean = complex.points.colwise().mean().transpose();
    std::map<std::pair<int, int>, int> uses;
    for (const std::array<int, 4>& face : cell_faces(type)) {
      const int n = face[3] < 0 ? 3 : 4;
      const auto point = [&](int k) -> Vector3d { return complex.points.row(face[k]).transpose(); };
      const Vector3d normal = (point(1) - point(0)).cross(point(2) - point(0));
      EXPECT_GT(normal.dot(point(0) - mean), 0.0);
      for (int k = 0; k < n; ++k) ++uses[std::minmax(face[k], face[(k + 1) % n])];
    }
    EXPECT_EQ(uses.size(), cell_edges(type).size());
    for (const std::array<int, 2>& e : cell_edges(type)) EXPECT_EQ((uses[std::minmax(e[0], e[1])]), 2);
  }
}

std::string message(const ControlLattice& lattice) {
  try {
    validate(lattice);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Validate, NamesTheCellOrBoneAtFault) {
  ControlLattice good;
  good.complex = one_cell(CellType::Wedge);
  LatticeBone bone;
  bone.name = "thigh";
  bone.chain = {0, 3, 4};
  good.bones = {bone};
  EXPECT_EQ(message(good), "");

  ControlLattice missing = good;
  missing.complex.cells[0].vertices[2] = 9;
  EXPECT_EQ(message(missing), "cell 0: vertex index 9 is not in 0..5");

  ControlLattice inverted = good;
  std::swap(inverted.complex.cells[0].vertices[0], inverted.complex.cells[0].vertices[3]);
  std::swap(inverted.complex.cells[0].vertices[1], inverted.complex.cells[0].vertices[4]);
  std::swap(inverted.complex.cells[0].vertices[2], inverted.complex.cells[0].vertices[5]);
  EXPECT_THAT(message(inverted), testing::HasSubstr("cell 0: volume is -1"));

  ControlLattice diagonal = good;
  diagonal.bones[0].chain = {0, 4};
  EXPECT_EQ(message(diagonal), "bone 'thigh': vertices 0 and 4 of its chain are not joined by an edge");

  ControlLattice empty = good;
  empty.bones[0].chain.clear();
  EXPECT_EQ(message(empty), "bone 'thigh': is hard but has no chain of edges");
}

}  // namespace
}  // namespace sinew::lattice
