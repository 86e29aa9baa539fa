#include "assets/lattice_files.h"

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/gmsh.h"
#include "assets/medit.h"
#include "assets/tetgen.h"
#include "assets/vega.h"
#include "assets/vtu.h"
#include "lattice/build.h"
#include "tests/assets/lattice_of_arm.h"
#include "tests/lattice/lattices.h"
#include "tests/lattice/shapes.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

using Eigen::Vector3d;

/// A file of this test, removed at the end.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name) : path_(tests::temporary_path(name)) {
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

/// For files of other programs: vertices that stand for bones are put back on them, (1 - s) a + s b of
/// coordinates below 2, which rounds at 4e-16 or less.
void expect_nearly_same_cells(const lattice::CellComplex& a, const lattice::CellComplex& b) {
  ASSERT_EQ(a.points.rows(), b.points.rows());
  EXPECT_LT((a.points - b.points).cwiseAbs().maxCoeff(), 1e-15);
  ASSERT_EQ(a.cells.size(), b.cells.size());
  for (std::size_t c = 0; c < a.cells.size(); ++c) EXPECT_EQ(a.cells[c].vertices, b.cells[c].vertices);
}

/// Every format with the file name that asks for it.
struct NamedFormat {
  const char* file;
  const char* format;
};
const NamedFormat kAllFormats[] = {
    {"a.vtu", "vtu"},          {"a.vtk", "vtk"},   {"b.vtk", "vtk-binary"},   {"a.msh", "msh41"},
    {"b.msh", "msh41-binary"}, {"c.msh", "msh22"}, {"d.msh", "msh22-binary"}, {"a.mesh", "mesh"},
    {"a.node", "tetgen"},      {"a.veg", "veg"}};

void expect_same_bones(const lattice::ControlLattice& in, const lattice::ControlLattice& out) {
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
}

void expect_same_lattice(const lattice::ControlLattice& in, const lattice::ControlLattice& out) {
  expect_same_cells(in.complex, out.complex);
  expect_same_bones(in, out);
  EXPECT_EQ(in.frame_of_joint, out.frame_of_joint);
  EXPECT_EQ(in.soft_frames.size(), out.soft_frames.size());
  EXPECT_EQ(in.changes.size(), out.changes.size());
  EXPECT_EQ(in.edge_length, out.edge_length);
  EXPECT_EQ(in.quality.min_dihedral_degrees, out.quality.min_dihedral_degrees);
  EXPECT_EQ(in.quality.volume_ratio, out.quality.volume_ratio);
  EXPECT_EQ(in.quality.skin_vertices_outside, 0);
  EXPECT_EQ(in.regions, out.regions);
  ASSERT_EQ(in.copies.size(), out.copies.size());
  for (std::size_t i = 0; i < in.copies.size(); ++i) {
    EXPECT_EQ(in.copies[i].cell, out.copies[i].cell);
    EXPECT_EQ(in.copies[i].place, out.copies[i].place);
    EXPECT_EQ(in.copies[i].frames, out.copies[i].frames);
  }
  ASSERT_EQ(in.region_names.size(), out.region_names.size());
  for (std::size_t r = 0; r < in.region_names.size(); ++r) {
    EXPECT_EQ(in.region_names[r].number, out.region_names[r].number);
    EXPECT_EQ(in.region_names[r].name, out.region_names[r].name);
  }
}

TEST(LatticeFiles, EveryFormatComesBackBitForBit) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  for (std::size_t c = 0; c < out.complex.cells.size(); ++c) out.regions.push_back(c % 3 == 0 ? 0 : 4);
  out.region_names = {{4, "muscle of \"two\" heads"}};
  for (const NamedFormat& format : kAllFormats) {
    SCOPED_TRACE(format.format);
    const TemporaryFile file(format.file), other(std::string("a.ele"));
    write_lattice(file.path(), out, input.joints, Overwrite::Refuse, {}, format.format);
    EXPECT_THROW(write_lattice(file.path(), out, input.joints, Overwrite::Refuse, {}, format.format),
                 BusyError);
    expect_same_lattice(read_lattice(file.path(), input), out);
  }
}

