#include "fem/skin/skin_judge.h"

#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "fem/body/frames.h"
#include "fem/skin/detail/nearest_rotation.h"
#include "tests/lattice/shapes.h"

namespace sinew::fem {
namespace {

using lattice::Points;
using lattice::Triangles;

/// A skin at rest, all of it flesh, and its judge.
struct Skin {
  Points rest;
  Triangles triangles;

  SkinJudge judge(double height = 1.0) const {
    const std::vector<bool> flesh(static_cast<std::size_t>(rest.rows()), true);
    const std::vector<Points> plain;
    return SkinJudge({rest, triangles, flesh, plain, height});
  }
  SkinFrame measure(const Points& flesh, const Points& plain) const {
    return judge().measure(flesh, plain, FrameKind::Later);
  }
  /// Plain skinning leaves it at rest.
  SkinFrame measure(const Points& flesh) const { return measure(flesh, rest); }
};

/// n x n squares of side 1/n in the plane z = 0, corner to corner, each of two triangles; vertex (i, j) is
/// number i (n + 1) + j at (i, j) / n.
Skin make_sheet(int n) {
  Skin sheet;
  sheet.rest.resize((n + 1) * (n + 1), 3);
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j)
      sheet.rest.row(i * (n + 1) + j) = Eigen::RowVector3d(i, j, 0.0) / static_cast<double>(n);
  }
  sheet.triangles.resize(2 * n * n, 3);
  for (int i = 0, t = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j, t += 2) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      sheet.triangles.row(t) << a, b, b + 1;
      sheet.triangles.row(t + 1) << a, b + 1, a + 1;
    }
  }
  return sheet;
}

/// A closed tube of radius 0.1 round the x axis from 0 to 1, of 40 rings of 12, its ends fans.
Skin make_tube() {
  constexpr int kRings = 40, kAround = 12;
  Skin tube;
  tube.rest.resize(kRings * kAround + 2, 3);
  std::vector<Eigen::RowVector3i> triangles;
  for (int i = 0; i < kRings; ++i) {
    for (int k = 0; k < kAround; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kAround;
      tube.rest.row(i * kAround + k) << i / (kRings - 1.0), 0.1 * std::cos(angle), 0.1 * std::sin(angle);
      const int a = i * kAround + k, b = i * kAround + (k + 1) % kAround;
      if (i + 1 == kRings) continue;
      triangles.emplace_back(a, b, b + kAround);
      triangles.emplace_back(a, b + kAround, a + kAround);
    }
  }
  const int left = kRings * kAround, right = left + 1, last = (kRings - 1) * kAround;
  tube.rest.row(left) << 0.0, 0.0, 0.0;
  tube.rest.row(right) << 1.0, 0.0, 0.0;
  for (int k = 0; k < kAround; ++k) {
    triangles.emplace_back(left, (k + 1) % kAround, k);
    triangles.emplace_back(right, last + k, last + (k + 1) % kAround);
  }
  tube.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    tube.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  return tube;
}

Points moved(const Points& x, const Eigen::Affine3d& map) {
  return (x * map.linear().transpose()).rowwise() + map.translation().transpose();
}

