#include "assets/lattice_cache.h"

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/lattice/shapes.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

class LatticeCache : public testing::Test {
 protected:
  void SetUp() override {
    root_ = tests::temporary_path("cache");
    fs::remove_all(root_);
    fs::create_directory(root_);
    folder_ = cache_folder((root_ / "out").string());
    skin_ = tests::blob({0, 1, 0}, 16, 10, [](const Vector3d& d) {
      return 1.0 / std::sqrt(d.y() * d.y() + (d.x() * d.x() + d.z() * d.z()) / (0.25 * 0.25));
    });
    joints_.positions.resize(2, 3);
    joints_.positions << 0, 0.2, 0, 0, 1.7, 0;
    joints_.parents = {-1, 0};
    joints_.names = {"arm", "hand"};
    skin_.weights.assign(static_cast<std::size_t>(skin_.points.rows()), {{0, 1.0}});
  }
  void TearDown() override {
    fs::permissions(root_, fs::perms::owner_all);
    fs::remove_all(root_);
  }

  CachedBuild build() const {
    CachedBuild built = build_lattice(folder_, skin_, joints_, options_);
    if (built.use == CacheUse::Built) keep_lattice(folder_, built.key, built.result, joints_);
    return built;
  }
  std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    if (fs::exists(folder_))
      for (const auto& entry : fs::directory_iterator(folder_)) found.push_back(entry.path());
    return found;
  }

  fs::path root_;
  std::string folder_;
  lattice::Surface skin_;
  lattice::JointTree joints_;
  lattice::BuildOptions options_{.cells = 60};
};

void expect_same_bits(const lattice::BuildResult& a, const lattice::BuildResult& b) {
  const lattice::ControlLattice &x = a.lattice, &y = b.lattice;
  ASSERT_EQ(x.complex.points.rows(), y.complex.points.rows());
  for (Eigen::Index i = 0; i < x.complex.points.size(); ++i)
    ASSERT_EQ(std::bit_cast<std::uint64_t>(x.complex.points.data()[i]),
              std::bit_cast<std::uint64_t>(y.complex.points.data()[i]));
  ASSERT_EQ(x.complex.cells.size(), y.complex.cells.size());
  for (std::size_t c = 0; c < x.complex.cells.size(); ++c) {
    EXPECT_EQ(x.complex.cells[c].type, y.complex.cells[c].type);
    EXPECT_EQ(x.complex.cells[c].vertices, y.complex.cells[c].vertices);
  }
  ASSERT_EQ(x.bones.size(), y.bones.size());
  for (std::size_t i = 0; i < x.bones.size(); ++i) {
    EXPECT_EQ(x.bones[i].chain, y.bones[i].chain);
    EXPECT_EQ(x.bones[i].rest_end, y.bones[i].rest_end);
  }
  EXPECT_EQ(x.frame_of_joint, y.frame_of_joint);
  EXPECT_EQ(x.edge_length, y.edge_length);
  EXPECT_EQ(x.retries, y.retries);
  EXPECT_EQ(x.quality.min_dihedral_degrees, y.quality.min_dihedral_degrees);
  EXPECT_EQ(x.quality.volume_ratio, y.quality.volume_ratio);
  EXPECT_EQ(x.quality.components, y.quality.components);
  ASSERT_EQ(a.failures.size(), b.failures.size());
  for (std::size_t i = 0; i < a.failures.size(); ++i) EXPECT_EQ(a.failures[i].what, b.failures[i].what);
}

TEST_F(LatticeCache, GivesTheSameBitsAsBuilding) {
  const CachedBuild built = build();
  EXPECT_EQ(built.use, CacheUse::Built);
  ASSERT_EQ(files().size(), 1u);
  const CachedBuild found = build();
  EXPECT_EQ(found.use, CacheUse::Hit);
  expect_same_bits(found.result, built.result);
  const CachedBuild off = build_lattice("", skin_, joints_, options_);
  EXPECT_EQ(off.use, CacheUse::Off);
  expect_same_bits(off.result, built.result);
}

