// Files of cells as other programs write them, and damaged ones.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/gmsh.h"
#include "assets/tetgen.h"
#include "assets/vega.h"
#include "assets/vtu.h"
#include "lattice/box.h"

namespace sinew::assets {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no error";
}

std::string gmsh_error(const std::string& text) {
  return error_of([&] { parse_gmsh("t.msh", text); });
}

/// One tetrahedron of every format, with nodes of odd numbers.
const std::string kGmsh22 =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"belly, left\"\n$EndPhysicalNames\n"
    "$Nodes\n4\n10 0 0 0\n12 1 0 0\n14 0 1 0\n16 0 0 1\n$EndNodes\n"
    "$Elements\n3\n1 15 2 0 1 10\n5 2 2 0 1 10 12 14\n9 4 2 7 1 10 12 14 16\n$EndElements\n";
const std::string kGmsh41 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Comments\nfree text\n$EndComments\n"
    "$PhysicalNames\n1\n3 7 \"belly, left\"\n$EndPhysicalNames\n"
    "$Entities\n1 0 0 1\n1 0 0 0 0\n3 0 0 0 1 1 1 2 7 8 0\n$EndEntities\n"
    "$Nodes\n2 4 10 16\n0 1 0 1\n10\n0 0 0\n3 3 1 3\n12\n14\n16\n1 0 0 .1 .2 .3\n0 1 0 .1 .2 .3\n0 0 1 .1 .2 "
    ".3\n"
    "$EndNodes\n$Elements\n2 2 1 9\n0 1 15 1\n1 10\n3 3 4 1\n9 10 12 14 16\n$EndElements\n";

TEST(Gmsh, PhysicalGroupsBecomeRegionsAndNumbersAreKept) {
  for (const std::string& text : {kGmsh22, kGmsh41}) {
    const VolumeMesh mesh = parse_gmsh("t.msh", text);
    ASSERT_EQ(mesh.complex.cells.size(), 1u);
    EXPECT_THAT(mesh.complex.cells[0].vertices, ElementsAre(0, 1, 2, 3, -1, -1, -1, -1));
    EXPECT_EQ(mesh.complex.points(3, 2), 1.0);
    EXPECT_THAT(mesh.regions, ElementsAre(7));
    ASSERT_EQ(mesh.region_names.size(), 1u);
    EXPECT_EQ(mesh.region_names[0].name, "belly, left");
    EXPECT_THAT(mesh.numbering.cells, ElementsAre(9));
    EXPECT_THAT(mesh.numbering.vertices, ElementsAre(10, 12, 14, 16));
  }
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Gmsh, NamesLineAndThingOfWhatIsWrong) {
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "10 12 14 16\n$End", "10 12 14 17\n$End")),
            "t.msh:19: cell 9: node, got 17, expected one of $Nodes");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "9 4 2 7 1 10 12 14 16", "9 7 2 7 1 10 12 14 16 10")),
            "t.msh:19: cell 9: is a pyramid, whose apex has four edges; hint: split it into tetrahedra");
  EXPECT_EQ(
      gmsh_error(replaced(kGmsh22, "9 4 2", "9 11 2")),
      "t.msh:19: cell 9: Gmsh element type, got 11, expected 4 (tetrahedron), 5 (hexahedron) or 6 (prism); "
      "hint: mesh with -order 1");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "12 1 0 0", "10 1 0 0")),
            "t.msh:13: $Nodes: node 10 is there twice");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "$Nodes\n4", "$Nodes\n4000000000")),
            "t.msh:9: $Nodes: announces 4000000000 entries, but the 127 bytes that follow hold at most 16");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "2.2 0 8", "4 0 8")),
            "t.msh:2: $MeshFormat: version, got '4', expected 2.2 or 4.1; hint: save with -format msh41");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "14 0 1 0", "14 0 inf 0")),
            "t.msh:12: $Nodes: got inf, expected a finite number");
  EXPECT_EQ(gmsh_error(replaced(kGmsh22, "$EndElements", "")),
            "t.msh:19: $Elements: the file ends before $EndElements");
  EXPECT_EQ(gmsh_error("hello\n"), "t.msh:1: got 'hello', expected a section like '$MeshFormat'");
  EXPECT_EQ(gmsh_error(replaced(kGmsh41, "2 2 1 9", "2 3 1 9")),
            "t.msh:34: $Elements: got 2 elements, expected 3");
}