/// A box of wedges, hexahedra and tetrahedra with one bone along an edge, and a skin inside it.
struct MixedArm {
  LatticeInput input;
  lattice::ControlLattice lattice;
};
MixedArm mixed_arm() {
  MixedArm arm;
  lattice::ControlLattice& lattice = arm.lattice;
  lattice.complex = tests::lattices_of_every_kind(0.05).back().complex;
  const lattice::Cell& hexahedron =
      *std::find_if(lattice.complex.cells.begin(), lattice.complex.cells.end(),
                    [](const lattice::Cell& c) { return c.type == lattice::CellType::Hexahedron; });
  const int from = hexahedron.vertices[0], to = hexahedron.vertices[1];
  const Vector3d a = lattice.complex.points.row(from).transpose(),
                 b = lattice.complex.points.row(to).transpose();
  Vector3d mean = Vector3d::Zero();
  for (int v : hexahedron.vertices) mean += lattice.complex.points.row(v).transpose() / 8.0;
  arm.input.joints.positions.resize(2, 3);
  arm.input.joints.positions << a.transpose(), b.transpose();
  arm.input.joints.parents = {-1, 0};
  arm.input.joints.names = {"root", "end"};
  arm.input.skin.surface = tests::blob(mean, 8, 6, [](const Vector3d&) { return 0.1; });
  arm.input.skin.surface.weights.assign(static_cast<std::size_t>(arm.input.skin.surface.points.rows()),
                                        {{0, 1.0}});
  lattice::LatticeBone bone;
  bone.name = "root";
  bone.frame = 0;
  bone.start = {0, 0, a, a};
  bone.end = {1, 1, b, b};
  bone.rest_start = a;
  bone.rest_end = b;
  bone.chain = {from, to};
  lattice.bones = {bone};
  lattice.frame_of_joint = {0, 0};
  lattice.edge_length = 1.0 / 3.0;
  lattice.quality = lattice::measure_quality(lattice, arm.input.skin.surface);
  return arm;
}

TEST(LatticeFiles, MixedCellsComeBackBitForBitInTheirOrder) {
  const MixedArm arm = mixed_arm();
  for (const NamedFormat& format : kAllFormats) {
    SCOPED_TRACE(format.format);
    const TemporaryFile file(format.file);
    const auto write = [&] {
      write_lattice(file.path(), arm.lattice, arm.input.joints, Overwrite::Refuse, {}, format.format);
    };
    if (std::string(format.format) == "tetgen" || std::string(format.format) == "veg") {
      EXPECT_THROW(write(), ConfigError);
      EXPECT_FALSE(std::filesystem::exists(file.path()));
    } else {
      write();
      expect_same_lattice(read_lattice(file.path(), arm.input), arm.lattice);
    }
  }
}

TEST(LatticeFiles, CoincidentVerticesOfOurOwnLatticesAreNoFault) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  // A copy of a cell that shares three of its vertices, the fourth at the same place.
  lattice::Cell copy = out.complex.cells.back();
  std::vector<bool> on_bone(static_cast<std::size_t>(out.complex.points.rows()), false);
  for (const auto& bone : out.bones)
    for (int v : bone.chain) on_bone[static_cast<std::size_t>(v)] = true;
  int corner = 0;
  while (on_bone[static_cast<std::size_t>(copy.vertices[corner])]) ++corner;
  const Eigen::Index fresh = out.complex.points.rows();
  out.complex.points.conservativeResize(fresh + 1, 3);
  out.complex.points.row(fresh) = out.complex.points.row(copy.vertices[corner]).eval();
  copy.vertices[corner] = static_cast<int>(fresh);
  const auto place = static_cast<int>(out.complex.cells.size()) - 1;
  out.complex.cells.push_back(copy);
  out.copies = {{place, place, {0}}, {place + 1, place, {1}}};
  out.quality = lattice::measure_quality(out, input.skin.surface);
  for (const NamedFormat& format : kAllFormats) {
    SCOPED_TRACE(format.format);
    const TemporaryFile file(format.file), other(std::string("a.ele"));
    write_lattice(file.path(), out, input.joints, Overwrite::Refuse, {}, format.format);
    expect_same_lattice(read_lattice(file.path(), input), out);
  }
  // Somebody else's file has no such licence.
  const TemporaryFile file("foreign.mesh", format_medit({out.complex, {}, {}, {}, {}, {}, {}}));
  EXPECT_THAT(error_of([&] { read_lattice(file.path(), input); }), testing::HasSubstr("m from vertex "));
}

