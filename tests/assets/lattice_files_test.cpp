#include "assets/lattice_files.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/base64.h"
#include "assets/error.h"
#include "assets/medit.h"
#include "assets/vtu.h"
#include "lattice/build.h"
#include "tests/lattice/shapes.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;

/// An ellipsoid with two bones, as a rig would give it.
LatticeInput arm() {
  LatticeInput input;
  input.skin.surface = tests::blob({0, 1, 0}, 24, 16, [](const Vector3d& d) {
    return 1.0 / std::sqrt(d.y() * d.y() + (d.x() * d.x() + d.z() * d.z()) / (0.25 * 0.25));
  });
  input.joints.positions.resize(3, 3);
  input.joints.positions << 0, 0.2, 0, 0.01, 1, 0.02, 0, 1.7, 0;
  input.joints.parents = {-1, 0, 1};
  input.joints.names = {"upper", "lower", "hand"};
  for (int v = 0; v < input.skin.surface.points.rows(); ++v) {
    const double y = input.skin.surface.points(v, 1);
    const int frame = y < 1.0 ? 0 : y < 1.7 ? 1 : 2;
    input.skin.surface.weights.push_back({{frame, 1.0}});
  }
  return input;
}

lattice::ControlLattice lattice_of(const LatticeInput& input) {
  return lattice::build(input.skin.surface, input.joints, {.cells = 200}).lattice;
}

/// A file of this test, removed at the end.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name) : path_(testing::TempDir() + "sinew_lattice_" + name) {
    std::filesystem::remove(path_);
  }
  TemporaryFile(const std::string& name, const std::string& content) : TemporaryFile(name) {
    std::ofstream(path_, std::ios::binary) << content;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

void expect_same_bits(const Vector3d& a, const Vector3d& b) {
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(std::bit_cast<std::uint64_t>(a[k]), std::bit_cast<std::uint64_t>(b[k]));
}

void expect_same_cells(const lattice::CellComplex& a, const lattice::CellComplex& b) {
  ASSERT_EQ(a.points.rows(), b.points.rows());
  for (Eigen::Index v = 0; v < a.points.rows(); ++v)
    expect_same_bits(a.points.row(v).transpose(), b.points.row(v).transpose());
  ASSERT_EQ(a.cells.size(), b.cells.size());
  for (std::size_t c = 0; c < a.cells.size(); ++c) {
    EXPECT_EQ(a.cells[c].type, b.cells[c].type);
    EXPECT_EQ(a.cells[c].vertices, b.cells[c].vertices);
  }
}

TEST(Base64, MatchesTheVectorsOfRfc4648) {
  const std::pair<const char*, const char*> vectors[] = {
      {"", ""}, {"f", "Zg=="}, {"fo", "Zm8="}, {"foo", "Zm9v"}, {"foob", "Zm9vYg=="}, {"foobar", "Zm9vYmFy"}};
  for (const auto& [plain, coded] : vectors) {
    const std::vector<std::uint8_t> bytes(plain, plain + std::strlen(plain));
    EXPECT_EQ(detail::encode_base64(bytes), coded);
    EXPECT_EQ(detail::decode_base64(coded), bytes);
  }
  EXPECT_EQ(detail::decode_base64("Zg"), std::nullopt);
  EXPECT_EQ(detail::decode_base64("Z*=="), std::nullopt);
  EXPECT_EQ(detail::decode_base64("Z==="), std::nullopt);
}

TEST(LatticeFiles, VtuComesBackBitForBit) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  const TemporaryFile file("arm.vtu");
  write_lattice(file.path(), out, input.joints, Overwrite::Refuse);
  EXPECT_THROW(write_lattice(file.path(), out, input.joints, Overwrite::Refuse), BusyError);
  const lattice::ControlLattice in = read_lattice(file.path(), input);
  expect_same_cells(in.complex, out.complex);
  ASSERT_EQ(in.bones.size(), out.bones.size());
  for (std::size_t b = 0; b < in.bones.size(); ++b) {
    EXPECT_EQ(in.bones[b].name, out.bones[b].name);
    EXPECT_EQ(in.bones[b].frame, out.bones[b].frame);
    EXPECT_EQ(in.bones[b].chain, out.bones[b].chain);
    EXPECT_EQ(in.bones[b].soft, out.bones[b].soft);
    EXPECT_EQ(in.bones[b].tip, out.bones[b].tip);
    expect_same_bits(in.bones[b].rest_start, out.bones[b].rest_start);
    expect_same_bits(in.bones[b].rest_end, out.bones[b].rest_end);
    expect_same_bits(in.bones[b].start.x_a, out.bones[b].start.x_a);
    expect_same_bits(in.bones[b].end.x_b, out.bones[b].end.x_b);
    EXPECT_EQ(in.bones[b].start.joint_a, out.bones[b].start.joint_a);
    EXPECT_EQ(in.bones[b].end.joint_b, out.bones[b].end.joint_b);
  }
  EXPECT_EQ(in.frame_of_joint, out.frame_of_joint);
  EXPECT_EQ(in.soft_frames.size(), out.soft_frames.size());
  EXPECT_EQ(in.changes.size(), out.changes.size());
  EXPECT_EQ(in.edge_length, out.edge_length);
  EXPECT_EQ(in.quality.min_dihedral_degrees, out.quality.min_dihedral_degrees);
  EXPECT_EQ(in.quality.skin_vertices_outside, 0);
}

