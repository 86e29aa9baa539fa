#include "lattice/detail/hexahedral_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lattice/detail/finish.h"
#include "lattice/detail/separate_limbs.h"

namespace sinew::lattice::detail {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// A cube counts as touched where it would be if it were larger by this share: a skin vertex on its face must
/// be in some cube whatever the rounding.
constexpr double kMargin = 1e-6;
/// The box of the skin is never cut into more cubes than this for every wanted one: no body fills so little
/// of its box, but a sheet of a few triangles may never give the wanted number.
constexpr double kLargestShare = 100.0;
constexpr int kSearchSteps = 40;
constexpr double kCloseEnough = 0.02;

/// True where a triangle and the cube of half side `half` about the origin overlap: no axis separates them
/// ([Ericson05, sec. 5.2.9]).
bool overlaps_cube(const Vector3d& a, const Vector3d& b, const Vector3d& c, double half) {
  const auto separates = [&](const Vector3d& axis) {
    const double p = axis.dot(a), q = axis.dot(b), r = axis.dot(c);
    const double reach = half * axis.cwiseAbs().sum();
    return std::min({p, q, r}) > reach || std::max({p, q, r}) < -reach;
  };
  const std::array<Vector3d, 3> edges{b - a, c - b, a - c};
  for (int k = 0; k < 3; ++k) {
    if (separates(Vector3d::Unit(k))) return false;
    for (const Vector3d& edge : edges)
      if (separates(edge.cross(Vector3d::Unit(k)))) return false;
  }
  return !separates(edges[0].cross(edges[1]));
}

/// Which cubes of the grid over the skin's box are kept.
class Grid {
 public:
  Grid(const UnitSkin& skin, double side, const Poll& poll) : side_(side) {
    const Vector3d low = skin.points.colwise().minCoeff(), high = skin.points.colwise().maxCoeff();
    // Room for the skin to touch the outermost cubes from inside.
    count_ = ((high - low) / side + Vector3d::Constant(1e-3)).array().ceil().cast<int>().max(1);
    low_ = 0.5 * (low + high) - 0.5 * side * count_.cast<double>();
    keep_.assign(static_cast<std::size_t>(count_.x()) * count_.y() * count_.z(), 0);
    for (int t = 0; t < skin.triangles.rows(); ++t) keep_touched(skin, t);
    for_each([&](const Vector3i& at) {
      if (at.x() == 0) poll();
      std::uint8_t& keep = keep_[index(at)];
      if (!keep && skin.is_inside(middle(at))) keep = 1;
    });
  }

  Vector3i count() const { return count_; }
  bool keeps(const Vector3i& at) const { return keep_[index(at)] != 0; }
  int num_kept() const { return static_cast<int>(std::count(keep_.begin(), keep_.end(), 1)); }
  Vector3d corner(const Vector3i& at) const { return low_ + side_ * at.cast<double>(); }

  /// Visit: (const Vector3i&), x fastest.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (int z = 0; z < count_.z(); ++z)
      for (int y = 0; y < count_.y(); ++y)
        for (int x = 0; x < count_.x(); ++x) visit(Vector3i(x, y, z));
  }