// Against the singular value decomposition: any matrix, flat ones (of a sheet), mirroring ones, lines.
TEST(NearestRotation, IsThatOfTheSingularValueDecomposition) {
  std::mt19937_64 rng(20021);
  for (int i = 0; i < 4000; ++i) {
    Eigen::Matrix3d m;
    for (int c = 0; c < 3; ++c) m.col(c) = tests::uniform_point(rng, -1.0, 1.0);
    if (i % 4 == 1) m.col(2) = m.col(0) - 0.5 * m.col(1);  // rank two
    if (i % 4 == 2) m *= std::pow(10.0, tests::uniform(rng, -20.0, 20.0));
    if (i % 4 == 3) m = (m * tests::uniform(rng, 0.0, 0.2) + Eigen::Matrix3d::Identity()).eval();
    const Eigen::Matrix3d found = detail::nearest_rotation(m);
    ASSERT_NEAR(found.determinant(), 1.0, 1e-12);
    ASSERT_NEAR((found.transpose() * found - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-12);
    // Where the two smallest singular values cancel (mirroring) many are as good: what is largest is the
    // same.
    const double best = (polar_rotation(m).transpose() * m).trace();
    ASSERT_NEAR((found.transpose() * m).trace(), best, 1e-12 * m.norm()) << m;
    const Eigen::Vector3d s = m.jacobiSvd().singularValues();
    const double gap = s[1] + (m.determinant() < 0.0 ? -s[2] : s[2]);
    if (gap > 1e-2 * m.norm()) {
      ASSERT_LT((found - polar_rotation(m)).norm(), 1e-9) << m;
    }
  }
  EXPECT_EQ(detail::nearest_rotation(Eigen::Matrix3d::Zero()), Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d line = Eigen::Vector3d(1, 2, 3) * Eigen::RowVector3d(1, 0, 0);
  EXPECT_NEAR(
      (detail::nearest_rotation(line) * Eigen::Vector3d::UnitX()).dot(Eigen::Vector3d(1, 2, 3).normalized()),
      1.0, 1e-12);
}

// What moves as a whole, or as plain skinning does, has no fault.
TEST(SkinJudge, FindsNothingWhereFleshMovesAsAWhole) {
  const Skin tube = make_tube();
  std::mt19937_64 rng(7);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d axis = tests::uniform_point(rng, -1.0, 1.0).normalized();
    const Eigen::Affine3d turn(Eigen::AngleAxisd(tests::uniform(rng, -3.0, 3.0), axis));
    const SkinFrame frame = tube.measure(moved(tube.rest, turn));
    EXPECT_EQ(frame.flipped + frame.stretched + frame.squeezed + frame.folds, 0);
    EXPECT_EQ(frame.torn_area, 0.0);
    EXPECT_EQ(frame.creases, 0.0);
    EXPECT_LT(frame.roughness, 1e-9);  // the nearest rotations' digits
    EXPECT_NEAR(frame.volume_ratio, 1.0, 1e-12);
    EXPECT_EQ(judge(frame, FrameKind::Later).verdict, SkinVerdict::Fine);
  }
}

// A tail that lags by a right angle points elsewhere, and is whole all the same.
TEST(SkinJudge, ATailThatLagsIsNotFlipped) {
  const Skin tube = make_tube();
  const auto bent = [&](double angle) {
    Points x = tube.rest;
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      // An arc: the cross-section at s turns by s angle.
      const double s = x(i, 0), y = x(i, 1), r = 1.0 / angle;
      x(i, 0) = (r - y) * std::sin(s * angle);
      x(i, 1) = r - (r - y) * std::cos(s * angle);
    }
    return x;
  };
  const SkinFrame frame = tube.measure(bent(1.2), bent(-1.2));  // 137 degrees apart at the tip
  EXPECT_EQ(frame.flipped, 0);
  EXPECT_EQ(frame.torn_area, 0.0);
  EXPECT_EQ(frame.creases, 0.0);
  EXPECT_GT(frame.away_most, 1.0);  // apart by 2 (1 - cos 1.2) / 1.2 = 1.06, beyond the tip's own radius
  EXPECT_EQ(judge(frame, FrameKind::Later).verdict, SkinVerdict::Fine);
  EXPECT_EQ(judge(frame, FrameKind::First).verdict, SkinVerdict::Torn);
  EXPECT_EQ(judge(frame, FrameKind::First).fault, SkinFault::FarAway);
}

// The middle vertex of a sheet of 6 x 6 squares, pulled within the plane across its neighbours: of the six
// triangles round it, those whose far side it passes turn over.
TEST(SkinJudge, CountsTheTrianglesThatAVertexPulledAcrossItsNeighboursTurnsOver) {
  const Skin sheet = make_sheet(6);
  const int middle = 3 * 7 + 3;
  Points x = sheet.rest;
  x.row(middle) += Eigen::RowVector3d(1.5, 0.25, 0.0) / 6.0;
  // By hand: signed areas in units of the square's, the middle at (1.5, 0.25) and its ring (1,0) (1,1) (0,1)
  // (-1,0) (-1,-1) (0,-1): twice the area of (m, a, b) is cross(a - m, b - m).
  const double m[2] = {1.5, 0.25};
  const double ring[6][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 0}, {-1, -1}, {0, -1}};
  int turned = 0;
  for (int k = 0; k < 6; ++k) {
    const double* a = ring[k];
    const double* b = ring[(k + 1) % 6];
    turned += (a[0] - m[0]) * (b[1] - m[1]) - (a[1] - m[1]) * (b[0] - m[0]) < 0.0;
  }
  ASSERT_EQ(turned, 2);
  const SkinFrame frame = sheet.measure(x);
  EXPECT_EQ(frame.flipped, turned);
  EXPECT_GE(frame.torn_area, turned / 72.0 - 1e-12);
  EXPECT_GE(frame.folds, 2);  // where the two meet those that lie as before
  EXPECT_NEAR(frame.away_most, std::hypot(1.5, 0.25) / 6.0, 1e-12);
  EXPECT_EQ(frame.farthest_vertex, middle);
  // Plain skinning that does the same is not charged to the flesh.
  EXPECT_EQ(sheet.measure(x, x).torn_area, 0.0);
  EXPECT_EQ(sheet.measure(x, x).folds, 0);
}

