#include "tools/session/frame_maker.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/session/whole_skin.h"
#include "tools/support/errors.h"

namespace sinew::tools {

FrameMaker::FrameMaker(const Scene& scene, const Character& character, const Caller& caller,
                       fem::Simulation& simulation, const fem::SimulationOptions& options,
                       const FrameRange& frames)
    : scene_(scene),
      character_(character),
      caller_(caller),
      simulation_(simulation),
      frames_(frames),
      judge_(scene, character, frames),
      guard_(scene, character, scene.fps),
      props_(character.rig) {
  if (scene.offset.value_or(0.0) != 0.0) offset_.emplace(*scene.offset, character, simulation, options);
}

fem::SimulationReport FrameMaker::advance(int number, double time) {
  try {
    return simulation_.advance_to(time);
  } catch (const std::invalid_argument& error) {  // the clip has a frame there that no flesh can follow
    throw assets::InputError(character_.rig.file, fmt::format("frame {}: {}", number, error.what()));
  }
}

Frame FrameMaker::step_to(int number) {
  const double time = character_.the_clip().start + number / scene_.fps;
  const fem::SimulationReport step = advance(number, time);
  if (step.status != fem::SimulationStatus::Ok)
    fail(character_, caller_, step, fmt::format("frame {}", number));
  Frame frame;
  frame.report.frame = number;
  frame.report.time = time;
  frame.report.steps = step.steps;
  frame.report.measures = simulation_.measures_at(time);
  frame.pose = character_.pose(time);
  frame.skinned = assets::skin(character_.rig, frame.pose);
  frame.positions =
      with_flesh(character_.input.skin, frame.skinned, simulation_.skin_of(simulation_.positions_at(time)));
  if (offset_) {
    offset_->apply(time, frame.pose, frame.skinned, frame.positions);
  } else if (scene_.offset) {
    frame.positions = frame.skinned;
  }
  guard_.see(frame.skinned, frame.positions);
  return frame;
}

std::optional<Frame> FrameMaker::next() {
  const int count = frames_.last - frames_.first + 1;
  while (stepped_ < count && static_cast<int>(pending_.size()) <= guard_.lookahead())
    pending_.push_back(step_to(frames_.first + stepped_++));
  if (pending_.empty()) return std::nullopt;
  Frame frame = std::move(pending_.front());
  pending_.pop_front();
  frame.report.mended = guard_.mend_next(frame.positions);
  props_.place(frame.pose, frame.skinned, frame.positions);
  frame.report.skin = judge_.measure(frame.positions, frame.skinned,
                                     finished_ == 0 ? fem::FrameKind::First : fem::FrameKind::Later);
  caller_.report("simulating", ++finished_, count);
  return frame;
}

void fail(const Character& character, const Caller& caller, const fem::SimulationReport& report,
          const std::string& where) {
  if (report.status == fem::SimulationStatus::Stopped) caller.stop_if_asked(where);
  throw NumericalError(fmt::format("{}: {}: {}", character.rig.file, where, report.message));
}

}  // namespace sinew::tools