TEST(LatticeFiles, JointsOfAVtuAreFoundByName) {
  const LatticeInput input = arm();
  const TemporaryFile file("renamed.vtu");
  write_lattice(file.path(), lattice_of(input), input.joints, Overwrite::Refuse);
  LatticeInput other = input;
  other.joints.names[1] = "forearm";
  EXPECT_THAT(
      error_of([&] { read_lattice(file.path(), other); }),
      testing::EndsWith("array 'sinew_lattice': joint 'lower' is not in the rig; hint: take the rig that the "
                        "lattice was built for"));
}

TEST(LatticeFiles, MeditKeepsCellsAndBonesAreFoundAgain) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  const TemporaryFile file("arm.mesh");
  write_lattice(file.path(), out, input.joints, Overwrite::Refuse);
  const lattice::ControlLattice in = read_lattice(file.path(), input);
  expect_same_cells(in.complex, out.complex);
  ASSERT_EQ(in.bones.size(), out.bones.size());
  for (std::size_t b = 0; b < in.bones.size(); ++b)
    EXPECT_EQ(in.bones[b].chain, out.bones[b].chain) << out.bones[b].name;
}

TEST(LatticeFiles, ABoneWithoutAChainOfEdgesBecomesSoft) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  // Moves the elbow off its joint by 2 mm, far more than the tolerance of 1e-5 times 2 m.
  const int elbow = out.bones[0].chain.back();
  out.complex.points(elbow, 0) += 2e-3;
  const TemporaryFile file("moved.mesh");
  write_lattice(file.path(), out, input.joints, Overwrite::Refuse);
  const lattice::ControlLattice in = read_lattice(file.path(), input);
  EXPECT_TRUE(in.bones[0].soft);
  EXPECT_TRUE(in.bones[1].soft);
  EXPECT_THAT(in.changes, testing::Contains(testing::Field(&lattice::SkeletonChange::reason,
                                                           testing::HasSubstr("is no chain of edges"))));
}

TEST(LatticeFiles, RefusesOtherExtensions) {
  EXPECT_THROW(lattice_format("arm.stl"), ConfigError);
  EXPECT_EQ(lattice_format("a.b/arm.vtu"), LatticeFormat::Vtu);
}

