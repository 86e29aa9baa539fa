#include "assets/obj.h"

#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/pc2.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A file that lives as long as the object.
class TempFile {
 public:
  TempFile(const std::string& name, const std::string& bytes) : path_(tests::temporary_path(name)) {
    std::ofstream(path_, std::ios::binary) << bytes;
  }
  ~TempFile() { std::filesystem::remove(path_); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

NamedMesh triangle(const std::string& name) {
  NamedMesh mesh;
  mesh.name = name;
  mesh.points.resize(3, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 0, 0.1, 0;
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 2;
  return mesh;
}

TEST(ObjText, HasOneGroupPerPartAndCountsVerticesOverAll) {
  EXPECT_EQ(obj_text({triangle("body"), triangle("left eye")}, "rest mesh"),
            "# rest mesh\n"
            "g body\nv 0 0 0\nv 1 0 0\nv 0 0.1 0\nf 1 2 3\n"
            "g left_eye\nv 0 0 0\nv 1 0 0\nv 0 0.1 0\nf 4 5 6\n");
}

TEST(ObjText, BringsEveryFloatBack) {
  std::mt19937_64 rng(20021);
  NamedMesh mesh;
  mesh.points.resize(2000, 3);
  for (Eigen::Index i = 0; i < mesh.points.size(); ++i)
    mesh.points.data()[i] = std::ldexp(static_cast<double>(static_cast<std::int64_t>(rng())),
                                       -63 + static_cast<int>(rng() % 60) - 40);
  const TempFile file("floats.obj", obj_text({mesh}));
  const NamedMesh back = read_surface(file.path());
  EXPECT_TRUE(to_float(back.points) == to_float(mesh.points));
}

TEST(ObjText, RefusesBadNumbersAndIndices) {
  NamedMesh mesh = triangle("a");
  mesh.triangles(0, 1) = 3;
  EXPECT_THROW(obj_text({mesh}), std::invalid_argument);
  mesh = triangle("a");
  mesh.points(2, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(obj_text({mesh}), std::domain_error);
}

TEST(ReadSurface, KeepsTheOrderOfAnObjAndSplitsPolygons) {
  const TempFile file(
      "quad.OBJ",
      "# comment\r\nmtllib x.mtl\r\no a\r\nv 1 2 3 1.0\r\nv\t-1e-3 +0.5 7\r\nvn 0 0 1\r\nv 0 0 0\r\n"
      "f 1/1/1 2//1 3/2\r\nv 5 5 5\r\ng b\r\nf -4 -3 -2 -1\r\n");
  const NamedMesh mesh = read_surface(file.path());
  lattice::Points points(4, 3);
  points << 1, 2, 3, -1e-3, 0.5, 7, 0, 0, 0, 5, 5, 5;
  lattice::Triangles triangles(3, 3);
  triangles << 0, 1, 2, 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(mesh.points, points);
  EXPECT_EQ(mesh.triangles, triangles);
}

TEST(ReadSurface, ReadsTheThreeKindsOfPlyAlike) {
  const std::string head =
      "element vertex 3\ncomment a\nproperty uchar red\nproperty float x\nproperty float y\nproperty double "
      "z\n"
      "element face 1\nproperty list uchar int vertex_indices\nproperty short flags\nend_header\n";
  lattice::Points points(3, 3);
  points << 1, -2, 0.5, 0, 0, 0, 3, 0, -1;
  lattice::Triangles triangles(1, 3);
  triangles << 2, 0, 1;
  std::string little, big;
  const auto put = [&](auto value) {
    const auto* bytes = reinterpret_cast<const char*>(&value);
    little.append(bytes, sizeof value);
    big.append(
        std::string(std::make_reverse_iterator(bytes + sizeof value), std::make_reverse_iterator(bytes)));
  };
  for (int v = 0; v < 3; ++v) {
    put(static_cast<unsigned char>(200));
    put(static_cast<float>(points(v, 0)));
    put(static_cast<float>(points(v, 1)));
    put(points(v, 2));
  }
  put(static_cast<unsigned char>(3));
  for (const int corner : {2, 0, 1}) put(corner);
  put(static_cast<short>(-7));
  const TempFile text("a.ply",
                      "ply\nformat ascii 1.0\n" + head + "200 1 -2 0.5\n200 0 0 0\n200 3 0 -1\n3 2 0 1 -7\n");
  const TempFile le("b.ply", "ply\nformat binary_little_endian 1.0\n" + head + little);
  const TempFile be("c.ply", "ply\nformat binary_big_endian 1.0\n" + head + big);
  for (const TempFile* file : {&text, &le, &be}) {
    const NamedMesh mesh = read_surface(file->path());
    EXPECT_EQ(mesh.points, points) << file->path();
    EXPECT_EQ(mesh.triangles, triangles) << file->path();
  }
}

TEST(ReadSurface, SaysWhereAFileIsWrong) {
  const auto expect = [](const std::string& name, const std::string& bytes, const std::string& words) {
    const TempFile file(name, bytes);
    EXPECT_THAT([&] { read_surface(file.path()); },
                ThrowsMessage<InputError>(AllOf(HasSubstr(file.path()), HasSubstr(words))))
        << bytes;
  };
  expect("w.obj", "v 0 0 0\nv 0 1,5 0\n", ":2: vertex 1: got '1,5', expected a number");
  expect("w.obj", "v 0 0\n", ":1: vertex 0: got ''");
  expect("w.obj", "v 0 0 nan\n", "vertex 0: z is not finite");
  expect("w.obj", "v 0 0 1e999\n", ":1: vertex 0: got '1e999'");
  expect("w.obj", "v 0 0 0\nf 1 1\n", ":2: face: fewer than three corners");
  expect("w.obj", "v 0 0 0\nf 1 1 0\n", ":2: face: got '0'");
  expect("w.obj", "v 0 0 0\nf 1 1 2\n", "a face names vertex 1, expected 0 to 0");
  expect("w.obj", "v 0 0 0\nf 1 1 -2\n", "a face names vertex -1");
  expect("w.obj", "# nothing\n", "no vertices");
  expect("w.obj", "", "empty");
  expect("w.stl", "solid", "unknown extension");
  expect("w.ply", "PLY", "does not start with 'ply'");
  expect("w.ply", "ply\nformat ascii 1.0\n", "no end_header");
  expect("w.ply", "ply\nformat middle 1.0\nend_header\n", "format 'middle'");
  const std::string head =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n";
  expect("w.ply", head + std::string(20, '\0'), "vertex 1: the file ends before it");
  EXPECT_THROW(read_surface("/nonexistent/a.obj"), IoError);
  EXPECT_THAT([] { read_surface("/dev"); }, ThrowsMessage<InputError>(HasSubstr("extension")));
}

}  // namespace
}  // namespace sinew::assets
