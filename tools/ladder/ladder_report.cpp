#include "tools/ladder/ladder_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/obj.h"
#include "assets/preview.h"
#include "assets/result.h"
#include "fem/models/model.h"
#include "tools/ladder/detail/plot_axes.h"
#include "tools/ladder/tolerance.h"
#include "tools/session/run_report.h"

namespace sinew::tools {
namespace {

using assets::Figure;
using assets::FigureBox;
using assets::FigureDisc;
using assets::FigureLine;
using assets::FigureText;
using detail::PlotAxis;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

const Vector3d kInk(0.25, 0.25, 0.25);

/// Colours that stay apart for readers who do not see all of them (after Okabe and Ito).
Vector3d colour_of(std::size_t index) {
  static const Vector3d kPalette[] = {{0.34, 0.71, 0.91}, {0.90, 0.62, 0.00}, {0.00, 0.62, 0.45},
                                      {0.80, 0.47, 0.65}, {0.00, 0.45, 0.70}, {0.84, 0.37, 0.00},
                                      {0.40, 0.40, 0.40}};
  return kPalette[index % std::size(kPalette)];
}

/// Rungs in the order of the runs.
std::vector<std::string> rungs_of(const Ladder& ladder) {
  std::vector<std::string> rungs;
  for (const LadderRun& run : ladder.runs) {
    if (std::find(rungs.begin(), rungs.end(), run.rung) == rungs.end()) rungs.push_back(run.rung);
  }
  return rungs;
}

Vector3d colour_of(const std::string& rung) {
  const auto* model = fem::find_model(rung);
  return colour_of(model == nullptr ? 0 : static_cast<std::size_t>(model - fem::models().data()));
}

void draw_legend(Figure& figure, const Ladder& ladder, double left, double top) {
  for (const std::string& rung : rungs_of(ladder)) {
    figure.marks.emplace_back(FigureDisc{{left, top - 4.0}, 4.5, colour_of(rung), true, {}});
    figure.marks.emplace_back(FigureText{{left + 10.0, top}, rung, assets::TextAnchor::Left, 12.0, kInk});
    top += 18.0;
  }
}

bool is_reference(const Ladder& ladder, const LadderRun& run) {
  return &run == &ladder.runs[static_cast<std::size_t>(ladder.reference)];
}

double percent_of_height(const Ladder& ladder, double metres) {
  return ladder.height > 0.0 ? 100.0 * metres / ladder.height : 0.0;
}

std::string tip_of(const Ladder& ladder, const LadderRun& run) {
  return fmt::format("{}: {:.3g} ms per frame, rms {} ({:.3g} %), largest {}", run.name(),
                     1e3 * run.per_frame, length_text(run.error.rms),
                     percent_of_height(ladder, run.error.rms), length_text(run.error.largest));
}

}  // namespace

Figure error_cost_figure(const Ladder& ladder) {
  Figure figure{760, 440, {}};
  std::vector<double> costs, errors;
  for (const LadderRun& run : ladder.runs) {
    if (!run.ok()) continue;
    costs.push_back(1e3 * run.per_frame);
    errors.push_back(1e3 * run.error.rms);
  }
  PlotAxis x = detail::axis_over(costs, true), y = detail::axis_over(errors, true);
  x.from = 60.0, x.to = 580.0, y.from = 390.0, y.to = 40.0;
  detail::draw_axes(figure, x, y, "cost: ms per frame", "error: rms over all frames, mm");
  std::vector<const LadderRun*> front;
  for (const LadderRun& run : ladder.runs) {
    if (run.on_front) front.push_back(&run);
  }
  std::sort(front.begin(), front.end(),
            [](const auto* a, const auto* b) { return a->per_frame < b->per_frame; });
  FigureLine steps{{}, {kInk, 1.2, 0.6}};
  for (const LadderRun* run : front) {
    const Eigen::Vector2d p(x.at(1e3 * run->per_frame),
                            run->error.rms > 0.0 ? y.at(1e3 * run->error.rms) : y.from);
    if (!steps.points.empty()) steps.points.push_back({p.x(), steps.points.back().y()});
    steps.points.push_back(p);
  }
  figure.marks.emplace_back(steps);
  for (const LadderRun& run : ladder.runs) {
    if (!run.ok()) continue;
    const bool reference = is_reference(ladder, run);
    // The reference has no error of its own to show: it stands on the axis.
    const Eigen::Vector2d p(x.at(1e3 * run.per_frame), reference ? y.from : y.at(1e3 * run.error.rms));
    if (run.on_front) figure.marks.emplace_back(FigureDisc{p, 8.0, kInk, false, {}});
    figure.marks.emplace_back(FigureDisc{p, 5.0, colour_of(run.rung), true, tip_of(ladder, run)});
    if (!run.on_front && !reference) continue;
    const std::string label =
        reference ? "reference" : fmt::format("level {}, {:.3g} ms", run.level, 1e3 * run.step);
    const bool near_edge = p.x() > x.to - 90.0;
    figure.marks.emplace_back(FigureText{{p.x() + (near_edge ? -11.0 : 11.0), p.y() - 8.0},
                                         label,
                                         near_edge ? assets::TextAnchor::Right : assets::TextAnchor::Left,
                                         10.0,
                                         kInk});
  }
  draw_legend(figure, ladder, 608.0, 56.0);
  figure.marks.emplace_back(FigureDisc{{608.0, 404.0}, 6.0, kInk, false, {}});
  figure.marks.emplace_back(
      FigureText{{620.0, 408.0}, "nothing is better", assets::TextAnchor::Left, 11.0, kInk});
  figure.marks.emplace_back(FigureText{{620.0, 422.0}, "at its price", assets::TextAnchor::Left, 11.0, kInk});
  return figure;
}

Figure error_time_figure(const Ladder& ladder) {
  Figure figure{760, 400, {}};
  std::vector<double> frames, errors;
  for (const LadderRun& run : ladder.runs) {
    for (const FrameDifference& d : run.error.frames) {
      frames.push_back(d.frame);
      errors.push_back(1e3 * d.rms);
    }
  }
  PlotAxis x = detail::axis_over(frames, false), y = detail::axis_over(errors, false);
  if (!frames.empty()) {
    x.low = *std::min_element(frames.begin(), frames.end());
    x.high = std::max(x.low + 1.0, *std::max_element(frames.begin(), frames.end()));
  }
  x.from = 60.0, x.to = 580.0, y.from = 350.0, y.to = 40.0;
  detail::draw_axes(figure, x, y, "frame", "error: rms over the vertices, mm");
  for (const bool front : {false, true}) {  // what is worth its price comes on top
    for (const LadderRun& run : ladder.runs) {
      if (!run.ok() || is_reference(ladder, run) || run.on_front != front) continue;
      FigureLine line{{}, {colour_of(run.rung), front ? 2.2 : 1.2, front ? 1.0 : 0.45}};
      for (const FrameDifference& d : run.error.frames)
        line.points.emplace_back(x.at(d.frame), y.at(1e3 * d.rms));
      figure.marks.emplace_back(line);
    }
  }
  draw_legend(figure, ladder, 608.0, 56.0);
  figure.marks.emplace_back(
      FigureText{{600.0, 350.0}, "bold: worth its price", assets::TextAnchor::Left, 11.0, kInk});
  return figure;
}

Figure phases_figure(const Ladder& ladder) {
  std::vector<std::string> phases;
  double longest = 0.0;
  for (const LadderRun& run : ladder.runs) {
    double total = 0.0;
    for (const auto& [phase, seconds] : run.phases) {
      total += seconds;
      if (std::find(phases.begin(), phases.end(), phase) == phases.end() && phase != "preview" &&
          phase != kJudging)
        phases.push_back(phase);
    }
    longest = std::max(longest, total);
  }
  const double row = 20.0, top = 50.0;
  Figure figure{760, static_cast<int>(top + row * static_cast<double>(ladder.runs.size()) + 60.0), {}};
  PlotAxis x = detail::axis_over({longest}, false), y;
  x.from = 230.0, x.to = 730.0;
  y.from = top + row * static_cast<double>(ladder.runs.size()), y.to = top;
  y.low = 0.0, y.high = -1.0;  // no ticks: rows have names
  for (const double value : x.ticks()) {
    figure.marks.emplace_back(
        FigureLine{{{x.at(value), y.from}, {x.at(value), y.to}}, {{0.9, 0.9, 0.9}, 1.0, 1.0}});
    figure.marks.emplace_back(FigureText{
        {x.at(value), y.from + 16.0}, fmt::format("{:g}", value), assets::TextAnchor::Middle, 11.0, kInk});
  }
  figure.marks.emplace_back(
      FigureText{{480.0, y.from + 36.0}, "seconds", assets::TextAnchor::Middle, 12.0, kInk});
  double left = 40.0;
  for (std::size_t p = 0; p < phases.size(); ++p) {
    figure.marks.emplace_back(FigureBox{{left, 14.0}, {left + 10.0, 24.0}, colour_of(p), {}});
    figure.marks.emplace_back(
        FigureText{{left + 15.0, 24.0}, phases[p], assets::TextAnchor::Left, 11.0, kInk});
    left += 32.0 + 6.6 * static_cast<double>(phases[p].size());
  }
  for (std::size_t i = 0; i < ladder.runs.size(); ++i) {
    const LadderRun& run = ladder.runs[i];
    const double y0 = top + row * static_cast<double>(i);
    figure.marks.emplace_back(
        FigureText{{224.0, y0 + 14.0}, run.name(), assets::TextAnchor::Right, 11.0, kInk});
    if (!run.ok())
      figure.marks.emplace_back(
          FigureText{{236.0, y0 + 14.0}, "failed", assets::TextAnchor::Left, 11.0, {0.8, 0.1, 0.1}});
    double sum = 0.0;
    for (const auto& [phase, seconds] : run.phases) {
      const auto found = std::find(phases.begin(), phases.end(), phase);
      if (found == phases.end()) continue;
      figure.marks.emplace_back(FigureBox{{x.at(sum), y0 + 3.0},
                                          {x.at(sum + seconds), y0 + 17.0},
                                          colour_of(static_cast<std::size_t>(found - phases.begin())),
                                          fmt::format("{}: {:.3g} s", phase, seconds)});
      sum += seconds;
    }
  }
  return figure;
}

std::vector<LadderThumbnail> ladder_thumbnails(const Ladder& ladder) {
  const LadderRun& best = ladder.runs[static_cast<std::size_t>(ladder.reference)];
  const assets::Result reference(best.folder);
  const lattice::Triangles triangles =
      assets::read_surface((std::filesystem::path(best.folder) / "skin.obj").string()).triangles;
  std::vector<LadderThumbnail> thumbnails;
  for (const std::string& rung : rungs_of(ladder)) {
    const LadderRun* finest = nullptr;
    for (const LadderRun& run : ladder.runs) {
      if (run.ok() && run.rung == rung &&
          (finest == nullptr || std::pair(run.level, -run.step) > std::pair(finest->level, -finest->step)))
        finest = &run;
    }
    if (finest == nullptr) continue;
    const int number = finest->error.frame;
    assets::PreviewFrame frame;
    frame.frame = number;
    frame.time = reference.fps() > 0.0 ? number / reference.fps() : 0.0;
    frame.simulated = assets::Result(finest->folder).frame(number);
    frame.skinned = reference.frame(number);
    assets::PreviewOptions options;
    options.tile = 220;
    options.upper = rung;
    options.lower = "the reference";
    thumbnails.push_back({finest->name(), assets::render_preview(triangles, {frame}, options)});
  }
  return thumbnails;
}

std::string reference_text(const Ladder& ladder) {
  const LadderRun& reference = ladder.runs[static_cast<std::size_t>(ladder.reference)];
  std::string text = fmt::format("reference: {}, the finest run that worked. ", reference.name());
  for (const LadderNeighbour& n : ladder.neighbours) {
    text += fmt::format("With {} it moves by {} rms ({:.3g} % of the height). ", n.what, length_text(n.rms),
                        percent_of_height(ladder, n.rms));
  }
  if (ladder.neighbours.size() < 2) {
    return text +
           "Whether it has converged is not shown: that takes a run with one level less and one with a "
           "longer "
           "step; hint: two --levels and two --steps.";
  }
  return text +
         fmt::format("{} (limit {:g} % of the height).",
                     ladder.converged() ? "Converged" : "NOT converged, all errors are uncertain by as much",
                     100.0 * ladder.limit);
}

std::string fault_text(const Ladder& ladder) {
  const LadderRun* shown = &ladder.runs[static_cast<std::size_t>(ladder.reference)];
  std::size_t torn = 0;
  for (const LadderRun& run : ladder.runs) {
    if (run.verdict != "torn") continue;
    if (torn++ == 0 && shown->verdict != "torn") shown = &run;
  }
  if (shown->fault.empty()) return "";
  if (torn == 0) return "note: " + shown->fault;
  return fmt::format("warning: {} of {} runs tear the skin; {}: {}", torn, ladder.runs.size(), shown->name(),
                     shown->fault);
}

std::string ladder_table(const Ladder& ladder) {
  std::string text = fmt::format("{:<44} {:>10} {:>9} {:>11} {:>9} {:>11} {:>9} {:>6}\n", "run", "ms/frame",
                                 "setup s", "rms", "% height", "largest", "% height", "skin");
  for (const LadderRun& run : ladder.runs) {
    if (!run.ok()) {
      text += fmt::format("{:<44} failed: {}\n", run.name(), run.failure);
      continue;
    }
    text += fmt::format("{:<44} {:>10.3g} {:>9.3g} {:>11} {:>9.3g} {:>11} {:>9.3g} {:>6}{}\n", run.name(),
                        1e3 * run.per_frame, run.setup, length_text(run.error.rms),
                        percent_of_height(ladder, run.error.rms), length_text(run.error.largest),
                        percent_of_height(ladder, run.error.largest), run.verdict, run.on_front ? " *" : "");
  }
  return text + "* nothing is cheaper and as exact\n";
}

std::string ladder_json(const Ladder& ladder, const std::string& settings) {
  Json runs = Json::array();
  for (const LadderRun& run : ladder.runs) {
    Json json{{"rung", run.rung}, {"level", run.level}, {"step_s", run.step}, {"folder", run.folder}};
    if (!run.ok()) {
      json["failure"] = run.failure;
      runs.push_back(json);
      continue;
    }
    Json phases = Json::object(), over_time = Json::array();
    for (const auto& [phase, seconds] : run.phases) phases[phase] = seconds;
    for (const FrameDifference& d : run.error.frames)
      over_time.push_back(
          {{"frame", d.frame}, {"rms_m", d.rms}, {"largest_m", d.largest}, {"vertex", d.vertex}});
    json["ms_per_frame"] = 1e3 * run.per_frame;
    json["setup_s"] = run.setup;
    json["steps"] = run.steps;
    json["seconds"] = phases;
    json["rms_m"] = run.error.rms;
    json["largest_m"] = run.error.largest;
    json["worst_vertex"] = run.error.vertex;
    json["worst_frame"] = run.error.frame;
    json["on_front"] = run.on_front;
    if (!run.verdict.empty()) json["skin"] = run.verdict;
    json["error_over_time"] = over_time;
    runs.push_back(json);
  }
  Json neighbours = Json::array();
  for (const LadderNeighbour& n : ladder.neighbours)
    neighbours.push_back({{"what", n.what}, {"run", n.run}, {"rms_m", n.rms}});
  const Json json{{"sinew", SINEW_VERSION},
                  {"height_m", ladder.height},
                  {"reference", ladder.reference},
                  {"converged", ladder.converged()},
                  {"convergence_limit_of_height", ladder.limit},
                  {"neighbours", neighbours},
                  {"settings_toml", settings},
                  {"runs", runs}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string ladder_html(const Ladder& ladder, const std::string& title, const std::string& settings,
                        const std::vector<LadderThumbnail>& thumbnails) {
  using assets::html_escaped;
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n<style>\n"
      "body {{ font-family: sans-serif; color: #333; max-width: 1000px; margin: 2em auto; padding: 0 1em; "
      "}}\n"
      "table {{ border-collapse: collapse; font-size: 13px; }}\n"
      "th, td {{ padding: 3px 10px; text-align: right; border-bottom: 1px solid #ddd; }}\n"
      "th:first-child, td:first-child {{ text-align: left; }}\n.front {{ background: #eef6ee; }}\n"
      "figure {{ display: inline-block; margin: 0 12px 12px 0; }}\nfigcaption {{ font-size: 12px; }}\n"
      "pre {{ background: #f6f6f6; padding: 1em; overflow-x: auto; "
      "}}\n</style></head><body>\n<h1>{0}</h1>\n<p>{1}</p>\n",
      html_escaped(title), html_escaped(reference_text(ladder)));
  html += "<h2>Error against cost</h2>\n" + assets::svg_text(error_cost_figure(ladder));
  html += "<h2>Error over time</h2>\n" + assets::svg_text(error_time_figure(ladder));
  html += "<h2>Where the time goes</h2>\n" + assets::svg_text(phases_figure(ladder));
  html +=
      "<h2>All runs</h2>\n<table><tr><th>run</th><th>ms per frame</th><th>setup "
      "s</th><th>steps</th><th>rms</th>"
      "<th>% of height</th><th>largest</th><th>% of height</th><th>at vertex</th><th>in "
      "frame</th><th>skin</th></tr>\n";
  for (const LadderRun& run : ladder.runs) {
    if (!run.ok()) {
      html += fmt::format("<tr><td>{}</td><td colspan=\"10\">failed: {}</td></tr>\n",
                          html_escaped(run.name()), html_escaped(run.failure));
      continue;
    }
    html += fmt::format(
        "<tr{}><td>{}</td><td>{:.3g}</td><td>{:.3g}</td><td>{}</td><td>{}</td><td>{:.3g}</td><td>{}</"
        "td><td>{:.3g}</td>"
        "<td>{}</td><td>{}</td><td>{}</td></tr>\n",
        run.on_front ? " class=\"front\"" : "", html_escaped(run.name()), 1e3 * run.per_frame, run.setup,
        run.steps, length_text(run.error.rms), percent_of_height(ladder, run.error.rms),
        length_text(run.error.largest), percent_of_height(ladder, run.error.largest), run.error.vertex,
        run.error.frame, run.verdict);
  }
  html += "</table>\n<p>Shaded: nothing is cheaper and as exact.</p>\n";
  html += "<h2>Every rung (above) and the reference (below), where they are farthest apart</h2>\n";
  for (const LadderThumbnail& t : thumbnails) {
    html += fmt::format("<figure><img src=\"{}\" alt=\"{}\"><figcaption>{}</figcaption></figure>\n",
                        assets::png_data_uri(t.image), html_escaped(t.caption), html_escaped(t.caption));
  }
  return html + "<h2>The scene</h2>\n<pre>" + html_escaped(settings) + "</pre>\n</body></html>\n";
}

}  // namespace sinew::tools