TEST(LatticeFiles, JointsOfAVtuAreFoundByName) {
  const LatticeInput input = arm();
  const TemporaryFile file("renamed.vtu");
  write_lattice(file.path(), lattice_of(input), input.joints, Overwrite::Refuse);
  LatticeInput other = input;
  other.joints.names[1] = "forearm";
  EXPECT_THAT(
      error_of([&] { read_lattice(file.path(), other); }),
      testing::EndsWith("'sinew_lattice': joint 'lower' is not in the rig; hint: take the rig that the "
                        "lattice was built for"));
}

/// The lattice as a program that knows nothing of Sinew would write it.
std::string foreign_text(const lattice::ControlLattice& lattice, const std::string& format) {
  VolumeMesh mesh;
  mesh.complex = lattice.complex;
  mesh.regions = lattice.regions;
  mesh.region_names = lattice.region_names;
  if (format == "msh41") return format_gmsh(mesh, GmshVersion::V41, Encoding::Ascii);
  if (format == "msh41-binary") return format_gmsh(mesh, GmshVersion::V41, Encoding::Binary);
  if (format == "msh22") return format_gmsh(mesh, GmshVersion::V22, Encoding::Ascii);
  if (format == "msh22-binary") return format_gmsh(mesh, GmshVersion::V22, Encoding::Binary);
  if (format == "mesh") return format_medit(mesh);
  if (format == "veg") return format_vega(mesh);
  VtuGrid grid;
  grid.points = lattice.complex.points;
  grid.cells = lattice.complex.cells;
  if (!lattice.regions.empty()) {
    grid.cell_arrays = {
        {"region", 1, std::vector<std::int64_t>(lattice.regions.begin(), lattice.regions.end())}};
  }
  if (format == "vtu") return format_vtu(grid);
  return format_vtk(grid, format == "vtk" ? Encoding::Ascii : Encoding::Binary);
}

TEST(LatticeFiles, BonesAreFoundInTheEdgesOfEveryForeignFormat) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  for (std::size_t c = 0; c < out.complex.cells.size(); ++c) out.regions.push_back(c % 2 == 0 ? 3 : 8);
  out.region_names = {{3, "fat"}, {8, "muscle"}};
  for (const NamedFormat& format : kAllFormats) {
    if (std::string(format.format) == "tetgen") continue;  // below
    SCOPED_TRACE(format.format);
    const TemporaryFile file(format.file, foreign_text(out, format.format));
    const lattice::ControlLattice in = read_lattice(file.path(), input);
    expect_nearly_same_cells(in.complex, out.complex);
    ASSERT_EQ(in.bones.size(), out.bones.size());
    for (std::size_t b = 0; b < in.bones.size(); ++b)
      EXPECT_EQ(in.bones[b].chain, out.bones[b].chain) << out.bones[b].name;
    // Vega numbers its sets itself.
    if (std::string(format.format) != "veg") {
      EXPECT_EQ(in.regions, out.regions);
    }
    const bool has_names = std::string(format.file).ends_with(".msh");
    ASSERT_EQ(in.region_names.size(), has_names ? 2u : std::string(format.format) == "veg" ? 2u : 0u);
    if (has_names) {
      EXPECT_EQ(in.region_names[1].name, "muscle");
    }
  }
}

TEST(LatticeFiles, TetgenFilesMayCountFromZeroOrFromOne) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  for (const int first : {0, 1}) {
    std::string node = fmt::format("# by hand\n{} 3 1 1\n", out.complex.points.rows()), ele;
    for (Eigen::Index v = 0; v < out.complex.points.rows(); ++v)
      node += fmt::format("{} {} {} {}  0.5 1\n", v + first, out.complex.points(v, 0),
                          out.complex.points(v, 1), out.complex.points(v, 2));
    ele = fmt::format("{} 4 0\n", out.complex.cells.size());
    for (std::size_t c = 0; c < out.complex.cells.size(); ++c) {
      const auto& v = out.complex.cells[c].vertices;
      // TetGen's own order: the other orientation.
      ele += fmt::format("{} {} {} {} {}\n", c + static_cast<std::size_t>(first), v[1] + first, v[0] + first,
                         v[2] + first, v[3] + first);
    }
    const TemporaryFile node_file("t.node", node), ele_file("t.ele", ele + "# end\n");
    expect_nearly_same_cells(read_lattice(node_file.path(), input).complex, out.complex);
    expect_nearly_same_cells(read_lattice(ele_file.path(), input).complex, out.complex);
  }
}

