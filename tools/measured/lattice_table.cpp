// Builds the lattices of many rigs in several sizes and prints their quality as a table: the one in
// tests/measured/lattices.md comes from here.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "assets/islands.h"
#include "assets/lattice_input.h"
#include "assets/rig.h"
#include "lattice/build.h"
#include "lattice/quality.h"
#include "tools/measured/rig_files.h"

namespace {

using namespace sinew;
namespace fs = std::filesystem;

struct Row {
  std::string rig;
  int wanted = 0;
  int cells = 0, vertices = 0;
  lattice::LatticeQuality quality;
  double min_cell_jacobian = 1.0;
  double seconds = 0.0;  ///< of this process on its one core.
  int retries = 0;
  std::vector<lattice::GateFailure> failures;
};

Row measure(const std::string& name, const assets::LatticeInput& input, int cells) {
  lattice::BuildOptions options;
  options.cells = cells;
  const std::clock_t start = std::clock();
  const lattice::BuildResult result = lattice::build(input.skin.surface, input.joints, options);
  Row row;
  row.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  row.rig = name;
  row.wanted = cells;
  row.cells = static_cast<int>(result.lattice.complex.cells.size());
  row.vertices = static_cast<int>(result.lattice.complex.points.rows());
  row.quality = result.lattice.quality;
  for (const lattice::Cell& cell : result.lattice.complex.cells)
    row.min_cell_jacobian =
        std::min(row.min_cell_jacobian, lattice::min_corner_jacobian(result.lattice.complex, cell));
  row.retries = result.lattice.retries;
  row.failures = result.failures;
  return row;
}

void print(const Row& row) {
  const lattice::LatticeQuality& q = row.quality;
  const bool inside = q.skin_vertices_outside == 0 && q.skin_triangles_outside == 0;
  fmt::print("| {} | {} | {} | {} | {:.1f} | {:.3f} | {:.3f} | {:.2f} | {} | {} | {:.2f} | {} |\n", row.rig,
             row.wanted, row.cells, row.vertices, q.min_dihedral_degrees, row.min_cell_jacobian,
             q.min_scaled_jacobian, q.volume_ratio, q.exact_chains ? "yes" : "no", inside ? "yes" : "no",
             row.seconds, row.retries);
  std::fflush(stdout);
  for (const lattice::GateFailure& failure : row.failures)
    fmt::print(stderr, "{}, {} cells: {}\n", row.rig, row.wanted, failure.what);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/// Smallest and median over the rows of one size.
void print_summary(const std::vector<Row>& rows, int wanted) {
  std::vector<double> dihedral, cell_jacobian, jacobian, ratio, seconds;
  int failed = 0;
  for (const Row& row : rows) {
    if (row.wanted != wanted) continue;
    dihedral.push_back(row.quality.min_dihedral_degrees);
    cell_jacobian.push_back(row.min_cell_jacobian);
    jacobian.push_back(row.quality.min_scaled_jacobian);
    ratio.push_back(row.quality.volume_ratio);
    seconds.push_back(row.seconds);
    failed += !row.failures.empty();
  }
  const auto least = [](const std::vector<double>& v) { return *std::min_element(v.begin(), v.end()); };
  fmt::print(
      "{} cells, {} rigs, {} refused by the gate: dihedral {:.1f} / {:.1f} degrees, scaled Jacobian of "
      "the cells {:.3f} / {:.3f}, of the level-1 hexahedra {:.3f} / {:.3f} (smallest / median); volume "
      "ratio {:.2f}, {:.2f} s (medians)\n",
      wanted, dihedral.size(), failed, least(dihedral), median(dihedral), least(cell_jacobian),
      median(cell_jacobian), least(jacobian), median(jacobian), median(ratio), median(seconds));
}

int run(int argc, char** argv) {
  CLI::App app{"Builds the lattices of rigs in several sizes and prints a table of their quality."};
  std::vector<std::string> places;
  std::vector<int> sizes{200, 1000, 5000};
  app.add_option("RIGS", places, "rig files, or folders of them; the bundled samples where none is given");
  app.add_option("--cells", sizes, "wanted numbers of cells")->delimiter(',')->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (places.empty()) places.emplace_back(SINEW_SAMPLES);
  std::vector<Row> rows;
  fmt::print(
      "| rig | wanted | cells | vertices | dihedral | Jacobian, cells | level-1 hexahedra | volume "
      "ratio | exact chains | skin inside | s | retries "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const fs::path& rig : tools::find_rigs(places)) {
    assets::Rig character = assets::load_rig(rig.string());
    assets::set_roles(character, assets::find_islands(character));
    const assets::LatticeInput input = assets::lattice_input(character);
    for (int cells : sizes) {
      rows.push_back(measure(rig.filename().string(), input, cells));
      print(rows.back());
    }
  }
  if (rows.empty()) throw std::runtime_error("no rig among the files given");
  fmt::print("\n");
  for (int cells : sizes) print_summary(rows, cells);
  return std::any_of(rows.begin(), rows.end(), [](const Row& row) { return !row.failures.empty(); }) ? 4 : 0;
}

}  // namespace

/// lattice_table [RIGS...] [--cells N,...]. Exit code 4 where the gate refused a lattice.
int main(int argc, char** argv) try { return run(argc, argv); } catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 3;
}