/// Hexahedra, wedges and tetrahedra, for a file with something of everything.
VolumeMesh boxes() {
  using lattice::CellType;
  VolumeMesh mesh;
  mesh.complex =
      lattice::box_lattice({{0, 0, 0},
                            {2, 1, 2},
                            {2, 1, 2},
                            CellType::Hexahedron,
                            {CellType::Hexahedron, CellType::Wedge, std::nullopt, CellType::Tetrahedron}});
  for (std::size_t c = 0; c < mesh.complex.cells.size(); ++c)
    mesh.regions.push_back(static_cast<int>(c % 2) + 1);
  mesh.region_names = {{1, "odd"}, {2, "even"}};
  mesh.lines = {{{0, 1}, 1}};
  mesh.line_names = {"bone"};
  return mesh;
}

TEST(Gmsh, EveryTruncationOfEveryVariantIsRefused) {
  for (const GmshVersion version : {GmshVersion::V22, GmshVersion::V41})
    for (const Encoding encoding : {Encoding::Ascii, Encoding::Binary}) {
      const std::string text = format_gmsh(boxes(), version, encoding);
      EXPECT_EQ(parse_gmsh("t.msh", text).complex.cells.size(), boxes().complex.cells.size());
      for (std::size_t n = 0; n + 12 < text.size(); ++n)  // "$EndElements" counts without its last letter
        EXPECT_THROW(parse_gmsh("t.msh", text.substr(0, n)), InputError) << n;
    }
}

/// Every byte of a binary file changed in turn: an error or a mesh with valid indices, never a crash.
template <class Parse>
void expect_no_crash(std::string text, const Parse& parse) {
  for (std::size_t i = 0; i < text.size(); ++i)
    for (const char change : {'\x01', '\x80', '\x7f'}) {
      const char old = text[i];
      text[i] = static_cast<char>(text[i] ^ change);
      try {
        const lattice::CellComplex complex = parse(text);
        for (const lattice::Cell& cell : complex.cells)
          for (int k = 0; k < num_corners(cell.type); ++k) {
            ASSERT_GE(cell.vertices[k], 0);
            ASSERT_LT(cell.vertices[k], complex.points.rows());
          }
      } catch (const InputError&) {
      } catch (const LimitError&) {
      }
      text[i] = old;
    }
}

TEST(VolumeFormats, DamagedBytesNeverCrash) {
  const VolumeMesh mesh = boxes();
  for (const GmshVersion version : {GmshVersion::V22, GmshVersion::V41})
    expect_no_crash(format_gmsh(mesh, version, Encoding::Binary),
                    [](const std::string& text) { return parse_gmsh("t.msh", text).complex; });
  VtuGrid grid;
  grid.points = mesh.complex.points;
  grid.cells = mesh.complex.cells;
  grid.cell_arrays = {{"region", 1, std::vector<std::int64_t>(grid.cells.size(), 2)}};
  expect_no_crash(format_vtk(grid, Encoding::Binary), [](const std::string& text) {
    VtuGrid read = parse_vtk("t.vtk", text);
    return lattice::CellComplex{read.points, read.cells};
  });
}

