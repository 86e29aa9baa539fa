#include "assets/vtu.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/base64.h"
#include "assets/lattice_files.h"
#include "assets/medit.h"
#include "tests/assets/lattice_of_arm.h"

namespace sinew::assets {
namespace {

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
            "t.mesh:11: Tetrahedra: cell 1: vertex, got 5, expected 1..4");
  EXPECT_EQ(parse(head + "Tetrahedra\n1\n1000000 3"), "t.mesh:11: Tetrahedra: the file ends in the middle");
  EXPECT_EQ(parse(head + "Tetrahedra\n99999\n"),
            "t.mesh:10: Tetrahedra: announces 99999 entries, but the 1 bytes that follow hold at most 0");
  EXPECT_EQ(
      parse(head + "Pyramids\n1\n"),
      "t.mesh:10: Pyramids: cell 1: is a pyramid, whose apex has four edges; hint: split it into tetrahedra");
  EXPECT_EQ(parse(head + "Blocks\n1\n"), "t.mesh:9: got 'Blocks', expected the name of a section");
  EXPECT_EQ(parse("MFEM mesh v1.0\n"),
            "t.mesh:1: got an MFEM mesh, expected a Medit mesh; hint: save it as .vtu");
  EXPECT_EQ(parse("MeshVersionFormatted 2\nVertices\n1\n0 0 nan 0\n"),
            "t.mesh:4: Vertices: got nan, expected a finite number");
  EXPECT_EQ(parse(head + "Triangles 1\n1 2 3 7\n# done\nEnd\n"), "no error");
}
}  // namespace
}  // namespace sinew::assets