/// One tetrahedron as another program might write it.
std::string ascii_vtu(const std::string& types, const std::string& points = "0 0 0  1 0 0  0 1 0  0 0 1") {
  return "<?xml version='1.0'?>\n<!-- by hand -->\n<VTKFile type='UnstructuredGrid' version='0.1' "
         "byte_order='LittleEndian'>\n<UnstructuredGrid>\n<Piece NumberOfPoints='4' "
         "NumberOfCells='1'>\n<Points>\n"
         "<DataArray type='Float32' NumberOfComponents='3' format='ascii'>" +
         points +
         "</DataArray>\n</Points>\n"
         "<Cells>\n<DataArray type='Int32' Name='connectivity' format='ascii'>0 1 2 3</DataArray>\n"
         "<DataArray type='Int32' Name='offsets' format='ascii'>4</DataArray>\n"
         "<DataArray type='UInt8' Name='types' format='ascii'>" +
         types +
         "</DataArray>\n</Cells>\n"
         "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

TEST(Vtu, ReadsAsciiFilesOfOtherPrograms) {
  const VtuGrid grid = parse_vtu("t.vtu", ascii_vtu("10"));
  ASSERT_EQ(grid.cells.size(), 1u);
  EXPECT_EQ(grid.points(3, 2), 1.0);
  EXPECT_THAT(parse_vtu("t.vtu", ascii_vtu("9")).cells, testing::IsEmpty());  // a quadrilateral is skipped
}

TEST(Vtu, NamesLineAndThingOfWhatIsWrong) {
  const auto parse = [](const std::string& text) { return error_of([&] { parse_vtu("t.vtu", text); }); };
  EXPECT_EQ(parse(ascii_vtu("14")),
            "t.vtu:12: cell 0: is a pyramid, whose apex has four edges; hint: split it into tetrahedra");
  EXPECT_EQ(parse(ascii_vtu("10 10")), "t.vtu:12: Cells: got 1 offsets and 2 types, expected 1 of each");
  EXPECT_EQ(parse(ascii_vtu("10", "0 0 0\n1 0 0\n0 1 x")), "t.vtu:9: array '': got 'x', expected a number");
  EXPECT_EQ(parse(ascii_vtu("10", "0 0 0 1 0 0 0 1 0 0 0 nan")), "t.vtu:7: array '': point 3 is not finite");
  EXPECT_EQ(parse(ascii_vtu("10", "0 0 0")),
            "t.vtu:7: array '': got 3 numbers, expected 3 for each of 4 points");
  EXPECT_EQ(parse("hello"),
            "t.vtu:1: there is no <VTKFile> element; hint: save as XML unstructured grid (.vtu)");
  const std::string whole = ascii_vtu("10");
  EXPECT_EQ(parse(whole.substr(0, whole.size() - 5)), "t.vtu:16: the file ends inside a tag");
  EXPECT_EQ(parse("<!DOCTYPE a [<!ENTITY x 'y'>]><VTKFile/>"),
            "t.vtu:1: document types and entities are not supported");
}

TEST(Vtu, EveryTruncationIsRefused) {
  const LatticeInput input = arm();
  const std::string text = format_lattice(LatticeFormat::Vtu, lattice_of(input), input.joints);
  const std::size_t end = text.rfind('>');
  for (std::size_t n = 0; n < end; n += 997)  // a prime, to hit tags and data alike
    EXPECT_THROW(parse_vtu("t.vtu", text.substr(0, n)), InputError) << n;
}

TEST(Vtu, RefusesArraysOfTheWrongLength) {
  VtuGrid grid;
  grid.points = lattice::Points::Zero(2, 3);
  grid.point_arrays = {{"speed", 3, std::vector<double>(5)}};
  EXPECT_THROW(format_vtu(grid), std::invalid_argument);
}

TEST(Medit, NamesLineAndThingOfWhatIsWrong) {
  const auto parse = [](const std::string& text) { return error_of([&] { parse_medit("t.mesh", text); }); };
  const std::string head =
      "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
  EXPECT_EQ(parse(head + "Tetrahedra\n1\n1 2 3 5 0\n"),
            "t.mesh:11: Tetrahedra: vertex, got 5, expected 1..4");
  EXPECT_EQ(parse(head + "Tetrahedra\n1\n1 2 3"), "t.mesh:11: Tetrahedra: the file ends in the middle");
  EXPECT_EQ(parse(head + "Tetrahedra\n99999\n"), "t.mesh:10: Tetrahedra: got 99999, expected 0..47");
  EXPECT_EQ(parse(head + "Pyramids\n1\n"),
            "t.mesh:10: Pyramids: their apex has four edges; hint: split them into tetrahedra");
  EXPECT_EQ(parse(head + "Blocks\n1\n"), "t.mesh:9: got 'Blocks', expected the name of a section");
  EXPECT_EQ(parse("MFEM mesh v1.0\n"),
            "t.mesh:1: got an MFEM mesh, expected a Medit mesh; hint: save it as .vtu");
  EXPECT_EQ(parse("MeshVersionFormatted 2\nVertices\n1\n0 0 nan 0\n"),
            "t.mesh:4: Vertices: vertex 1 is not finite");
  EXPECT_EQ(parse(head + "Triangles 1\n1 2 3 7\n# done\nEnd\n"), "no error");
}

TEST(LatticeFiles, CellsTurnedInsideOutAreTurnedBackAllOrNone) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  MeditMesh mesh{out.complex, {}};
  for (lattice::Cell& cell : mesh.complex.cells) std::swap(cell.vertices[0], cell.vertices[1]);
  const TemporaryFile turned("turned.mesh", format_medit(mesh));
  expect_same_cells(read_lattice(turned.path(), input).complex, out.complex);
  std::swap(mesh.complex.cells[7].vertices[0], mesh.complex.cells[7].vertices[1]);
  const TemporaryFile mixed("mixed.mesh", format_medit(mesh));
  EXPECT_THAT(error_of([&] { read_lattice(mixed.path(), input); }),
              testing::HasSubstr("cell 0: volume, got -"));
}

}  // namespace
}  // namespace sinew::assets