TEST(Tetgen, NamesFileLineAndThingOfWhatIsWrong) {
  const std::string node = "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n", ele = "1 4 1\n1 1 2 3 4 6\n";
  const auto parse = [](const std::string& n, const std::string& e) {
    return error_of([&] { parse_tetgen("t.node", n, "t.ele", e); });
  };
  EXPECT_THAT(parse_tetgen("t.node", node, "t.ele", ele).regions, ElementsAre(6));
  EXPECT_EQ(parse(node, "1 4 0\n1 1 2 3 5\n"), "t.ele:2: cell 1: vertex: got 5, expected 1..4");
  EXPECT_EQ(parse(node, "1 4 0\n1 0 2 3 4\n"), "t.ele:2: cell 1: vertex: got 0, expected 1..4");
  EXPECT_EQ(parse(node, "1 10 0\n1 1 2 3 4 1 1 1 1 1 1\n"),
            "t.ele:1: vertices per tetrahedron: got 10, expected 4; hint: run TetGen without -o2");
  EXPECT_EQ(parse(node, "7000 4 0\n"),
            "t.ele:1: number of tetrahedra: announces 7000 entries, but the 5 bytes that "
            "follow hold at most 0");
  EXPECT_EQ(parse("2 3 0 0\n1 0 0 0\n3 1 0 0\n", ele), "t.node:3: number of a vertex: got 3, expected 2..2");
  EXPECT_EQ(parse(node + "5 1 1 1\n", ele), "t.node:6: got '5' behind the last entry");
  EXPECT_EQ(parse("1 2 0 0\n1 0 0\n", ele), "t.node:1: dimension: got 2, expected 3");
}

TEST(Vega, SetsWithAMaterialBecomeRegions) {
  const std::string head =
      "# Vega\n*VERTICES\n5 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n"
      "\n*ELEMENTS\nTET\n2 4 0\n1 1 2 3 4\n2 2 3 4 5\n";
  const std::string tail =
      "*MATERIAL a\nENU, 1000, 1e5, 0.45\n*SET fat\n2,\n*REGION\nallElements, a\n*REGION\nfat, a\n";
  const VolumeMesh mesh = parse_vega("t.veg", head + tail);
  EXPECT_THAT(mesh.regions, ElementsAre(0, 2));
  ASSERT_EQ(mesh.region_names.size(), 1u);
  EXPECT_EQ(mesh.region_names[0].name, "fat");
  const auto parse = [](const std::string& text) { return error_of([&] { parse_vega("t.veg", text); }); };
  EXPECT_EQ(parse(head + "*SET fat\n3\n*REGION\nfat, a\n"), "t.veg:18: *SET fat: cell, got 3, expected 1..2");
  EXPECT_EQ(parse(head + "*REGION\nskin, a\n"), "t.veg:16: *REGION: there is no set 'skin'");
  EXPECT_EQ(parse(head + "*INCLUDE other.veg\n"),
            "t.veg:15: got '*INCLUDE other.veg', expected *VERTICES, *ELEMENTS, *MATERIAL, *SET or *REGION");
  EXPECT_EQ(parse(replaced(head, "2 2 3 4 5", "2 2 3 4 6")),
            "t.veg:14: cell 2: vertex: got 6, expected 1..5");
  EXPECT_EQ(parse(replaced(head, "TET", "WEDGE")), "t.veg:11: *ELEMENTS: got 'WEDGE', expected TET or CUBIC");
}