TEST(SkinJudge, CallsAreaTornOnBothSidesOfTheLimits) {
  const Skin sheet = make_sheet(4);
  const auto scaled = [&](double sx, double sy) {
    return moved(sheet.rest, Eigen::Affine3d(Eigen::Scaling(sx, sy, 1.0)));
  };
  EXPECT_EQ(sheet.measure(scaled(2.49, 1.0)).stretched, 0);
  EXPECT_EQ(sheet.measure(scaled(2.51, 1.0)).stretched, 32);
  EXPECT_NEAR(sheet.measure(scaled(2.51, 1.0)).torn_area, 1.0, 1e-15);
  EXPECT_EQ(sheet.measure(scaled(1.0, 0.21)).squeezed, 0);
  EXPECT_EQ(sheet.measure(scaled(1.0, 0.19)).squeezed, 32);
  // Against both: a rig that stretches by itself, and one whose skinning collapses altogether.
  EXPECT_EQ(sheet.measure(scaled(2.6, 1.0), scaled(2.0, 1.0)).stretched, 0);
  EXPECT_EQ(sheet.measure(scaled(1.0, 1.0), scaled(0.3, 1.0)).stretched, 0);
  EXPECT_EQ(sheet.measure(scaled(1.0, 1.0), scaled(0.0, 1.0)).torn_area, 0.0);
  EXPECT_EQ(sheet.measure(scaled(2.6, 1.0), scaled(0.0, 1.0)).stretched, 32);
}

// Half of a sheet of side 1 turned about its middle line by an angle: a crease as long as the line.
TEST(SkinJudge, MeasuresACreaseByItsLength) {
  const Skin sheet = make_sheet(6);
  const auto creased = [&](double degrees) {
    const double angle = degrees * std::numbers::pi / 180.0;
    Points x = sheet.rest;
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      const double beyond = x(i, 0) - 0.5;
      if (beyond > 0.0) x.row(i) << 0.5 + beyond * std::cos(angle), x(i, 1), beyond * std::sin(angle);
    }
    return x;
  };
  EXPECT_NEAR(sheet.measure(creased(31.0)).creases, 1.0, 1e-12);
  EXPECT_EQ(sheet.measure(creased(29.0)).creases, 0.0);
  EXPECT_NEAR(sheet.measure(creased(45.0), creased(14.0)).creases, 1.0, 1e-12);
  EXPECT_EQ(sheet.measure(creased(45.0), creased(16.0)).creases, 0.0);  // the rig's own crease
  EXPECT_NEAR(sheet.judge(2.0).measure(creased(45.0), sheet.rest, FrameKind::Later).creases, 0.5, 1e-12);
  EXPECT_EQ(sheet.measure(creased(120.0)).folds, 6);
  EXPECT_EQ(sheet.measure(creased(100.0)).folds, 0);
  const Eigen::Index worst = sheet.measure(creased(45.0)).worst_vertex;
  EXPECT_NEAR(sheet.rest(worst, 0), 0.5, 1e-12);
}

// One vertex lifted by b: its Laplacian changes by b, those of its six neighbours by b / 6 (all have six).
// With more than 0.5 % of the area round it, it is the measure; its edges are 1/n, 1/n and sqrt(2)/n.
TEST(SkinJudge, MeasuresABumpByTheChangeOfTheLaplacian) {
  const int n = 8, middle = 4 * (n + 1) + 4;
  const Skin sheet = make_sheet(n);
  Points x = sheet.rest;
  const double bump = 0.03;
  x(middle, 2) += bump;
  const double edge = (2.0 + std::sqrt(2.0)) / 3.0 / n;
  const SkinFrame frame = sheet.measure(x);
  EXPECT_NEAR(frame.roughness, bump / edge, 1e-9 * bump / edge);
  EXPECT_EQ(frame.worst_vertex, middle);
  EXPECT_EQ(frame.creases, 0.0);
}

// A part of the area moved off: the quantiles see it where its share is larger than theirs.
TEST(SkinJudge, MeasuresHowFarFleshIsFromPlainSkinning) {
  const Skin sheet = make_sheet(10);
  for (const int rows : {0, 1, 2}) {
    Points x = sheet.rest;
    for (int i = 0; i < rows; ++i) x.block(i * 11, 2, 11, 1).array() += 0.2;
    const SkinFrame frame = sheet.measure(x);
    // The first row has 5 % of the area round it, the second one 10 %.
    EXPECT_NEAR(frame.away_99, rows >= 1 ? 0.2 : 0.0, 1e-15) << rows;
    EXPECT_NEAR(frame.away_95, rows >= 2 ? 0.2 : 0.0, 1e-15) << rows;
    EXPECT_NEAR(frame.away_most, rows >= 1 ? 0.2 : 0.0, 1e-15) << rows;
  }
}

