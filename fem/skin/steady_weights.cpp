#include "fem/skin/steady_weights.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace sinew::fem {

void SteadyWeights::add(Weights weights) { asked_.push_back(std::move(weights)); }

const SteadyWeights::Weights& SteadyWeights::widest(int frame) {
  const auto [found, fresh] = widest_.try_emplace(frame);
  Weights& largest = found->second;
  if (!fresh) return largest;
  const int last = first_ + static_cast<int>(asked_.size()) - 1;
  for (int k = std::max(first_, frame - reach_); k <= std::min(last, frame + reach_); ++k) {
    const Weights& asked = asked_[static_cast<std::size_t>(k - first_)];
    if (largest.empty()) largest = asked;
    for (std::size_t v = 0; v < asked.size(); ++v) largest[v] = std::max(largest[v], asked[v]);
  }
  return largest;
}

SteadyWeights::Weights SteadyWeights::take() {
  const int frame = next_++, last = first_ + static_cast<int>(asked_.size()) - 1;
  Weights mean;
  double all = 0.0;
  for (int k = std::max(0, frame - reach_); k <= std::min(last, frame + reach_); ++k) {
    const double share = 1.0 + std::cos(std::numbers::pi * (k - frame) / (reach_ + 1.0));
    const Weights& largest = widest(k);
    if (mean.empty()) mean.assign(largest.size(), 0.0);
    for (std::size_t v = 0; v < largest.size(); ++v) mean[v] += share * largest[v];
    all += share;
  }
  for (double& weight : mean) weight /= all;
  widest_.erase(widest_.begin(), widest_.lower_bound(next_ - reach_));
  for (; first_ < next_ - 2 * reach_; ++first_) asked_.pop_front();
  return mean;
}

}  // namespace sinew::fem
