#pragma once

#include <string>
#include <vector>

#include "assets/figure.h"
#include "tools/ladder/ladder.h"

/// What a ladder shows: plots, a page, a file for programs.
namespace sinew::tools {

/// Error (rms, [mm]) against cost (ms per frame), both logarithmic, with the front of what is worth its
/// price.
assets::Figure error_cost_figure(const Ladder& ladder);
/// rms error of every run in every frame [mm].
assets::Figure error_time_figure(const Ladder& ladder);
/// Seconds that every run spent in each phase.
assets::Figure phases_figure(const Ladder& ladder);

/// A picture of one rung beside the reference.
struct LadderThumbnail {
  std::string caption;
  assets::Image image;
};
/// For every rung its finest run, above the reference, in the frame where they are farthest apart.
std::vector<LadderThumbnail> ladder_thumbnails(const Ladder& ladder);

/// What the reference is and whether the grid shows that it has converged; one or two sentences.
std::string reference_text(const Ladder& ladder);

/// One line where a run tears the skin or the reference is rough: how many do, and the fault of the reference
/// or else of the first of them. Empty where all is well.
std::string fault_text(const Ladder& ladder);

/// One row per run, for the terminal.
std::string ladder_table(const Ladder& ladder);
/// Everything, for programs. `settings` is the scene in force.
std::string ladder_json(const Ladder& ladder, const std::string& settings);
/// A page that needs no other file.
std::string ladder_html(const Ladder& ladder, const std::string& title, const std::string& settings,
                        const std::vector<LadderThumbnail>& thumbnails);

}  // namespace sinew::tools