TEST(SkinJudge, MeasuresVolumeAgainstPlainSkinning) {
  const Skin tube = make_tube();
  const Eigen::Affine3d larger(Eigen::Scaling(1.1, 1.2, 1.3));
  EXPECT_NEAR(tube.measure(moved(tube.rest, larger)).volume_ratio, 1.1 * 1.2 * 1.3, 1e-12);
  EXPECT_NEAR(tube.measure(moved(tube.rest, larger)).volume_of_rest, 1.1 * 1.2 * 1.3, 1e-12);
}

// Copies of vertices along texture seams, the second side of a sheet, parts without flesh: nothing of them
// counts.
TEST(SkinJudge, SeesOneSkinThroughSeamsDoubledSheetsAndOtherParts) {
  const Skin sheet = make_sheet(6);
  Points x = sheet.rest;
  x.row(24) += Eigen::RowVector3d(1.5, 0.25, 0.3) / 6.0;
  const SkinFrame expected = sheet.measure(x);
  ASSERT_GT(expected.torn_area, 0.0);

  // Every triangle with corners of its own, all of them twice, once of either side; and a triangle elsewhere.
  const Eigen::Index n = sheet.triangles.rows();
  Points rest(6 * n + 3, 3), flesh(6 * n + 3, 3);
  Triangles triangles(2 * n + 1, 3);
  for (Eigen::Index t = 0; t < 2 * n; ++t) {
    for (int k = 0; k < 3; ++k) {
      const int corner = sheet.triangles(t % n, t < n ? k : 2 - k);
      rest.row(3 * t + k) = sheet.rest.row(corner);
      flesh.row(3 * t + k) = x.row(corner);
      triangles(t, k) = static_cast<int>(3 * t + k);
    }
  }
  rest.bottomRows(3) << 5, 0, 0, 6, 0, 0, 5, 1, 0;
  flesh.bottomRows(3) = rest.bottomRows(3);
  triangles.row(2 * n) << static_cast<int>(6 * n), static_cast<int>(6 * n + 1), static_cast<int>(6 * n + 2);
  std::vector<bool> is_flesh(static_cast<std::size_t>(6 * n + 3), true);
  for (int k = 0; k < 3; ++k) is_flesh[static_cast<std::size_t>(6 * n + k)] = false;
  const std::vector<Points> plain{rest};
  SkinJudge judge({rest, triangles, is_flesh, plain, 1.0});
  EXPECT_EQ(judge.num_triangles(), n);
  const SkinFrame frame = judge.measure(flesh, rest, FrameKind::Later);
  EXPECT_EQ(frame.flipped, expected.flipped);
  EXPECT_EQ(frame.stretched, expected.stretched);
  EXPECT_EQ(frame.folds, expected.folds);
  // Other orders of the same sums.
  EXPECT_NEAR(frame.torn_area, expected.torn_area, 1e-14);
  EXPECT_NEAR(frame.creases, expected.creases, 1e-13);
  EXPECT_NEAR(frame.roughness, expected.roughness, 1e-9);
  EXPECT_NEAR(rest(frame.farthest_vertex, 0), sheet.rest(24, 0), 1e-15);

  // Vertices that coincide at rest alone belong to two skins.
  Points apart = rest;
  apart.middleRows(3 * n, 3 * n).rowwise() += Eigen::RowVector3d(0.0, 0.0, 1.0);
  const SkinJudge both({rest, triangles, is_flesh, {apart}, 1.0});
  EXPECT_EQ(both.num_triangles(), 2 * n);
}

TEST(SkinJudge, GivesTheSameBitsForAnyNumberOfThreads) {
  const Skin tube = make_tube();
  std::mt19937_64 rng(5);
  Points x = tube.rest;
  for (Eigen::Index i = 0; i < x.rows(); ++i) x.row(i) += tests::uniform_point(rng, -0.1, 0.1).transpose();
  SkinJudge judge = tube.judge();
  const auto bits = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const SkinFrame f = judge.measure(x, tube.rest, FrameKind::Later);
    return std::vector<double>{
        f.torn_area,     f.creases,    f.roughness, f.volume_ratio,
        f.away_95,       f.away_99,    f.away_most, static_cast<double>(f.worst_vertex),
        1.0 * f.flipped, 1.0 * f.folds};
  };
  const std::vector<double> one = bits(1);
  EXPECT_GT(one[0], 0.0);
  EXPECT_EQ(one, bits(2));
  EXPECT_EQ(one, bits(4));
}