 private:
  std::size_t index(const Vector3i& at) const {
    return (static_cast<std::size_t>(at.z()) * count_.y() + at.y()) * count_.x() + at.x();
  }
  Vector3d middle(const Vector3i& at) const {
    return low_ + side_ * (at.cast<double>() + Vector3d::Constant(0.5));
  }
  Vector3i cube_of(const Vector3d& p) const {
    const Eigen::Array3d scaled = ((p - low_) / side_).array().floor();
    return scaled.max(0.0).min((count_.array() - 1).cast<double>()).cast<int>();
  }
  void keep_touched(const UnitSkin& skin, int triangle) {
    const Vector3d a = skin.points.row(skin.triangles(triangle, 0)),
                   b = skin.points.row(skin.triangles(triangle, 1)),
                   c = skin.points.row(skin.triangles(triangle, 2));
    const Vector3d margin = Vector3d::Constant(kMargin * side_);
    const Vector3i first = cube_of(a.cwiseMin(b).cwiseMin(c) - margin);
    const Vector3i last = cube_of(a.cwiseMax(b).cwiseMax(c) + margin);
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x) {
          const Vector3i at(x, y, z);
          const Vector3d m = middle(at);
          if (!keeps(at) && overlaps_cube(a - m, b - m, c - m, (0.5 + kMargin) * side_)) keep_[index(at)] = 1;
        }
  }

  double side_;
  Vector3i count_;
  Vector3d low_;
  std::vector<std::uint8_t> keep_;
};

}  // namespace

CellComplex grid_over_skin(const UnitSkin& skin, double side, const Poll& poll) {
  const Grid grid(skin, side, poll);
  CellComplex complex;
  std::vector<Vector3d> points;
  const Vector3i corners = grid.count() + Vector3i::Ones();
  std::vector<int> vertex(static_cast<std::size_t>(corners.x()) * corners.y() * corners.z(), -1);
  grid.for_each([&](const Vector3i& at) {
    if (!grid.keeps(at)) return;
    Cell cell;
    cell.type = CellType::Hexahedron;
    for (int k = 0; k < 8; ++k) {
      const Vector3i corner = at + Vector3i(k % 4 == 1 || k % 4 == 2, k % 4 >= 2, k >= 4);
      int& v = vertex[(static_cast<std::size_t>(corner.z()) * corners.y() + corner.y()) * corners.x() +
                      corner.x()];
      if (v < 0) {
        v = static_cast<int>(points.size());
        points.push_back(skin.to_rest(grid.corner(corner)));
      }
      cell.vertices[k] = v;
    }
    complex.cells.push_back(cell);
  });
  complex.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    complex.points.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  return complex;
}

double find_grid_side(const UnitSkin& skin, int cells, const Poll& poll) {
  // The count falls with the side, but not steadily: cubes jump as the grid shifts.
  const Vector3d box = skin.points.colwise().maxCoeff() - skin.points.colwise().minCoeff();
  double low = 0.5;
  while (((box / low).array() + 1.0).prod() < kLargestShare * cells) low *= 0.9;
  double high = 1.0, best = high, best_error = std::abs(std::log(cells));
  for (int step = 0; step < kSearchSteps && best_error > kCloseEnough; ++step) {
    // From the coarse side, so that no grid is much finer than the one wanted.
    const double side = std::max(std::sqrt(low * high), 0.5 * high);
    const double error = std::log(static_cast<double>(Grid(skin, side, poll).num_kept()) / cells);
    if (std::abs(error) < best_error) best = side, best_error = std::abs(error);
    (error > 0.0 ? low : high) = side;
  }
  return best;
}

ControlLattice hexahedral_lattice(const RigInput& input, double side, const ReductionOptions& options) {
  ReducedSkeleton skeleton =
      reduce_skeleton(input.unit_skin, input.unit_joints, input.weights, side, options);
  ControlLattice lattice;
  lattice.is_grid = true;
  lattice.edge_length = side * input.unit_skin.scale;
  lattice.complex = grid_over_skin(input.unit_skin, side, input.poll);
  lattice.changes = skeleton.changes;
  for (ReducedBone& bone : skeleton.bones) {
    if (bone.soft) continue;
    bone.soft = true;
    lattice.changes.push_back({input.joints.names[bone.frame], "soft",
                               fmt::format("bone '{}' lies on no edges of the grid of cubes", bone.name)});
  }
  lattice.bones = lattice_bones(input, skeleton);
  separate_limbs(input, skeleton, lattice);
  hang_joints(input, skeleton, lattice);
  return lattice;
}

}  // namespace sinew::lattice::detail
