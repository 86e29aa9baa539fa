#pragma once

#include <string_view>
#include <vector>

/// Would an eye take moving skin for whole? The measures of one frame, and the word for them.
namespace sinew::fem {

/// One frame of flesh against the rig's plain skinning and against rest. A triangle counts only where it is
/// at fault against both, so that a rig whose own skinning collapses is not charged to the flesh. Areas are
/// shares of the judged skin's at rest.
struct SkinFrame {
  /// Area flipped, stretched beyond 2.5 or squeezed below 0.2 [-].
  double torn_area = 0.0;
  int flipped = 0;    ///< triangles that face backwards once the turn of the skin round them is taken out.
  int stretched = 0;  ///< triangles with a principal stretch above 2.5.
  int squeezed = 0;   ///< triangles with one below 0.2.
  int folds = 0;      ///< edges whose triangles lie on each other and did not.
  /// Length of edges bent by more than 30 degrees beyond what they were [heights].
  double creases = 0.0;
  /// Change of the surface's Laplacian in mean lengths of the edges there, exceeded by 0.5 % of the area [-].
  double roughness = 0.0;
  double volume_ratio = 1.0;  ///< volume within the skin over that of plain skinning.
  /// Distance from plain skinning that 5 % and 1 % of the area exceed, and the largest [heights].
  double away_95 = 0.0, away_99 = 0.0, away_most = 0.0;
  double volume_of_rest = 1.0;  ///< volume within the skin over that at rest.
  int worst_vertex = -1;        ///< of the input, where the fault is largest.
  int farthest_vertex = -1;     ///< of the input, where away_most is.
};

enum class SkinVerdict { Fine, Rough, Torn };

/// What is worst about a frame.
enum class SkinFault { TornArea, Creases, Roughness, FarAway };

struct Judgement {
  SkinVerdict verdict = SkinVerdict::Fine;
  SkinFault fault = SkinFault::TornArea;
  /// The fault's measure over the least that has this verdict, for a fine frame over the least rough one.
  double severity = 0.0;

  friend bool operator<(const Judgement& a, const Judgement& b) {
    return a.verdict != b.verdict ? a.verdict < b.verdict : a.severity < b.severity;
  }
};

/// Far away counts in the first frame alone: flesh that hangs off its bones before anything has moved, while
/// later it may swing.
enum class FrameKind { First, Later };

/// By thresholds that were set by eye, on some hundred runs: torn where a torn area shows at a glance, rough
/// where one sees it on a second look.
Judgement judge(const SkinFrame& frame, FrameKind kind);

/// A whole run.
struct SkinSummary {
  Judgement judgement;   ///< of the worst frame.
  int worst_frame = -1;  ///< index into the frames; -1 where there are none.
  int torn_frames = 0;   ///< frames that are torn by themselves.
};
SkinSummary summarise(const std::vector<SkinFrame>& frames);

/// "fine", "rough", "torn".
std::string_view name(SkinVerdict verdict);

}  // namespace sinew::fem