TEST(SkinJudge, RefusesWhatDoesNotFit) {
  const Skin sheet = make_sheet(2);
  const std::vector<bool> flesh(9, true), few(8, true);
  const std::vector<Points> none, short_one{Points::Zero(8, 3)};
  Triangles wrong = sheet.triangles;
  wrong(0, 0) = 9;
  EXPECT_THROW(SkinJudge({sheet.rest, sheet.triangles, flesh, none, 0.0}), std::invalid_argument);
  EXPECT_THROW(SkinJudge({sheet.rest, sheet.triangles, few, none, 1.0}), std::invalid_argument);
  EXPECT_THROW(SkinJudge({sheet.rest, sheet.triangles, flesh, short_one, 1.0}), std::invalid_argument);
  EXPECT_THROW(SkinJudge({sheet.rest, wrong, flesh, none, 1.0}), std::invalid_argument);
  EXPECT_THROW(sheet.judge().measure(sheet.rest.topRows(8), sheet.rest, FrameKind::Later),
               std::invalid_argument);
  // Nothing of flesh: nothing to find fault with.
  const std::vector<bool> rigid(9, false);
  const SkinFrame frame = SkinJudge({sheet.rest, sheet.triangles, rigid, none, 1.0})
                              .measure(sheet.rest, 2.0 * sheet.rest, FrameKind::First);
  EXPECT_EQ(judge(frame, FrameKind::First).verdict, SkinVerdict::Fine);
  EXPECT_EQ(frame.worst_vertex, -1);
}

TEST(SkinVerdict, IsTheWorstOfItsMeasures) {
  const auto verdict = [](double area, double creases, double roughness, double away, FrameKind kind) {
    SkinFrame frame;
    frame.torn_area = area;
    frame.creases = creases;
    frame.roughness = roughness;
    frame.away_most = away;
    return judge(frame, kind);
  };
  struct Row {
    double area, creases, roughness, away;
    FrameKind kind;
    SkinVerdict verdict;
    SkinFault fault;
  };
  using enum SkinVerdict;
  using enum SkinFault;
  const FrameKind first = FrameKind::First, later = FrameKind::Later;
  for (const Row& row :
       {Row{1.9e-4, 0.79, 0.5, 0.29, first, Fine, Creases}, Row{2e-4, 0.0, 0.0, 0.0, later, Rough, TornArea},
        Row{9.9e-4, 0.0, 0.0, 0.0, later, Rough, TornArea}, Row{1e-3, 0.0, 0.0, 0.0, later, Torn, TornArea},
        Row{0.0, 0.8, 0.0, 0.0, later, Rough, Creases}, Row{0.0, 2.0, 1.1, 0.0, later, Torn, Creases},
        Row{0.0, 0.0, 0.6, 0.0, later, Rough, Roughness}, Row{5e-4, 1.0, 1.2, 0.0, later, Torn, Roughness},
        Row{0.0, 0.0, 0.0, 0.3, first, Torn, FarAway}, Row{0.0, 0.1, 0.0, 5.0, later, Fine, Creases}}) {
    const Judgement found = verdict(row.area, row.creases, row.roughness, row.away, row.kind);
    EXPECT_EQ(found.verdict, row.verdict) << row.area << ' ' << row.creases << ' ' << row.roughness;
    EXPECT_EQ(found.fault, row.fault) << row.area << ' ' << row.creases << ' ' << row.roughness;
  }
}

TEST(SkinVerdict, OfARunIsThatOfItsWorstFrame) {
  std::vector<SkinFrame> frames(5);
  EXPECT_EQ(summarise(frames).judgement.verdict, SkinVerdict::Fine);
  EXPECT_EQ(summarise(frames).worst_frame, 0);
  frames[1].roughness = 1.1;   // rough, by 1.83 of the least
  frames[3].torn_area = 2e-3;  // torn, by 2
  frames[4].creases = 3.0;     // torn, by 1.5
  const SkinSummary run = summarise(frames);
  EXPECT_EQ(run.judgement.verdict, SkinVerdict::Torn);
  EXPECT_EQ(run.judgement.fault, SkinFault::TornArea);
  EXPECT_NEAR(run.judgement.severity, 2.0, 1e-12);
  EXPECT_EQ(run.worst_frame, 3);
  EXPECT_EQ(run.torn_frames, 2);
  EXPECT_EQ(summarise({}).worst_frame, -1);
}

}  // namespace
}  // namespace sinew::fem
