#include "fem/skin/steady_guard.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace sinew::fem {

using lattice::Points;

namespace {

using Weights = SteadyWeights::Weights;

/// What `all` has beyond `part`; both or `part` alone may be empty.
Weights beyond(Weights all, const Weights& part) {
  for (std::size_t v = 0; v < part.size(); ++v) all[v] -= part[v];
  return all;
}

void raise(Weights& weights, const Weights& more) {
  if (weights.empty()) weights.resize(more.size(), 0.0);
  for (std::size_t v = 0; v < more.size(); ++v) weights[v] = std::min(1.0, weights[v] + more[v]);
}

}  // namespace

void SteadyGuard::look(std::size_t number, Frame frame) {
  Look& look = looks_[number];
  GuardWeights found = guard_->weigh(frame.plain, frame.flesh, frame.by);
  look.weights.add(beyond(std::move(found.weights), frame.by.weights));
  look.pulls.add(beyond(std::move(found.pulls), frame.by.pulls));
  look.frames.push_back(std::move(frame));
}

/// The first frame of a look, with what this one has made steady.
SteadyGuard::Frame SteadyGuard::pass_on(std::size_t number) {
  Look& look = looks_[number];
  Frame frame = std::move(look.frames.front());
  look.frames.pop_front();
  raise(frame.by.weights, look.weights.take());
  raise(frame.by.pulls, look.pulls.take());
  return frame;
}

void SteadyGuard::see(const Points& plain, const Points& flesh) {
  look(0, {plain, flesh, {}});
  for (std::size_t k = 1; k < looks_.size(); ++k)
    while (static_cast<int>(looks_[k - 1].frames.size()) > looks_[k - 1].weights.lookahead())
      look(k, pass_on(k - 1));
}

Mended SteadyGuard::mend_next(Points& skin) {
  // At the end, when none will follow, frames are still on their way.
  const auto last = looks_.size() - 1;
  if (static_cast<int>(looks_[last].frames.size()) <= looks_[last].weights.lookahead()) {
    for (std::size_t k = 1; k < looks_.size(); ++k)
      while (!looks_[k - 1].frames.empty()) look(k, pass_on(k - 1));
  }
  Frame frame = pass_on(last);
  skin = std::move(frame.flesh);
  return guard_->mend(frame.by, frame.plain, skin);
}

}  // namespace sinew::fem
