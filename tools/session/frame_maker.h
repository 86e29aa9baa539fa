#pragma once

#include <deque>
#include <optional>

#include "assets/riding.h"
#include "tools/session/frame.h"
#include "tools/session/frame_guard.h"
#include "tools/session/offset_flesh.h"
#include "tools/session/skin_report.h"

namespace sinew::tools {

/// Throws what a report that is not ok stands for: Stopped where the caller asked for it, else NumericalError
/// with the file, `where` and the report's message.
[[noreturn]] void fail(const Character& character, const Caller& caller, const fem::SimulationReport& report,
                       const std::string& where);

/// Makes the output frames of a settled simulation, one after the other: steps, skins, mends and judges.
class FrameMaker {
 public:
  /// All of them must outlive it.
  FrameMaker(const Scene& scene, const Character& character, const Caller& caller,
             fem::Simulation& simulation, const fem::SimulationOptions& options, const FrameRange& frames);

  /// The next frame in order; nothing after the last. Runs ahead of it as far as the guard looks. Throws
  /// NumericalError with frame and place where the flesh diverges or finds no balance, assets::InputError
  /// where the clip squashes a frame flat, and Stopped.
  std::optional<Frame> next();

  /// Spent on judging so far [s].
  double judging_seconds() const { return judge_.seconds(); }

 private:
  fem::SimulationReport advance(int number, double time);
  /// Steps to a frame; the guard has seen it and not mended it.
  Frame step_to(int number);

  const Scene& scene_;
  const Character& character_;
  const Caller& caller_;
  fem::Simulation& simulation_;
  FrameRange frames_;
  int stepped_ = 0, finished_ = 0;  ///< frames.
  FrameJudge judge_;
  FrameGuard guard_;
  assets::PropMotion props_;
  std::optional<OffsetFlesh> offset_;
  std::deque<Frame> pending_;
};

}  // namespace sinew::tools