TEST_F(LatticeCache, MissesWhenAnythingThatMadeTheLatticeChanges) {
  const std::string key = lattice_key(skin_, joints_, options_);
  const auto expect_other = [&](const auto& change) {
    lattice::Surface skin = skin_;
    lattice::JointTree joints = joints_;
    lattice::BuildOptions options = options_;
    change(skin, joints, options);
    EXPECT_NE(lattice_key(skin, joints, options), key);
  };
  EXPECT_EQ(lattice_key(skin_, joints_, options_), key);
  expect_other([](auto& skin, auto&, auto&) { skin.points(3, 1) = std::nextafter(skin.points(3, 1), 9.0); });
  expect_other([](auto& skin, auto&, auto&) { std::swap(skin.triangles(2, 0), skin.triangles(2, 1)); });
  expect_other([](auto& skin, auto&, auto&) { skin.weights[4][0].weight = 0.5; });
  expect_other([](auto& skin, auto&, auto&) { skin.weights[4][0].frame = 1; });
  expect_other([](auto&, auto& joints, auto&) { joints.positions(1, 2) = 1e-300; });
  expect_other([](auto&, auto& joints, auto&) { joints.names[1] = "paw"; });
  expect_other([](auto&, auto& joints, auto&) { joints.parents[1] = -1; });
  expect_other([](auto&, auto&, auto& options) { options.cells = 61; });
  expect_other([](auto&, auto&, auto& options) { options.cell_size = 0.1; });
  expect_other([](auto&, auto&, auto& options) { options.size_factors = {{1, 0.5}}; });
  expect_other([](auto&, auto&, auto& options) { options.grade = lattice::Grade::Off; });
  expect_other([](auto&, auto&, auto& options) { options.coarsen_rigid = lattice::CoarsenRigid::On; });
  expect_other([](auto&, auto&, auto& options) { options.include = {0}; });
  expect_other([](auto&, auto&, auto& options) { options.exclude = {0}; });
  expect_other([](auto&, auto&, auto& options) { options.tip_bones = lattice::TipBones::Off; });
  expect_other([](auto&, auto&, auto& options) { options.max_retries = 5; });
}

TEST_F(LatticeCache, RebuildsWhatIsDamagedWhereverItIs) {
  const CachedBuild built = build();
  const fs::path file = files().front();
  std::ostringstream whole;
  whole << std::ifstream(file, std::ios::binary).rdbuf();
  const std::string bytes = whole.str();
  const std::string key = lattice_key(skin_, joints_, options_);
  ASSERT_TRUE(find_lattice(folder_, key, joints_));
  for (std::size_t i = 0; i < bytes.size(); i += 101) {  // a prime, to meet every part of the file
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    std::ofstream(file, std::ios::binary) << damaged;
    EXPECT_FALSE(find_lattice(folder_, key, joints_)) << "byte " << i;
    std::ofstream(file, std::ios::binary) << bytes.substr(0, i);
    EXPECT_FALSE(find_lattice(folder_, key, joints_)) << "cut at " << i;
  }
  const CachedBuild again = build();
  EXPECT_EQ(again.use, CacheUse::Built);
  expect_same_bits(again.result, built.result);
  EXPECT_EQ(build().use, CacheUse::Hit);
}

TEST_F(LatticeCache, DoesNotTakeTheLatticeOfAnotherKey) {
  build();
  const fs::path file = files().front();
  options_.cells = 70;
  fs::rename(file, fs::path(folder_) / (lattice_key(skin_, joints_, options_) + ".lattice"));
  EXPECT_EQ(build().use, CacheUse::Built);
}

TEST_F(LatticeCache, AFolderThatCannotBeWrittenIsNoFailure) {
  // A file where the folder should be: this holds for the administrator, too.
  std::ofstream(folder_) << "mine";
  EXPECT_EQ(build().use, CacheUse::Built);
  EXPECT_TRUE(fs::is_regular_file(folder_));
  EXPECT_EQ(fs::file_size(folder_), 4u);
}

TEST_F(LatticeCache, KeepsTheSixteenThatWereStoredLast) {
  const CachedBuild built = build();
  for (int i = 0; i < 20; ++i)
    EXPECT_TRUE(keep_lattice(folder_, "key" + std::to_string(i), built.result, joints_));
  EXPECT_EQ(files().size(), 16u);
  EXPECT_TRUE(find_lattice(folder_, "key19", joints_));
}

TEST(CacheFolder, IsBesideTheOutput) {
  EXPECT_EQ(cache_folder("out"), ".sinew-cache");
  EXPECT_EQ(cache_folder("runs/out/"), "runs/.sinew-cache");
  EXPECT_EQ(cache_folder("runs/arm.vtu"), "runs/.sinew-cache");
}

}  // namespace
}  // namespace sinew::assets
