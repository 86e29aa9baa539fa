#include "lattice/check_cells.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/box.h"
#include "lattice/build.h"
#include "lattice/detail/cell_overlap.h"
#include "tests/lattice/lattices.h"

namespace sinew::lattice {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

Cell cell_of(CellType type, const std::vector<int>& vertices) {
  Cell cell;
  cell.type = type;
  std::copy(vertices.begin(), vertices.end(), cell.vertices.begin());
  return cell;
}
Cell tetrahedron(int a, int b, int c, int d) { return cell_of(CellType::Tetrahedron, {a, b, c, d}); }

CellComplex box(CellType type, const Eigen::Vector3i& blocks) {
  return box_lattice({{0, 0, 0}, blocks.cast<double>(), blocks, type, {}});
}

int add_vertex(CellComplex& complex, const Eigen::RowVector3d& p) {
  const auto v = static_cast<int>(complex.points.rows());
  complex.points.conservativeResize(v + 1, 3);
  complex.points.row(v) = p;
  return v;
}

/// A tetrahedron on (0,0,0), (1,0,0), (0,1,0) with its apex above, and one below.
CellComplex two_tetrahedra() {
  CellComplex complex;
  complex.points.resize(5, 3);
  complex.points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1;
  complex.cells = {tetrahedron(0, 1, 2, 3), tetrahedron(0, 2, 1, 4)};
  return complex;
}

TEST(CheckCells, FindsNothingInProperComplexesOfEveryKind) {
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1))
    EXPECT_THAT(cell_faults(complex), IsEmpty()) << name;
  EXPECT_THAT(cell_faults(two_tetrahedra()), IsEmpty());
}

TEST(CheckCells, CellsInsideOutAreTurnedOneByOne) {
  for (const auto& [name, complex] : tests::lattices_of_every_kind(0.1)) {
    CellComplex turned = complex;
    for (std::size_t c = 0; c < turned.cells.size(); c += 2) {
      // A mirror image of the numbering: the two triangles or quadrilaterals change places, or two corners
      // do.
      auto& v = turned.cells[c].vertices;
      const int half = num_corners(turned.cells[c].type) / 2;
      if (half == 2)
        std::swap(v[0], v[1]);
      else
        std::swap_ranges(v.begin(), v.begin() + half, v.begin() + half);
      EXPECT_LT(cell_volume(turned, turned.cells[c]), 0.0);
    }
    EXPECT_THAT(cell_faults(turned), testing::Not(IsEmpty())) << name;
    orient_cells(turned);
    EXPECT_THAT(cell_faults(turned), IsEmpty()) << name;
    for (std::size_t c = 0; c < complex.cells.size(); ++c)
      EXPECT_EQ(turned.cells[c].vertices, complex.cells[c].vertices) << name;
  }
}

TEST(CheckCells, NamesFlatAndTangledAndConcaveCells) {
  CellComplex flat = two_tetrahedra();
  flat.points.row(4) << 0.3, 0.3, 0;
  EXPECT_THAT(cell_faults(flat), ElementsAre(StartsWith("cell 1: is flat: scaled Jacobian at vertex ")));
  // One corner of a cube pushed through the diagonal of the cube: a corner of each sign, so no numbering is
  // to blame.
  CellComplex tangled = box(CellType::Hexahedron, {2, 1, 1});
  const int corner = tangled.cells[0].vertices[0];
  tangled.points.row(corner) =
      tangled.points.row(tangled.cells[0].vertices[6]) * 0.8 + Eigen::RowVector3d(0.1, 0, 0);
  orient_cells(tangled);
  EXPECT_THAT(cell_faults(tangled, {{70, 80}, {}}).front(),
              StartsWith("cell 70: is inverted or not convex: scaled Jacobian at vertex "));
  // A dart: plane faces, an inner angle of more than 180 degrees.
  CellComplex dart = box(CellType::Hexahedron, {1, 1, 1});
  for (int v = 0; v < 8; ++v)
    if (dart.points(v, 0) == 1.0 && dart.points(v, 1) == 1.0) dart.points.row(v).head(2) << 0.3, 0.3;
  EXPECT_THAT(cell_faults(dart), ElementsAre(HasSubstr("is inverted or not convex")));
}

