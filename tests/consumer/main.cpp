#include <cstdio>

#include "assets/rig.h"
#include "lattice/control_lattice.h"
#include "skeleton/skeleton.h"

int main() {
  sinew::skeleton::Skeleton skeleton({{.name = "root"}, {.name = "tip", .parent = 0}});
  sinew::lattice::CellComplex tetrahedron;
  tetrahedron.points = (sinew::lattice::Points(4, 3) << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1).finished();
  tetrahedron.cells = {{sinew::lattice::CellType::Tetrahedron, {0, 1, 2, 3}}};
  std::printf("%d joints, volume %.6f, %d vertices\n", skeleton.num_joints(),
              sinew::lattice::cell_volume(tetrahedron, tetrahedron.cells[0]),
              sinew::assets::num_vertices(sinew::assets::Rig{}));
}
