#include "fem/skin/skin_guard.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/fem/sheet.h"

namespace sinew::fem {
namespace {

using lattice::Points;

Points turned(const Points& x, double angle) {
  const Eigen::Matrix3d r =
      Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  return (x * r.transpose()).rowwise() + Eigen::RowVector3d(5, -3, 2);
}

TEST(SkinGuard, LeavesRigidMotionAndWholeFleshAsTheyAre) {
  const Sheet sheet(10);
  const SkinGuard guard(sheet.points, sheet.triangles);
  const Points plain = turned(sheet.points, 0.4);
  // Flesh that lags by a right angle as a whole, and flesh that swells by half.
  for (const Points& flesh : {turned(sheet.points, 2.0), Points(1.5 * plain)}) {
    Points skin = flesh;
    const Mended mended = guard.mend(plain, skin);
    EXPECT_TRUE(skin == flesh);
    EXPECT_EQ(mended.vertex, -1);
    EXPECT_EQ(mended.area, 0.0);
  }
}

TEST(SkinGuard, LaysAnOutlierBackAndTellsWhich) {
  const Sheet sheet(20);
  const SkinGuard guard(sheet.points, sheet.triangles);
  const int middle = 10 * 21 + 10;
  Points skin = sheet.points;
  skin.row(middle) += Eigen::RowVector3d(0, 0, 4);
  const Points torn = skin;
  const Mended mended = guard.mend(sheet.points, skin);
  EXPECT_EQ(mended.vertex, middle);
  // All round it agrees with plain skinning, so it goes back to it: what is left is a hundredth of the way.
  EXPECT_LE(skin.row(middle).z(), 0.04);
  EXPECT_NEAR(mended.largest, 4.0, 0.04);
  // Three rings fade, the fourth is not touched: at most 9 x 9 of the 20 x 20 units.
  EXPECT_GT(mended.area, 0.0);
  EXPECT_LE(mended.area, 81.0 / 400.0);
  for (int v = 0; v < skin.rows(); ++v) {
    const Eigen::RowVector3d way = (sheet.points.row(v) - sheet.points.row(middle)).cwiseAbs();
    if (way.maxCoeff() > 4.5) {
      EXPECT_TRUE(skin.row(v) == torn.row(v)) << v;
    }
  }
}

// Half of the sheet has gone with another limb: a tear of 6 units along a line of single edges. What flesh
// adds to plain skinning becomes a slope over the rings on both sides instead.
TEST(SkinGuard, SpreadsATear) {
  const Sheet sheet(24);
  const SkinGuard guard(sheet.points, sheet.triangles);
  Points skin = sheet.points;
  for (Eigen::Index v = 0; v < skin.rows(); ++v)
    if (skin(v, 0) > 12.5) skin(v, 0) += 6.0;
  const double before = longest_edge(sheet, skin);
  guard.mend(sheet.points, skin);
  EXPECT_NEAR(before, 7.0, 1e-12);
  EXPECT_LE(longest_edge(sheet, skin), 2.5);  // where an eye begins to call skin torn
}

// Plain skinning squeezes a band to a twentieth, and flesh adds a ripple that turns its triangles over. No
// smoothness helps there: what is left of the ripple would do.
TEST(SkinGuard, LaysSkinOnPlainSkinningThatCollapses) {
  const Sheet sheet(24);
  const SkinGuard guard(sheet.points, sheet.triangles);
  Points plain = sheet.points;
  for (Eigen::Index v = 0; v < plain.rows(); ++v) {
    const double x = plain(v, 0), band = std::clamp(x - 10.0, 0.0, 4.0);
    plain(v, 0) = x - 0.95 * band;
  }
  Points skin = plain;
  for (Eigen::Index v = 0; v < skin.rows(); ++v)
    skin(v, 0) -= 0.4 * std::sin(0.5 * sheet.points(v, 0)) * std::cos(0.3 * sheet.points(v, 1));
  const auto turned_over = [&](const Points& x) {
    int count = 0;
    for (Eigen::Index t = 0; t < sheet.triangles.rows(); ++t) {
      const Eigen::Vector3d a = x.row(sheet.triangles(t, 0)), b = x.row(sheet.triangles(t, 1)),
                            c = x.row(sheet.triangles(t, 2));
      count += (b - a).cross(c - a).z() < 0.0;
    }
    return count;
  };
  EXPECT_GT(turned_over(skin), 20);
  guard.mend(plain, skin);
  EXPECT_EQ(turned_over(skin), 0);
  EXPECT_GT((skin - plain).cwiseAbs().maxCoeff(), 0.3);  // far from the band the ripple stays
}

// A fold of 50 degrees along a grid line: a crease in a fine skin, and all that a coarse one has to bend by.
TEST(SkinGuard, LetsCoarseSkinBendByItsEdges) {
  for (const int n : {3, 24}) {
    const Sheet sheet(n);
    const SkinGuard guard(sheet.points, sheet.triangles);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(50.0 * M_PI / 180.0, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::RowVector3d hinge(n / 3, 0, 0);
    Points skin = sheet.points;
    for (Eigen::Index v = 0; v < skin.rows(); ++v)
      if (skin(v, 0) > hinge[0]) skin.row(v) = (skin.row(v) - hinge) * turn.transpose() + hinge;
    const Points bent = skin;
    EXPECT_EQ(guard.mend(sheet.points, skin).vertex >= 0, n == 24);
    EXPECT_EQ(skin == bent, n == 3);
  }
}

// Three rings of a coarse skin are half of it: what fades goes no farther than a tenth of its size. Here an
// edge is longer than that, so only the corners of what is wrong move.
TEST(SkinGuard, LeavesCoarseSkinBesideAFaultAsItIs) {
  const Sheet sheet(6);
  const SkinGuard guard(sheet.points, sheet.triangles);
  const int middle = 3 * 7 + 3;
  Points skin = sheet.points;
  skin.row(middle) += Eigen::RowVector3d(0, 0, 4);
  const Points torn = skin;
  guard.mend(sheet.points, skin);
  EXPECT_LE(skin(middle, 2), 0.5);
  for (Eigen::Index v = 0; v < skin.rows(); ++v) {
    const double away = (sheet.points.row(v) - sheet.points.row(middle)).cwiseAbs().maxCoeff();
    if (away > 1.5) {
      EXPECT_TRUE(skin.row(v) == torn.row(v)) << v;
    }
  }
}

TEST(SkinGuard, DoesNotPop) {
  const Sheet sheet(12);
  const SkinGuard guard(sheet.points, sheet.triangles);
  const int middle = 6 * 13 + 6;
  Points last;
  // In steps of a hundredth the mended place never moves by more than the flesh does.
  for (double lift = 0.0; lift < 3.0; lift += 0.01) {
    Points skin = sheet.points;
    skin(middle, 2) += lift;
    guard.mend(sheet.points, skin);
    if (last.rows() > 0) {
      EXPECT_LE((skin - last).rowwise().norm().maxCoeff(), 0.1) << lift;
    }
    last = skin;
  }
}

}  // namespace
}  // namespace sinew::fem