TEST(CheckCells, TellsAFoldedMeshFromOtherNumbering) {
  // The lower tetrahedron's apex pulled through the common face: both lie above it.
  CellComplex folded = two_tetrahedra();
  folded.points.row(4) << 0.1, 0.1, 0.5;
  orient_cells(folded);
  EXPECT_THAT(cell_faults(folded),
              ElementsAre(StartsWith(
                  "cell 0: and cell 1 lie on the same side of their common face: one is inverted")));
}

TEST(CheckCells, NamesDoubledVerticesAndCells) {
  CellComplex twice = two_tetrahedra();
  twice.cells.push_back(tetrahedron(1, 2, 0, 3));
  EXPECT_THAT(cell_faults(twice).front(), StartsWith("cell 2: has the vertices of cell 0; hint: "));
  CellComplex cracked = two_tetrahedra();
  const int copy = add_vertex(cracked, {0, 5e-7, 0});  // of a box of size 2: within 1e-6 of it
  cracked.cells[1] = tetrahedron(copy, 2, 1, 4);
  EXPECT_THAT(cell_faults(cracked),
              ElementsAre(StartsWith(
                  "cell 1: vertex 5 lies 5e-07 m from vertex 0, expected more than 2e-06 m; hint: ")));
  EXPECT_THAT(cell_faults(cracked, {}, Coincidence::Allowed), IsEmpty());
  CellComplex degenerate = two_tetrahedra();
  degenerate.cells[1] = tetrahedron(0, 2, 2, 4);
  EXPECT_THAT(cell_faults(degenerate).front(), StartsWith("cell 1: names vertex 2 twice; hint: "));
}

TEST(CheckCells, NamesFacesOfThreeCells) {
  CellComplex crowded = two_tetrahedra();
  const int apex = add_vertex(crowded, {0.1, 0.1, 0.7});
  crowded.cells.push_back(tetrahedron(0, 1, 2, apex));
  EXPECT_THAT(cell_faults(crowded).front(),
              StartsWith("cell 0: shares a face with cells 1 and 2, expected one at most; hint: "));
}

TEST(CheckCells, NamesQuadrilateralsAgainstTriangles) {
  // A cube with two tetrahedra on its top, as meshers without pyramids would not leave it.
  CellComplex complex = box(CellType::Hexahedron, {1, 1, 1});
  std::vector<int> top;
  for (int k : cell_faces(CellType::Hexahedron)[1]) top.push_back(complex.cells[0].vertices[k]);
  const Eigen::RowVector3d mean = (complex.points.row(top[0]) + complex.points.row(top[1]) +
                                   complex.points.row(top[2]) + complex.points.row(top[3])) /
                                  4;
  const Eigen::RowVector3d centre = complex.points.colwise().mean();
  const int apex = add_vertex(complex, mean + (mean - centre));
  complex.cells.push_back(tetrahedron(top[0], top[1], top[2], apex));
  complex.cells.push_back(tetrahedron(top[0], top[2], top[3], apex));
  EXPECT_THAT(
      cell_faults(complex),
      ElementsAre(StartsWith("cell 0: has a quadrilateral where cell 2 has a triangle, expected faces that "
                             "match; hint: ")));
}

TEST(CheckCells, NamesHangingVertices) {
  // The upper tetrahedron split at the middle of an edge of the common face; the lower one is not.
  CellComplex complex = two_tetrahedra();
  const int middle = add_vertex(complex, {0.5, 0.5, 0});
  complex.cells = {tetrahedron(0, 1, middle, 3), tetrahedron(0, middle, 2, 3), complex.cells[1]};
  EXPECT_THAT(cell_faults(complex),
              ElementsAre(StartsWith(
                  "cell 2: has vertex 5 inside one of its faces or edges, expected faces that match; "
                  "hint: ")));
  // A fine block beside a coarse one: the face of the coarse cube has five hanging vertices.
  CellComplex fine = box(CellType::Hexahedron, {2, 2, 2});
  const CellComplex coarse = box(CellType::Hexahedron, {1, 1, 1});
  const auto shift = static_cast<int>(fine.points.rows());
  std::vector<int> corner;
  for (int v = 0; v < 8; ++v) {
    const Eigen::RowVector3d p = 2.0 * coarse.points.row(v) + Eigen::RowVector3d(2, 0, 0);
    int same = -1;
    for (int u = 0; u < shift; ++u)
      if ((fine.points.row(u) - p).norm() < 1e-9) same = u;
    corner.push_back(same >= 0 ? same : add_vertex(fine, p));
  }
  Cell cube = coarse.cells[0];
  for (int& v : cube.vertices) v = corner[static_cast<std::size_t>(v)];
  fine.cells.push_back(cube);
  EXPECT_THAT(cell_faults(fine), ElementsAre(StartsWith("cell 8: has vertex ")));
}

