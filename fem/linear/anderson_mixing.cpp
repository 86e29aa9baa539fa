#include "fem/linear/anderson_mixing.h"

#include <Eigen/QR>

namespace sinew::fem::detail {

using lattice::Points;

Points AndersonMixing::step(const Points& g) {
  if (!last_g_.size()) return remember(g, g);
  changes_.push_back({last_step_, g - last_g_});
  if (changes_.size() > depth_) changes_.pop_front();
  Eigen::MatrixXd of_g(g.size(), static_cast<Eigen::Index>(changes_.size()));
  for (std::size_t k = 0; k < changes_.size(); ++k)
    of_g.col(static_cast<Eigen::Index>(k)) =
        Eigen::Map<const Eigen::VectorXd>(changes_[k].g.data(), g.size());
  const Eigen::VectorXd share =
      of_g.colPivHouseholderQr().solve(Eigen::Map<const Eigen::VectorXd>(g.data(), g.size()));
  Points move = g;
  for (std::size_t k = 0; k < changes_.size(); ++k)
    move -= share[static_cast<Eigen::Index>(k)] * (changes_[k].x + changes_[k].g);
  return remember(g, move);
}

Points AndersonMixing::remember(const Points& g, const Points& move) {
  last_g_ = g;
  last_step_ = move;
  return move;
}

}  // namespace sinew::fem::detail
