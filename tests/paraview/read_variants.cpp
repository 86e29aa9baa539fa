// Reads every file of a folder and compares it with one that was written by Sinew, bit for bit.
// Usage: read_variants FILE.vtu FOLDER
#include <algorithm>
#include <bit>
#include <filesystem>
#include <iostream>

#include "assets/lattice_files.h"

namespace {

bool same(const sinew::assets::VolumeMesh& a, const sinew::assets::VolumeMesh& b) {
  if (a.complex.points.rows() != b.complex.points.rows() || a.complex.cells.size() != b.complex.cells.size())
    return false;
  for (Eigen::Index i = 0; i < a.complex.points.size(); ++i)
    if (std::bit_cast<std::uint64_t>(a.complex.points.data()[i]) !=
        std::bit_cast<std::uint64_t>(b.complex.points.data()[i]))
      return false;
  for (std::size_t c = 0; c < a.complex.cells.size(); ++c)
    if (a.complex.cells[c].type != b.complex.cells[c].type ||
        a.complex.cells[c].vertices != b.complex.cells[c].vertices)
      return false;
  return a.annotation == b.annotation && a.regions == b.regions;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    const sinew::assets::VolumeMesh expected = sinew::assets::read_volume_mesh(argv[1]);
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(argv[2])) {
      if (!same(sinew::assets::read_volume_mesh(entry.path().string()), expected)) {
        std::cerr << entry.path() << " differs\n";
        return 1;
      }
      ++count;
    }
    std::cout << count << " files are the same\n";
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