/// Two cubes of side 1 in one complex that share no vertex, the second one moved.
CellComplex two_cubes(CellType type, const Eigen::RowVector3d& move) {
  CellComplex complex = box(type, {1, 1, 1});
  const CellComplex second = complex;
  const auto count = static_cast<int>(complex.points.rows());
  complex.points.conservativeResize(2 * count, 3);
  complex.points.bottomRows(count) = second.points.rowwise() + move;
  for (Cell cell : second.cells) {
    for (int k = 0; k < num_corners(cell.type); ++k) cell.vertices[static_cast<std::size_t>(k)] += count;
    complex.cells.push_back(cell);
  }
  return complex;
}

TEST(CheckCells, FindsCellsThatOverlapWithoutACommonVertex) {
  // 0.25 x 0.5 x 0.75 in common, whatever the cubes are cut into.
  const Eigen::RowVector3d into(0.75, 0.5, 0.25);
  EXPECT_THAT(
      cell_faults(two_cubes(CellType::Hexahedron, into)),
      ElementsAre("cell 0: overlaps cell 1: they have 0.0938 m^3 in common, expected none; hint: join the "
                  "parts of the mesh, or move them apart"));
  for (const CellType type : {CellType::Hexahedron, CellType::Wedge, CellType::Tetrahedron}) {
    const CellComplex complex = two_cubes(type, into);
    const std::size_t half = complex.cells.size() / 2;
    double sum = 0.0;
    for (std::size_t a = 0; a < half; ++a)
      for (std::size_t b = half; b < 2 * half; ++b)
        sum += detail::overlap_volume(complex, complex.cells[a], complex.cells[b]);
    EXPECT_NEAR(sum, 0.25 * 0.5 * 0.75, 1e-14);  // rounding of sums of a few hundred pieces
    EXPECT_THAT(cell_faults(complex), ElementsAre(HasSubstr(": overlaps cell ")));
  }
}

TEST(CheckCells, CellsThatOnlyTouchDoNotOverlap) {
  // A bar across another one: no vertex lies on a face. Touching, and with less in common than rounding to
  // six digits explains; then with more.
  CellComplex cross = two_cubes(CellType::Hexahedron, {0, 0, 1});
  cross.points.topRows(8).col(0) *= 3.0;
  cross.points.bottomRows(8).col(0).array() += 1.0;
  cross.points.bottomRows(8).col(1) = 3.0 * cross.points.bottomRows(8).col(1).array() - 1.0;
  EXPECT_THAT(cell_faults(cross), IsEmpty());
  cross.points.bottomRows(8).col(2).array() -= 1e-7;
  EXPECT_THAT(cell_faults(cross), IsEmpty());
  cross.points.bottomRows(8).col(2).array() -= 1e-3;
  EXPECT_THAT(cell_faults(cross), ElementsAre(StartsWith("cell 0: overlaps cell 1: they have 0.001 m^3")));
  // Inside each other's box only.
  CellComplex apart = two_tetrahedra();
  apart.points.conservativeResize(8, 3);
  apart.points.bottomRows(3) << 0.9, 0.9, 0.1, 0.9, 0.9, 0.9, 0.6, 0.9, 0.9;
  apart.cells.push_back(tetrahedron(5, 7, 6, add_vertex(apart, {0.9, 0.6, 0.9})));
  orient_cells(apart);
  EXPECT_THAT(cell_faults(apart), IsEmpty());
}

TEST(CheckCells, ListsTwentyOfAKindAndCountsTheRest) {
  CellComplex complex = box(CellType::Tetrahedron, {3, 3, 3});
  const std::size_t count = complex.cells.size();
  complex.cells.insert(complex.cells.end(), complex.cells.begin(), complex.cells.begin() + 27);
  const std::string line = cell_faults(complex).front();
  EXPECT_THAT(line,
              StartsWith("cell " + std::to_string(count) + ": has the vertices of cell 0 (27 such cells: "));
  EXPECT_THAT(line, HasSubstr(", ... and 7 more); hint: "));
  EXPECT_EQ(number_list({4, 2}), "4, 2");
}

}  // namespace
}  // namespace sinew::lattice