/// Two tetrahedra of regions 7 and 9, written by VTK 9.1.
TEST(Vtu, ReadsZlibBlocksThatVtkWrote) {
  const std::string text =
      "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\" header_type=\"UInt32\" "
      "compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"5\" "
      "NumberOfCells=\"2\">\n<CellData>\n<DataArray type=\"Int32\" Name=\"region\" format=\"binary\">\n"
      "AQAAAACAAAAIAAAADgAAAA==eF5jZ2Bg4ARiAABkABE=\n</DataArray>\n</CellData>\n<Points>\n"
      "<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"binary\">\n"
      "AQAAAACAAAB4AAAAIAAAAA==eF5jYMAHPtjjlSZCPhQMrtrPmgkCO6HqP+wHAEhDDN4=\n</DataArray>\n</Points>\n"
      "<Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"binary\">\n"
      "AQAAAACAAABAAAAAGwAAAA==eF5jYIAARijNBKWZGVABTBymjgVKAwABsAAO\n</DataArray>\n"
      "<DataArray type=\"Int64\" Name=\"offsets\" format=\"binary\">\n"
      "AQAAAACAAAAQAAAADgAAAA==eF5jYYAADigNAACQAA0=\n</DataArray>\n"
      "<DataArray type=\"UInt8\" Name=\"types\" "
      "format=\"binary\">\nAQAAAACAAAACAAAACgAAAA==eF7j4gIAACAAFQ==\n"
      "</DataArray>\n</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
  const VtuGrid grid = parse_vtu("t.vtu", text);
  ASSERT_EQ(grid.cells.size(), 2u);
  EXPECT_THAT(grid.cells[1].vertices, ElementsAre(0, 2, 1, 4, -1, -1, -1, -1));
  EXPECT_EQ(grid.points(4, 0), 1.0 / 3.0);
  ASSERT_EQ(grid.cell_arrays.size(), 1u);
  EXPECT_THAT(std::get<std::vector<std::int64_t>>(grid.cell_arrays[0].values), ElementsAre(7, 9));
  // Two letters of packed data changed: no longer what zlib made.
  EXPECT_EQ(error_of([&] { parse_vtu("t.vtu", replaced(text, "eF5jYIAARij", "eF5jYAIARij")); }),
            "t.vtu:15: array 'connectivity': block 0 of the compressed data is damaged");
  // A block of 2^31 bytes in 14 bytes of data.
  EXPECT_EQ(error_of([&] {
              parse_vtu("t.vtu", replaced(text, "AQAAAACAAAAQAAAADgAAAA==", "AQAAAAAAAIAAAACADgAAAA=="));
            }),
            "t.vtu:18: array 'offsets': 14 bytes of compressed data cannot hold 2147483648 bytes");
  EXPECT_EQ(error_of([&] { parse_vtu("t.vtu", replaced(text, "vtkZLib", "vtkLZ4")); }),
            "t.vtu:1: VTKFile: compressor, got 'vtkLZ4DataCompressor', expected 'vtkZLibDataCompressor' or "
            "none; hint: "
            "save with ZLib or without compression");
}

TEST(Vtu, ReadsAppendedBigEndianDataThatVtkWrote) {
  const std::string text =
      "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"BigEndian\" header_type=\"UInt64\" "
      "compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"5\" "
      "NumberOfCells=\"2\">\n"
      "<CellData>\n<DataArray type=\"Int32\" Name=\"region\" format=\"appended\" "
      "offset=\"0\"/>\n</CellData>\n<Points>\n"
      "<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"appended\" "
      "offset=\"68\"/>\n"
      "</Points>\n<Cells>\n"
      "<DataArray type=\"Int64\" Name=\"connectivity\" format=\"appended\" offset=\"156\"/>\n"
      "<DataArray type=\"Int64\" Name=\"offsets\" format=\"appended\" offset=\"232\"/>\n"
      "<DataArray type=\"UInt8\" Name=\"types\" format=\"appended\" offset=\"300\"/>\n"
      "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"base64\">\n   "
      "_AAAAAAAAAAEAAAAAAACAAAAAAAAAAAAIAAAAAAAAABA=eF5jYGBgZ2Bg4AQAADQAEQ=="
      "AAAAAAAAAAEAAAAAAACAAAAAAAAAAAB4AAAA"
      "AAAAAB8=eF5jYMAO7D/"
      "gkCBR3v5qKBjY75wJArP2Q8UBZXAM3g==AAAAAAAAAAEAAAAAAACAAAAAAAAAAABAAAAAAAAAABg=eF5jYEABjFCa"
      "CUozo0rDxWHqWAABVQAOAAAAAAAAAAEAAAAAAACAAAAAAAAAAAAQAAAAAAAAABA=eF5jYAADFgjFwAEAADwADQ=="
      "AAAAAAAAAAEAAAAAAACA"
      "AAAAAAAAAAACAAAAAAAAAAo=eF7j4gIAACAAFQ==\n  </AppendedData>\n</VTKFile>\n";
  const VtuGrid grid = parse_vtu("t.vtu", text);
  ASSERT_EQ(grid.cells.size(), 2u);
  EXPECT_THAT(grid.cells[1].vertices, ElementsAre(0, 2, 1, 4, -1, -1, -1, -1));
  EXPECT_EQ(grid.points(4, 0), 1.0 / 3.0);
  EXPECT_THAT(std::get<std::vector<std::int64_t>>(grid.cell_arrays[0].values), ElementsAre(7, 9));
  EXPECT_EQ(error_of([&] { parse_vtu("t.vtu", replaced(text, "offset=\"300\"", "offset=\"3000\"")); }),
            "t.vtu:13: array 'types': offset, got '3000', expected 0..363");
}

