// Laws of the builder over random trees of bones in random blobs. The number of rigs comes from CMake: 40 in
// every run, 500 in the nightly one.
#include "tests/lattice/random_rigs.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lattice/build.h"

namespace sinew::lattice {
namespace {

constexpr std::uint64_t kFirstSeed = SINEW_FIRST_SEED;
constexpr std::uint64_t kRigs = SINEW_NUM_RIGS;
/// Every so many rigs are also shuffled, scaled and turned: each costs three lattices more.
constexpr std::uint64_t kEvery = 4;

int cells_of(std::uint64_t seed) { return 120 + 90 * static_cast<int>(seed % 4); }

std::string text_of(const std::vector<GateFailure>& failures) {
  std::string text;
  for (const GateFailure& failure : failures) text += failure.what + "; ";
  return text;
}

/// Every bit of two lattices, the second of a rig that is `scale` times as large.
void expect_same(const ControlLattice& a, const ControlLattice& b, double scale) {
  ASSERT_EQ(a.complex.points.rows(), b.complex.points.rows());
  EXPECT_EQ(Points(scale * a.complex.points), b.complex.points);
  ASSERT_EQ(a.complex.cells.size(), b.complex.cells.size());
  for (std::size_t c = 0; c < a.complex.cells.size(); ++c)
    ASSERT_EQ(a.complex.cells[c].vertices, b.complex.cells[c].vertices);
  ASSERT_EQ(a.bones.size(), b.bones.size());
  for (std::size_t i = 0; i < a.bones.size(); ++i) {
    EXPECT_EQ(a.bones[i].chain, b.bones[i].chain);
    EXPECT_EQ(Eigen::Vector3d(scale * a.bones[i].rest_end), b.bones[i].rest_end);
  }
  ASSERT_EQ(a.soft_frames.size(), b.soft_frames.size());
  for (std::size_t i = 0; i < a.soft_frames.size(); ++i)
    EXPECT_EQ(Eigen::Vector3d(scale * a.soft_frames[i].position), b.soft_frames[i].position);
  ASSERT_EQ(a.copies.size(), b.copies.size());
  for (std::size_t i = 0; i < a.copies.size(); ++i) {
    EXPECT_EQ(a.copies[i].cell, b.copies[i].cell);
    EXPECT_EQ(a.copies[i].frames, b.copies[i].frames);
  }
}

class RandomRigs : public testing::TestWithParam<std::uint64_t> {
 protected:
  std::mt19937_64 rng_{GetParam()};
  tests::Character character_ = tests::random_blob(rng_);
  BuildOptions options_ = [] {
    BuildOptions options;
    options.cells = cells_of(GetParam());
    return options;
  }();
};

TEST_P(RandomRigs, PassTheGate) {
  const BuildResult result = build(character_.skin, character_.joints, options_);
  EXPECT_THAT(result.failures, testing::IsEmpty()) << text_of(result.failures);
  EXPECT_NO_THROW(validate(result.lattice));
  if (GetParam() % kEvery != 0) return;
  const tests::Character other = tests::shuffled(character_, rng_);
  expect_same(result.lattice, build(other.skin, other.joints, options_).lattice, 1.0);
  tests::Character scaled = character_;
  scaled.skin.points *= 0.125;
  scaled.joints.positions *= 0.125;
  expect_same(result.lattice, build(scaled.skin, scaled.joints, options_).lattice, 0.125);

  tests::Character turned = character_;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(tests::uniform(rng_, 0.0, 3.0), tests::uniform_point(rng_, -1.0, 1.0).normalized())
          .toRotationMatrix();
  const Eigen::RowVector3d shift = tests::uniform_point(rng_, -10.0, 10.0).transpose();
  turned.skin.points = (character_.skin.points * turn.transpose()).rowwise() + shift;
  turned.joints.positions = (character_.joints.positions * turn.transpose()).rowwise() + shift;
  const BuildResult moved = build(turned.skin, turned.joints, options_);
  EXPECT_THAT(moved.failures, testing::IsEmpty()) << text_of(moved.failures);
  // Like quality: the grid lies otherwise in the body, so another cell is the worst one.
  EXPECT_GT(moved.lattice.quality.min_dihedral_degrees, 0.4 * result.lattice.quality.min_dihedral_degrees);
  EXPECT_EQ(moved.lattice.is_grid, result.lattice.is_grid);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomRigs, testing::Range(kFirstSeed, kFirstSeed + kRigs));

}  // namespace
}  // namespace sinew::lattice
