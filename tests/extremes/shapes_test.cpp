// Cells that are long, skew, tapered, twisted and almost flat.

#include <random>

#include "fem/models/detail/springs.h"
#include "lattice/check_cells.h"
#include "tests/extremes/extremes.h"

namespace sinew::tests {
namespace {

using Map = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

bool on_boundary(const Eigen::Vector3d& x) {
  return x[0] < 1e-9 || x[0] > 1.0 - 1e-9 || x.tail<2>().cwiseAbs().maxCoeff() > 0.2 - 1e-9;
}

/// How far inner vertices, pushed off by a tenth of a cell, come to rest from where an affine map of all the
/// boundary has them, in sizes of the strain.
void patch(ExtremesTable& table, const std::string& setting, const Map& distort, double limit) {
  BarOptions options = short_bar_options(kFirm, kDamped);
  options.distort = distort;
  Body body = bar_body(options);
  // The leaf vertices of the undistorted bar, by their numbers, say what is boundary.
  options.distort = {};
  const Body box = bar_body(options);
  body.bones.vertices.clear();
  for (int a = 0; a < body.mesh.num_vertices(); ++a) {
    const bool held = on_boundary(box.mesh.points.row(a).transpose());
    body.bones.is_bone[static_cast<std::size_t>(a)] = held ? 1 : 0;
    const Eigen::Vector3d x = body.mesh.points.row(a).transpose();
    if (held) body.bones.vertices.push_back({a, 0, -1, 0, 0, x, x, 0.0});
  }
  constexpr double kStrain = 1e-3;
  Eigen::Affine3d map = turned(20.0);
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  stretch(0, 0) += kStrain;
  stretch(1, 1) -= 0.5 * kStrain;
  stretch(0, 2) += kStrain;
  map.linear() = map.linear() * stretch;
  const fem::PosedFrames pose = fem::pose_frames(body.tree, {map}, 0.0);
  const Points exact = moved(body, map);
  for (const std::string& rung : element_rungs()) {
    Points x = exact;
    for (int a = 0; a < body.mesh.num_vertices(); ++a) {
      // By no more than a cell bears without turning inside out.
      if (!body.bones.is_bone[static_cast<std::size_t>(a)])
        x.row(a) += 0.1 * kStrain * body.mesh.points.row(a);
    }
    const auto model = fem::find_model(rung)->make(body, {});
    fem::PoseProblem problem;
    problem.pose = &pose;
    const fem::SolveReport report = model->equilibrate(problem, x);
    Extreme run;
    run.ok = report.ok();
    run.failure = report.message;
    table.add("patch test, " + setting, rung, run);
    if (run.ok) table.at_most("off the patch", distance(x, exact) / kStrain, limit);
  }
}

/// How many times too stiff the short bar is against a finer one of cubes, both as thick as 1 / aspect.
double too_stiff(double aspect, int along) {
  BarOptions options = short_bar_options(kFirm, kDamped);
  options.box.min = {0.0, -0.25 / aspect, -0.25 / aspect};
  options.box.max = {1.0, 0.25 / aspect, 0.25 / aspect};
  options.box.blocks = {along, 1, 1};
  const Body body = bar_body(options);
  return largest(static_displacement(body, gravity_force(body, kWeight)));
}

TEST(Extremes, X8CellsTenThousandTimesAsLongAsTheyAreThick) {
  ExtremesTable table("X8",
                      "Cells 1 to 1e4 times as long as thick: patch test to 1e-9 times that; no failure.");
  table.excuse(
      "all: bending error at aspect 10 not more than twice that of cubes",
      "trilinear cells lock in bending when they are long and thin: twice too stiff at 3, eleven times "
      "at 10 (noted); no B-bar helps that, shorter cells do");
  for (double aspect : {1.0, 10.0, 100.0, 1e3, 1e4}) {
    BarOptions options = short_bar_options(kFirm, kDamped);
    options.box.min = {0.0, -0.25, -0.25 / aspect};
    options.box.max = {1.0, 0.25, 0.25 / aspect};
    const Body body = bar_body(options);
    const std::string setting = fmt::format("aspect {:g}", aspect);
    for (const std::string& rung : dynamic_rungs()) {
      const Eigen::Vector3d gravity = kWeight / (aspect * aspect);
      const Extreme run = run_extreme({body, still_base, extreme_options(rung, kFrame, gravity), 20, 0.0});
      table.add(setting, rung, run);
      table.at_most("growth of energy", run.growth, 1e-6);
    }
    patch(
        table, setting,
        [aspect](const Eigen::Vector3d& x) -> Eigen::Vector3d {
          return {x[0], x[1], x[2] / aspect};
        },
        1e-9 * aspect);
  }
  for (double aspect : {1.0, 3.0, 10.0}) {
    Extreme run;
    run.ok = true;
    table.add(fmt::format("bending, aspect {:g}", aspect), "blended", run);
    table.note("tip over that of cubes",
               too_stiff(aspect, 2) / too_stiff(aspect, static_cast<int>(4 * aspect)));
  }
}

/// What the springs of a cell resist its shear in the plane of x and z with, over E: sum of k L^2 n_x^2 n_z^2
/// / V.
double shear_of_springs(const Body& body, std::size_t cell) {
  const fem::CellPoints x = fem::cell_points(body.mesh.points, body.mesh.cells[cell]);
  double volume = 0.0, sum = 0.0;
  for (double w :
       fem::gauss_weights(lattice::hex_corners(body.mesh.points, body.mesh.cells[cell]), body.fill[cell]))
    volume += w;
  for (const fem::Spring& spring : fem::matched_springs(x, volume, 1.0)) {
    const Eigen::Vector3d n = (x.col(spring.b) - x.col(spring.a)) / spring.length;
    sum += spring.stiffness * std::pow(spring.length * n[0] * n[2], 2) / volume;
  }
  return sum;
}

TEST(Extremes, X9CellsSkewTaperedTwistedAndAlmostFlat) {
  ExtremesTable table(
      "X9",
      "Cells skew by 60 degrees, tapered 10:1, twisted by 45 degrees, flat to 1e-6: patch test "
      "to 1e-9, refused when inside out and not before.");
  table.excuse("springs in flat cells",
               "all edges and diagonals of a flat cell lie in its plane or across it: none resists its shear "
               "(noted), so that it snaps over at the least load, and says so");
  table.excuse("springs: patch test", "a lattice of springs is no element and fails it on odd cells");
  const std::vector<std::pair<std::string, Map>> shapes{
      {"skew by 60 degrees",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return {x[0] + std::tan(60 * kDegree) * (x[2] + 0.2), x[1], x[2]};
       }},
      {"tapered ten to one",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         const double s = 1.0 - 0.9 * x[0];
         return {x[0], s * x[1], s * x[2]};
       }},
      {"twisted by 45 degrees",
       [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return Eigen::AngleAxisd(45 * kDegree * x[0], Eigen::Vector3d::UnitX()) * x;
       }},
      {"flat to a millionth", [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
         return {x[0] < 0.75 && x[0] > 0.25 ? 1e-6 : x[0], x[1], x[2]};
       }}};
  for (const auto& [setting, map] : shapes) {
    BarOptions options = short_bar_options(kFirm, kDamped);
    options.distort = map;
    const bool skew = setting.starts_with("skew");
    options.held = [skew](const Eigen::Vector3d& x) {
      return x[0] <= 1e-9 + (skew ? std::tan(60 * kDegree) * (x[2] + 0.2) : 0.0);
    };
    const Body body = bar_body(options);
    for (const std::string& rung : dynamic_rungs()) {
      const SimulationOptions settings = extreme_options(rung, kFrame, 0.1 * kWeight);
      const Extreme run = run_extreme({body, still_base, settings, 20, 0.0});
      const bool flat_springs = rung == "springs" && setting.starts_with("flat");
      table.add(setting, rung, run, !flat_springs);
      if (flat_springs) {
        const double shear = shear_of_springs(body, 0);
        table.note("springs' modulus of shear over E", shear);
        EXPECT_LT(shear, 1e-9);
      }
      if (run.ok) table.at_most("growth of energy", run.growth, 1e-6);
    }
    patch(table, setting, map, 1e-9);
  }
}