TEST(LatticeFiles, ABoneWithoutAChainOfEdgesIsRefusedUnlessItMayBeSoft) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  // Moves the elbow off its joint by 2 mm, far more than the tolerance of 1e-4 times 2 m.
  const int elbow = out.bones[0].chain.back();
  out.complex.points(elbow, 0) += 2e-3;
  const TemporaryFile file("moved.mesh", foreign_text(out, "mesh"));
  EXPECT_THAT(
      error_of([&] { read_lattice(file.path(), input); }),
      testing::AllOf(testing::HasSubstr("moved.mesh: bone 'upper': is no chain of edges: the nearest edge, "
                                        "from vertex "),
                     testing::HasSubstr("m from it, expected at most 0.0002 m (1 such bones more: "
                                        "'lower'); hint: ")));
  const lattice::ControlLattice in = read_lattice(file.path(), input, {.bones = {.soft_bones = true}});
  EXPECT_TRUE(in.bones[0].soft);
  EXPECT_TRUE(in.bones[1].soft);
  EXPECT_THAT(in.changes, testing::Contains(testing::Field(&lattice::SkeletonChange::reason,
                                                           testing::HasSubstr("is no chain of edges"))));
  // Snapping reaches it: 2 mm of 2 m are 1e-3.
  const lattice::ControlLattice snapped =
      read_lattice(file.path(), input, {.bones = {.snap_tolerance = 1.1e-3}});
  EXPECT_EQ(snapped.bones[0].chain, out.bones[0].chain);
  expect_same_bits(snapped.complex.points.row(elbow).transpose(), input.joints.positions.row(1).transpose());
}

TEST(LatticeFiles, SkinOutsideIsRefusedWithItsCountAndDistance) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  LatticeInput larger = input;
  larger.skin.surface.points.row(5) += Eigen::RowVector3d(0, 0, 3);
  for (const char* name : {"own.vtu", "foreign.vtu"}) {
    const bool own = std::string(name) == "own.vtu";
    const TemporaryFile file(
        name, own ? format_lattice(LatticeFormat::Vtu, out, input.joints) : foreign_text(out, "vtu"));
    EXPECT_THAT(
        error_of([&] { read_lattice(file.path(), larger); }),
        testing::ContainsRegex("1 of [0-9]+ skin vertices lie outside the lattice, the farthest, 5, by "
                               "2\\.[0-9]+ m: 5; hint: "));
  }
}

TEST(LatticeFiles, APartThatNoBoneReachesIsRefusedWithItsCells) {
  const LatticeInput input = arm();
  lattice::ControlLattice out = lattice_of(input);
  const auto cell = static_cast<int>(out.complex.cells.size()),
             vertex = static_cast<int>(out.complex.points.rows());
  out.complex.points.conservativeResize(vertex + 4, 3);
  out.complex.points.bottomRows(4) << 5, 0, 0, 6, 0, 0, 5, 1, 0, 5, 0, 1;
  out.complex.cells.push_back(
      {lattice::CellType::Tetrahedron, {vertex, vertex + 1, vertex + 2, vertex + 3, -1, -1, -1, -1}});
  const TemporaryFile file("parts.vtu", foreign_text(out, "vtu"));
  EXPECT_THAT(
      error_of([&] { read_lattice(file.path(), input); }),
      testing::HasSubstr(fmt::format("parts.vtu: cell {0}: belongs to a part of 1 cells that no bone reaches "
                                     "(1 of 2 parts; its cells: {0}); hint: ",
                                     cell)));
}

TEST(LatticeFiles, RefusesOtherExtensions) {
  EXPECT_THROW(lattice_format("arm.stl"), ConfigError);
  EXPECT_THROW(lattice_format("arm.msh", "vtk"), ConfigError);
  EXPECT_EQ(lattice_format("arm.MSH", "msh22-binary"), LatticeFormat::Gmsh22Binary);
  EXPECT_EQ(lattice_format("a.b/arm.vtu"), LatticeFormat::Vtu);
}

TEST(LatticeFiles, CellsOfEitherOrientationAreTurnedOneByOne) {
  const LatticeInput input = arm();
  const lattice::ControlLattice out = lattice_of(input);
  lattice::ControlLattice turned = out;
  for (std::size_t c = 0; c < turned.complex.cells.size(); c += 3)
    std::swap(turned.complex.cells[c].vertices[0], turned.complex.cells[c].vertices[1]);
  const TemporaryFile file("turned.mesh", foreign_text(turned, "mesh"));
  expect_nearly_same_cells(read_lattice(file.path(), input).complex, out.complex);
}

}  // namespace
}  // namespace sinew::assets
