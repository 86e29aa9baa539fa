// Limbs that share a cell get a copy of it each.
#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/basis.h"
#include "lattice/build.h"
#include "lattice/fill.h"
#include "lattice/limb_copies.h"
#include "tests/lattice/lattices.h"
#include "tests/lattice/limbs.h"

namespace sinew::lattice {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;

/// The two legs of limbs.h in so few cells that many hold skin of both: edges of about 0.3 across a gap of
/// 0.12. Not mirrored: no cell of a mirrored lattice reaches across its plane.
struct Legs {
  tests::Character character = tests::two_legs();
  BuildResult result = build(character.skin, character.joints, {.cells = 260, .symmetry = Symmetry::Off});
  const ControlLattice& lattice = result.lattice;
};

/// Barycentric coordinates of p in a tetrahedron by a linear solve.
Vector4d barycentric(const CellComplex& complex, const Cell& cell, const Vector3d& p) {
  Eigen::Matrix4d corners;
  for (int k = 0; k < 4; ++k) corners.col(k) << complex.points.row(cell.vertices[k]).transpose(), 1.0;
  return corners.partialPivLu().solve(Vector4d(p.homogeneous()));
}

/// The first cell that holds p and is its own; -1 where there is none.
int own_cell(const ControlLattice& lattice, const LimbCopies& copies, int frame, const Vector3d& p) {
  for (int c = 0; c < static_cast<int>(lattice.complex.cells.size()); ++c)
    if (barycentric(lattice.complex, lattice.complex.cells[c], p).minCoeff() > -1e-9 &&
        copies.owns(c, frame, p)) {
      return c;
    }
  return -1;
}

std::map<int, std::vector<CellCopy>> places(const ControlLattice& lattice) {
  std::map<int, std::vector<CellCopy>> result;
  for (const CellCopy& copy : lattice.copies) result[copy.place].push_back(copy);
  return result;
}

TEST(SeparateLimbs, GivesEveryLimbInACellACopyInTheSamePlace) {
  const Legs legs;
  EXPECT_THAT(legs.result.failures, testing::IsEmpty());
  EXPECT_NO_THROW(validate(legs.lattice));
  EXPECT_GE(places(legs.lattice).size(), 10u)
      << "the legs share too few cells for this test to mean anything";
  const CellComplex& complex = legs.lattice.complex;
  for (const auto& [place, copies] : places(legs.lattice)) {
    ASSERT_GE(copies.size(), 2u);
    EXPECT_EQ(copies[0].cell, place);
    std::set<int> frames;
    for (const CellCopy& copy : copies) {
      for (int k = 0; k < 4; ++k)
        EXPECT_EQ(complex.points.row(complex.cells[copy.cell].vertices[k]),
                  complex.points.row(complex.cells[place].vertices[k]));
      if (copy.cell != place) {
        EXPECT_NE(complex.cells[copy.cell].vertices, complex.cells[place].vertices);
      }
      for (int frame : copy.frames) EXPECT_TRUE(frames.insert(frame).second) << "frame in two copies";
    }
  }
}

TEST(SeparateLimbs, PutsEverySkinVertexIntoACellOfItsOwnLimb) {
  const Legs legs;
  const LimbCopies copies(legs.lattice);
  int shared = 0;
  for (Eigen::Index v = 0; v < legs.character.skin.points.rows(); ++v) {
    const int frame =
        skin_frame(legs.character.skin.weights[static_cast<std::size_t>(v)], legs.lattice.frame_of_joint);
    const int cell = own_cell(legs.lattice, copies, frame, legs.character.skin.points.row(v).transpose());
    ASSERT_GE(cell, 0) << "skin vertex " << v;
    if (!copies.is_copy(cell)) continue;
    ++shared;
    const auto copy = std::find_if(legs.lattice.copies.begin(), legs.lattice.copies.end(),
                                   [&](const CellCopy& c) { return c.cell == cell; });
    EXPECT_THAT(copy->frames, testing::Contains(frame)) << "skin vertex " << v;
  }
  EXPECT_GE(shared, 100);
}

TEST(SeparateLimbs, LeavesNoVertexToBothLegsBelowTheHips) {
  const Legs legs;
  // Below 1.3 the legs are 0.6 away from the hips, more than 1.5 edges of the way from leg to leg.
  const auto side_of_joint = [&](int joint) {
    return legs.character.joints.names[static_cast<std::size_t>(joint)][0];
  };
  std::map<int, std::set<char>> sides;  // per vertex
  for (const CellCopy& copy : legs.lattice.copies)
    for (int k = 0; k < 4; ++k) {
      const int v = legs.lattice.complex.cells[copy.cell].vertices[k];
      if (legs.lattice.complex.points(v, 1) > 1.3) continue;
      for (int frame : copy.frames)
        if (side_of_joint(frame) != 'p') sides[v].insert(side_of_joint(frame));  // the pelvis goes with both
    }
  EXPECT_GE(sides.size(), 20u);
  for (const auto& [v, letters] : sides)
    EXPECT_EQ(letters.size(), 1u) << "vertex " << v << " at " << legs.lattice.complex.points.row(v);
  for (const LatticeBone& bone : legs.lattice.bones)
    for (int v : bone.chain)
      if (sides.contains(v)) {
        EXPECT_THAT(sides[v], testing::ElementsAre(side_of_joint(bone.frame)));
      }
}

TEST(SeparateLimbs, CopiesTogetherHoldTheFleshOfTheirPlaceOnce) {
  const Legs legs;
  const Hierarchy hierarchy(legs.lattice.complex, 1);
  const LeafMesh mesh = tests::uniform_mesh(hierarchy, 1);
  const SurfaceQuery query(legs.character.skin.points, legs.character.skin.triangles);
  const LeafLimbs limbs(legs.lattice, hierarchy, mesh, legs.character.skin);
  const std::vector<FillFractions> all = fill_fractions(mesh, query, 0.01);
  const std::vector<FillFractions> own = fill_fractions(mesh, query, 0.01, &limbs);
  double flesh = 0.0;
  for (const auto& [place, copies] : places(legs.lattice))
    for (int corner = 0; corner < 4; ++corner)
      for (std::size_t octant = 0; octant < 8; ++octant) {
        double sum = 0.0;
        for (const CellCopy& copy : copies)
          sum += own[static_cast<std::size_t>(hierarchy.first_hex(copy.cell) + corner)][octant];
        // Sums of eight shares in another order.
        EXPECT_NEAR(sum, all[static_cast<std::size_t>(hierarchy.first_hex(place) + corner)][octant], 1e-13);
        flesh += sum;
      }
  EXPECT_GT(flesh, 10.0) << "no flesh in shared cells";
}

/// Largest jump of a field that takes a random value at every vertex of the lattice, along the edges of the
/// skin, each end in cells of its own frame.
double largest_jump(const ControlLattice& lattice, const tests::Character& character, std::mt19937_64& rng) {
  std::vector<double> values;
  for (Eigen::Index v = 0; v < lattice.complex.points.rows(); ++v)
    values.push_back(tests::uniform(rng, -1.0, 1.0));
  const LimbCopies copies(lattice);
  const auto value_at = [&](int frame, const Vector3d& p) {
    const int cell = own_cell(lattice, copies, frame, p);
    if (cell < 0) return std::numeric_limits<double>::quiet_NaN();
    const Vector4d weights = barycentric(lattice.complex, lattice.complex.cells[cell], p);
    double value = 0.0;
    for (int k = 0; k < 4; ++k) value += weights[k] * values[lattice.complex.cells[cell].vertices[k]];
    return value;
  };
  double largest = 0.0;
  const Surface& skin = character.skin;
  for (Eigen::Index t = 0; t < skin.triangles.rows(); t += 3) {
    const int a = skin.triangles(t, 0), b = skin.triangles(t, 1);
    const int frame_a = skin_frame(skin.weights[static_cast<std::size_t>(a)], lattice.frame_of_joint);
    const int frame_b = skin_frame(skin.weights[static_cast<std::size_t>(b)], lattice.frame_of_joint);
    const Vector3d middle = 0.5 * (skin.points.row(a) + skin.points.row(b)).transpose();
    largest = std::max(largest, std::abs(value_at(frame_a, middle) - value_at(frame_b, middle)));
  }
  return largest;
}

TEST(SeparateLimbs, TearsNoTriangleWhoseCornersHangOnTwoLimbs) {
  // Two bones side by side in one closed body: skin of one next to skin of the other, all the way down.
  tests::Character webbed;
  webbed.skin = tests::blob({0, 0, 0}, 30, 40, [](const Vector3d& d) {
    return 1.0 / std::sqrt((d.x() * d.x()) / (0.5 * 0.5) + d.y() * d.y() + (d.z() * d.z()) / (0.15 * 0.15));
  });
  const int root = webbed.add_joint("root", -1, {0, 0.9, 0});
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    const int hip = webbed.add_joint(name + "_hip", root, {0.25 * side, 0.7, 0});
    const int foot = webbed.add_joint(name + "_foot", hip, {0.25 * side, -0.7, 0});
    EXPECT_EQ(foot, hip + 1);
  }
  for (Eigen::Index v = 0; v < webbed.skin.points.rows(); ++v)
    webbed.skin.weights.push_back({{webbed.skin.points(v, 0) < 0.0 ? 1 : 3, 1.0}});
  const ControlLattice lattice = build(webbed.skin, webbed.joints, {.cells = 400}).lattice;
  std::mt19937_64 rng(3);
  // Values differ by 2 at most; the middle of an edge of the skin is one point of one cell, or of the common
  // vertices of two: rounding of the solve alone, amplified by the flattest cell.
  EXPECT_LT(largest_jump(lattice, webbed, rng), 1e-9);
}

}  // namespace
}  // namespace sinew::lattice
