// Volume meshes of other people: every file loads or is refused for its true reason.
#include <bit>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/gmsh.h"
#include "assets/lattice_files.h"
#include "assets/medit.h"
#include "lattice/check_cells.h"

namespace sinew::assets {
namespace {

const std::string kFolder = SINEW_SHARED_DIR "/data/public/volumes/";

struct Known {
  const char* file;
  std::size_t cells;
  Eigen::Index vertices;
  lattice::CellType type;
};
using lattice::CellType;
// Counted in the files by eye and by a script of twenty lines that shares nothing with the readers; the same
// script found no cell of negative volume or corner, no face of more than two cells, no fold, no doubled
// vertex.
const Known kLoad[] = {{"banana.vtk", 2395, 725, CellType::Tetrahedron},
                       {"beam3_hex.veg", 75, 208, CellType::Hexahedron},
                       {"beam3_tet.veg", 450, 208, CellType::Tetrahedron},
                       {"car-body-tets.ele", 898, 318, CellType::Tetrahedron},
                       {"frog.mesh", 5389, 1749, CellType::Tetrahedron},
                       {"rockerarm_hex.mesh", 10600, 12751, CellType::Hexahedron},
                       {"simpleBridge_hex.veg", 1736, 3923, CellType::Hexahedron}};

void expect_same(const VolumeMesh& a, const VolumeMesh& b) {
  ASSERT_EQ(a.complex.points.rows(), b.complex.points.rows());
  ASSERT_EQ(a.complex.cells.size(), b.complex.cells.size());
  for (Eigen::Index i = 0; i < a.complex.points.size(); ++i)
    ASSERT_EQ(std::bit_cast<std::uint64_t>(a.complex.points.data()[i]),
              std::bit_cast<std::uint64_t>(b.complex.points.data()[i]));
  for (std::size_t c = 0; c < a.complex.cells.size(); ++c)
    ASSERT_EQ(a.complex.cells[c].vertices, b.complex.cells[c].vertices);
  EXPECT_EQ(a.regions, b.regions);
}

TEST(PublicVolumes, LoadWithoutFaultAndSurviveOtherFormats) {
  for (const Known& known : kLoad) {
    SCOPED_TRACE(known.file);
    const VolumeMesh mesh = read_volume_mesh(kFolder + known.file);
    EXPECT_EQ(mesh.complex.cells.size(), known.cells);
    EXPECT_EQ(mesh.complex.points.rows(), known.vertices);
    for (const lattice::Cell& cell : mesh.complex.cells) ASSERT_EQ(cell.type, known.type);
    EXPECT_THAT(lattice::cell_faults(mesh.complex, mesh.numbering), testing::IsEmpty());
    expect_same(parse_gmsh("t.msh", format_gmsh(mesh, GmshVersion::V41, Encoding::Binary)), mesh);
    expect_same(parse_gmsh("t.msh", format_gmsh(mesh, GmshVersion::V22, Encoding::Ascii)), mesh);
    expect_same(parse_medit("t.mesh", format_medit(mesh)), mesh);
  }
}

std::string refusal(const std::string& file) {
  try {
    read_volume_mesh(kFolder + file);
  } catch (const InputError& error) {
    return std::string(error.what()).substr(kFolder.size());
  }
  return "no error";
}

TEST(PublicVolumes, AreRefusedForTheirTrueReason) {
  // Its $Elements open with 48 elements of type 7 on line 168.
  EXPECT_EQ(refusal("hybrid_lshape_L1.msh"),
            "hybrid_lshape_L1.msh:169: cell 1: is a pyramid, whose apex has four edges; hint: split it into "
            "tetrahedra");
  EXPECT_EQ(refusal("fichera-mixed.mesh"),
            "fichera-mixed.mesh:1: got an MFEM mesh, expected a Medit mesh; hint: save it as .vtu");
}

}  // namespace
}  // namespace sinew::assets
