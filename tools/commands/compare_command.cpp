#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/error.h"
#include "assets/result.h"
#include "tools/commands/command.h"
#include "tools/ladder/comparison.h"
#include "tools/ladder/tolerance.h"
#include "tools/support/text.h"
#include "tools/terminal/exit_code.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

struct CompareRequest {
  std::string a, b;
  std::string limit;
  bool json = false;
};

/// A flat thing has no height to be a share of.
double percent(double distance, double height) { return height > 0.0 ? 100.0 * distance / height : 0.0; }

std::string comparison_text(const CompareRequest& request, const Comparison& c, int num_points) {
  std::string text = fmt::format("{} and {}: {} vertices, height {}\n", single_line(request.a),
                                 single_line(request.b), num_points, length_text(c.height));
  text += "  frame          rms                   largest         at vertex\n";
  const auto row = [&](const std::string& name, double rms, double largest, int vertex) {
    return fmt::format("{:>7}  {:>10} {:>8.3g} %  {:>10} {:>8.3g} %  {:>9}\n", name, length_text(rms),
                       percent(rms, c.height), length_text(largest), percent(largest, c.height), vertex);
  };
  for (const FrameDifference& d : c.frames)
    text += row(fmt::format("{}", d.frame), d.rms, d.largest, d.vertex);
  text += row("all", c.rms, c.largest, c.vertex);
  text += fmt::format("largest: {} ({:.3g} % of the height) at vertex {} in frame {}\n",
                      length_text(c.largest), percent(c.largest, c.height), c.vertex, c.frame);
  return text;
}

std::string comparison_json(const CompareRequest& request, const Comparison& c, int num_points,
                            std::optional<double> limit) {
  Json frames = Json::array();
  for (const FrameDifference& d : c.frames) {
    frames.push_back({{"frame", d.frame},
                      {"rms_m", d.rms},
                      {"rms_percent", percent(d.rms, c.height)},
                      {"largest_m", d.largest},
                      {"largest_percent", percent(d.largest, c.height)},
                      {"vertex", d.vertex}});
  }
  Json json{{"a", request.a},           {"b", request.b},
            {"vertices", num_points},   {"height_m", c.height},
            {"rms_m", c.rms},           {"rms_percent", percent(c.rms, c.height)},
            {"largest_m", c.largest},   {"largest_percent", percent(c.largest, c.height)},
            {"worst_vertex", c.vertex}, {"worst_frame", c.frame}};
  if (limit) {
    json["limit_m"] = *limit;
    json["within_limit"] = c.largest <= *limit;
  }
  json["frames"] = frames;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void warn(const assets::Result& a, const assets::Result& b, const Comparison& c) {
  const auto common = static_cast<int>(c.frames.size());
  if (a.num_frames() != common || b.num_frames() != common) {
    std::cerr << fmt::format("warning: only the {} frames {} to {} are in both\n", common,
                             c.frames.front().frame, c.frames.back().frame);
  }
  for (const assets::Result* r : {&a, &b}) {
    if (!r->has_sidecar())
      std::cerr << fmt::format(
          "warning: {}: no sidecar, its units are taken as metres with Y up and its rest shape is "
          "not compared\n",
          single_line(r->path()));
  }
}

int run_compare(const CompareRequest& request) {
  std::optional<Tolerance> limit;
  if (!request.limit.empty()) limit = parse_tolerance(request.limit, "--limit");
  const assets::Result a(request.a), b(request.b);
  const Comparison c = compare(a, b);
  warn(a, b, c);
  std::optional<double> metres;
  if (limit && limit->of_height && !(c.height > 0.0)) {
    throw assets::ConfigError(
        fmt::format("--limit: got {}, expected a length, as {} has no height", request.limit, request.a));
  }
  if (limit) metres = limit->metres(c.height);
  std::cout << (request.json ? comparison_json(request, c, a.num_points(), metres)
                             : comparison_text(request, c, a.num_points()));
  if (!metres || c.largest <= *metres) return exit_code::kDone;
  std::cout.flush();
  const std::string line = fmt::format(
      "{}: frame {}: vertex {} lies {} from where {} has it, expected at most {} ({})", request.b, c.frame,
      c.vertex, length_text(c.largest), request.a, length_text(*metres), tolerance_text(*limit));
  std::fprintf(stderr, "sinew: %s\n", single_line(line).c_str());
  return exit_code::kCheck;
}

}  // namespace

void add_compare_command(CLI::App& app, CommandContext& context) {
  const auto request = std::make_shared<CompareRequest>();
  CLI::App* command = app.add_subcommand("compare", "Measure frame by frame how far two results are apart");
  command->add_option("A", request->a, "output folder of sinew simulate, or a PC2 file")->required();
  command->add_option("B", request->b, "the same; of the same mesh")->required();
  command
      ->add_option("--limit", request->limit,
                   "largest distance allowed: a length (um, mm, cm, m) or a percentage of the height")
      ->type_name("2mm|1%");
  command->add_flag("--json", request->json, "print one JSON object instead of text");
  command->footer(
      "Distances are between equal vertices in metres; the height is A's at rest. Frames that only one of "
      "them has\n"
      "are left out. Exit code 0: done and within the limit; 3: no two results of one mesh; 8: over the "
      "limit.");
  command->callback([request, &context] { context.exit_code = run_compare(*request); });
}

}  // namespace sinew::tools
