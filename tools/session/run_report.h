#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fem/time/simulation.h"
#include "tools/session/character.h"
#include "tools/session/frame.h"
#include "tools/session/skin_report.h"

/// report.json: what a run did and what it found.
namespace sinew::tools {

/// The phase of judging the skin, which is no part of making it.
inline constexpr const char* kJudging = "judge the skin";

struct RunReport {
  std::string version;
  std::string settings;  ///< the scene in force, TOML.
  PhaseTimes times;
  int settle_steps = 0;
  double settle_speed = 0.0;  ///< left when settling ended [m/s],
  std::string settle_joint;   ///< by the flesh of this joint.
  bool settled = true;        ///< that is slow.
  fem::SolverCounts counts;
  fem::EnergyCap::Taken energy_taken;
  std::vector<fem::Cut> cuts;  ///< of the clip.
  std::vector<FrameReport> frames;
  double judging = 0.0;                ///< all frames [s].
  std::optional<SkinFinding> finding;  ///< on the skin of all frames; empty as theirs.
};

/// The report as JSON text, ending in a newline; numbers are locale-independent and round-trip.
std::string report_json(const RunReport& report, const Character& character, const fem::Body& body);

}  // namespace sinew::tools
