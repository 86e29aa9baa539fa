#pragma once

#include <Eigen/Core>

/// Plain arrays of points and indices; every folder speaks them.
namespace sinew::lattice {

/// Points as rows, num_points x 3 [m]; dof 3*i + c is component c of point i.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Triangles as rows of three vertex indices, num_triangles x 3, counter-clockwise seen from outside.
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

}  // namespace sinew::lattice