/// The same two tetrahedra as VTK 9.1 writes version 5.1.
TEST(VtkLegacy, ReadsVersion51AndItsMetadata) {
  const std::string text =
      "# vtk DataFile Version 5.1\nvtk output\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n0 0 0 1 0 "
      "0 0 1 0 \n"
      "0 0 1 0.33333333333 0.1 -1 \nMETADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA "
      "2 0 1.05883 "
      "\n\nCELLS 3 8\nOFFSETS vtktypeint64\n0 4 8 \nCONNECTIVITY vtktypeint64\n0 1 2 3 0 2 1 4 \nCELL_TYPES "
      "2\n10\n10\n"
      "\nCELL_DATA 2\nSCALARS dose float 1\nLOOKUP_TABLE default\n1.5 2.5\nFIELD FieldData 1\nregion 1 2 "
      "int\n7 9 "
      "\nMETADATA\nINFORMATION 0\n\n";
  const VtuGrid grid = parse_vtk("t.vtk", text);
  ASSERT_EQ(grid.cells.size(), 2u);
  EXPECT_THAT(grid.cells[1].vertices, ElementsAre(0, 2, 1, 4, -1, -1, -1, -1));
  ASSERT_EQ(grid.cell_arrays.size(), 2u);
  EXPECT_THAT(std::get<std::vector<double>>(grid.cell_arrays[0].values), ElementsAre(1.5, 2.5));
  EXPECT_THAT(std::get<std::vector<std::int64_t>>(grid.cell_arrays[1].values), ElementsAre(7, 9));
}

TEST(VtkLegacy, NamesLineAndThingOfWhatIsWrong) {
  const std::string head = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n";
  const std::string points = "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
  const auto parse = [](const std::string& text) { return error_of([&] { parse_vtk("t.vtk", text); }); };
  EXPECT_EQ(parse(head + points + "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"), "no error");
  EXPECT_THAT(parse(head + points + "CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n"),
              HasSubstr("cell 0: point, got 4, expected 0..3"));
  EXPECT_THAT(parse(head + points + "CELLS 1 5\n5 0 1 2 3\nCELL_TYPES 1\n10\n"),
              HasSubstr("t.vtk:8: CELLS: cell 0: number of points, got 5, expected 0..4"));
  EXPECT_THAT(parse(head + points + "CELLS 1 6\n5 0 1 2 3 0\nCELL_TYPES 1\n14\n"),
              HasSubstr("cell 0: is a pyramid"));
  EXPECT_THAT(parse(head + points + "CELLS 1 6\n5 0 1 2 3 0\nCELL_TYPES 1\n10\n"),
              HasSubstr("cell 0: got 5 points, expected 4"));
  EXPECT_THAT(parse(head + "POINTS 400000000 float\n0"), HasSubstr("announces 400000000 entries"));
  EXPECT_THAT(parse(head + points), HasSubstr("there are no sections CELLS and CELL_TYPES"));
  EXPECT_THAT(parse("# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\n"), HasSubstr("got 'POLYDATA'"));
}

}  // namespace
}  // namespace sinew::assets
