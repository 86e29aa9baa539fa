#pragma once

#include <deque>
#include <map>
#include <vector>

/// What is decided frame by frame, made steady over frames.
namespace sinew::fem {

/// Weights of vertices that fade in and out: as large as any of the frames within `reach` of a frame, then
/// the mean over as many with a window of cosine shape. So they are nowhere less than what a frame asked for,
/// and from one frame to the next they change by at most 1 / (reach + 1), near either end of the frames by
/// twice that.
class SteadyWeights {
 public:
  using Weights = std::vector<double>;  ///< per vertex; empty: zero everywhere.

  /// `reach`: frames to either side; >= 0, 0 leaves all as they are.
  explicit SteadyWeights(int reach) : reach_(reach) {}

  /// How many frames must follow one before its weights are known: what is later makes no difference.
  int lookahead() const { return 2 * reach_; }
  /// What the next frame asks for; the same number of vertices each time.
  void add(Weights weights);
  /// Of the first frame that was not taken yet; at least one has been added that was not, and `lookahead`
  /// after it unless none will follow.
  Weights take();

 private:
  const Weights& widest(int frame);

  int reach_;
  int first_ = 0, next_ = 0;       ///< number of asked_.front(), and of the frame to be taken.
  std::deque<Weights> asked_;      ///< of frames that still count.
  std::map<int, Weights> widest_;  ///< per frame: the largest within reach.
};

}  // namespace sinew::fem
