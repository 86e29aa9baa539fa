#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "fem/time/simulation.h"
#include "tools/session/character.h"
#include "tools/session/frame.h"
#include "tools/session/run_report.h"

/// A run without files and without a terminal: from a scene to frames.
namespace sinew::tools {

/// Loads a scene's character and builds its flesh; run() settles it and makes the frames.
///
///     Scene scene;
///     scene.rig = "hopper.glb";
///     Session session(scene);
///     FrameSink* sink = &my_sink;
///     session.run({&sink, 1});
class Session {
 public:
  /// Checks the scene (Scene::validate); its output is not looked at. Throws the errors of assets/error.h,
  /// NumericalError and Stopped (tools/support/errors.h).
  explicit Session(const Scene& scene, Caller caller = {});
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  const Scene& scene() const { return scene_; }
  const Character& character() const { return character_; }
  /// The output frames that run() makes.
  const FrameRange& frames() const { return frames_; }
  /// Of the flesh; valid after run() has begun.
  const fem::Body& body() const { return *body_; }

  /// Settles the flesh, steps through all frames and gives each of them to every sink in turn; then judges
  /// the whole. May be called once. Throws NumericalError with the frame and the place where the flesh
  /// diverges, finds no balance, or, in a strict scene, does not settle or is torn; Stopped; and what sinks
  /// throw.
  RunReport run(std::span<FrameSink* const> sinks);

 private:
  void settle(RunReport& report, fem::Simulation& simulation) const;
  void judge(RunReport& report) const;

  Scene scene_;
  Caller caller_;
  std::shared_ptr<void> threads_;  ///< limits them while the session lives.
  Character character_;
  FrameRange frames_;
  std::optional<fem::Body> body_;
};

}  // namespace sinew::tools
