#include "fem/skin/skin_verdict.h"

#include <array>

namespace sinew::fem {
namespace {

/// A fault and the least of its measure that is rough and torn; 0: never.
struct Limit {
  SkinFault fault;
  double rough, torn;
};
constexpr std::array<Limit, 4> kLimits{{{SkinFault::TornArea, 0.0002, 0.001},
                                        {SkinFault::Creases, 0.8, 2.0},
                                        {SkinFault::Roughness, 0.6, 1.2},
                                        {SkinFault::FarAway, 0.0, 0.3}}};

double measure_of(const SkinFrame& frame, SkinFault fault, FrameKind kind) {
  switch (fault) {
    case SkinFault::TornArea:
      return frame.torn_area;
    case SkinFault::Creases:
      return frame.creases;
    case SkinFault::Roughness:
      return frame.roughness;
    case SkinFault::FarAway:
      break;
  }
  return kind == FrameKind::First ? frame.away_most : 0.0;
}

}  // namespace

Judgement judge(const SkinFrame& frame, FrameKind kind) {
  const auto worst = [&](SkinVerdict verdict, double Limit::*least) {
    Judgement found{verdict, SkinFault::TornArea, 0.0};
    for (const Limit& limit : kLimits) {
      if (!(limit.*least > 0.0)) continue;
      const double ratio = measure_of(frame, limit.fault, kind) / (limit.*least);
      if (ratio > found.severity) {
        found.fault = limit.fault;
        found.severity = ratio;
      }
    }
    return found;
  };
  const Judgement torn = worst(SkinVerdict::Torn, &Limit::torn);
  if (torn.severity >= 1.0) return torn;
  Judgement rough = worst(SkinVerdict::Rough, &Limit::rough);
  if (rough.severity < 1.0) rough.verdict = SkinVerdict::Fine;
  return rough;
}

SkinSummary summarise(const std::vector<SkinFrame>& frames) {
  SkinSummary summary;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const Judgement here = judge(frames[k], k == 0 ? FrameKind::First : FrameKind::Later);
    if (here.verdict == SkinVerdict::Torn) ++summary.torn_frames;
    if (k == 0 || summary.judgement < here) {
      summary.judgement = here;
      summary.worst_frame = static_cast<int>(k);
    }
  }
  return summary;
}

std::string_view name(SkinVerdict verdict) {
  switch (verdict) {
    case SkinVerdict::Fine:
      return "fine";
    case SkinVerdict::Rough:
      return "rough";
    case SkinVerdict::Torn:
      break;
  }
  return "torn";
}

}  // namespace sinew::fem