/// Least Jacobian at the corners of a hexahedron and of the eight that halve its edges.
double least_jacobian(const lattice::HexCorners& corners) {
  double least = std::numeric_limits<double>::infinity();
  for (int parts : {1, 2}) {
    const auto at = [&](int i, int j, int k) -> Eigen::Vector3d {
      const Eigen::Vector3d xi = 2.0 / parts * Eigen::Vector3d(i, j, k) - Eigen::Vector3d::Ones();
      return corners.transpose() * lattice::trilinear_weights(xi);
    };
    for (int corner = 0; corner < 8 * parts * parts * parts; ++corner) {
      const int cell = corner / 8, i = cell % parts, j = cell / parts % parts, k = cell / parts / parts;
      const int a = corner & 1, b = corner >> 1 & 1, c = corner >> 2 & 1;
      Eigen::Matrix3d edges;
      edges << at(i + 1, j + b, k + c) - at(i, j + b, k + c), at(i + a, j + 1, k + c) - at(i + a, j, k + c),
          at(i + a, j + b, k + 1) - at(i + a, j + b, k);
      least = std::min(least, edges.determinant() * parts * parts * parts);
    }
  }
  return least;
}

// One corner of a cube is pushed along its diagonal, into the cell: the cell is refused from where a corner
// of it, or of the eight cells that it is cut into, has no volume left, and not before.
TEST(Extremes, X9CellsAreRefusedWhereTheyTurnInsideOutAndNotBefore) {
  ExtremesTable table("X9-threshold",
                      "A cell is refused where its least Jacobian passes zero and not before.");
  const auto cube = [](double push) {
    lattice::CellComplex complex = lattice::box_lattice(
        {Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones(), {1, 1, 1}, lattice::CellType::Hexahedron, {}});
    for (Eigen::Index a = 0; a < complex.points.rows(); ++a) {
      if (complex.points.row(a).sum() > 2.5) complex.points.row(a).array() -= push;
    }
    return complex;
  };
  const auto least = [&](double push) {
    const lattice::CellComplex complex = cube(push);
    lattice::HexVertices vertices{};
    std::copy_n(complex.cells[0].vertices.begin(), 8, vertices.begin());
    return least_jacobian(lattice::hex_corners(complex.points, vertices));
  };
  double good = 0.0, bad = 0.9;
  ASSERT_GT(least(good), 0.0);
  ASSERT_LT(least(bad), 0.0);
  for (int k = 0; k < 60; ++k) (least(0.5 * (good + bad)) > 0.0 ? good : bad) = 0.5 * (good + bad);
  for (double off : {-1e-3, -1e-6, 1e-6, 1e-3}) {
    EXPECT_EQ(!lattice::cell_faults(cube(good + off)).empty(), off > 0.0) << off << " from " << good;
    Extreme run;
    run.ok = true;
    table.add(fmt::format("{:g} from flat: {}", off, off > 0.0 ? "refused" : "taken"), "blended", run);
  }
}

}  // namespace
}  // namespace sinew::tests
