// Simulates many rigs with no option given and prints as a table what became of their skins: the one in
// tests/measured/verdicts.md comes from here.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/error.h"
#include "assets/rig.h"
#include "tools/measured/rig_files.h"

namespace {

using namespace sinew;
namespace fs = std::filesystem;

/// Runs at the same time, each on one thread: more would only wait for each other.
constexpr int kAtOnce = 2;

struct Run {
  fs::path rig;
  std::string clip;
  int frames = 0;
};

struct Row {
  std::string verdict;  ///< "fine", "rough", "torn", or "failed".
  std::string cells;    ///< of the table, after rig and clip.
};

struct Options {
  std::vector<std::string> places;
  int frames = 60;
  int clips = 2;
};

/// Folder of this program: the command stands beside it.
fs::path own_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

/// For a POSIX shell.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// For a cell of a Markdown table.
std::string escaped(std::string text) {
  for (char& c : text) {
    if (c == '|' || c == '\n') c = '/';
  }
  return text;
}

/// The runs of a rig: its first clips that move. None for a file that holds no skinned, animated character.
std::vector<Run> runs_of(const fs::path& file, const Options& options) {
  std::vector<Run> runs;
  try {
    const assets::Rig rig = assets::load_rig(file.string());
    const bool has_flesh = std::any_of(rig.parts.begin(), rig.parts.end(), [](const assets::Part& part) {
      return part.role == assets::PartRole::Simulated;
    });
    if (!has_flesh) return {};
    for (const skeleton::Clip& clip : rig.clips) {
      if (static_cast<int>(runs.size()) == options.clips) break;
      if (clip.num_keys < 2 || !(clip.duration() > 0.0)) continue;
      constexpr double kFps = 30.0;  // the command's own
      const int last = static_cast<int>(std::floor(clip.duration() * kFps + 1e-6));
      runs.push_back({file, clip.name, std::min(options.frames, last + 1)});
    }
  } catch (const assets::InputError& error) {
    fmt::print(stderr, "{}\n", error.what());
  }
  return runs;
}

Row failed(const std::string& why) {
  return {"failed", fmt::format("| failed: {} | | | | | | | |", escaped(why))};
}

/// Simulates it as a user does; `folder` for its output and that of the rig's other clips.
Row simulate(const Run& run, const fs::path& folder) {
  const fs::path out = folder / "out", said = folder / "said";
  fs::create_directories(folder);
  const std::string command = fmt::format(
      "{} simulate {} --clip {} --frames 0-{} --threads 1 --preview off --overwrite -o {} > /dev/null 2> {}",
      quoted((own_folder() / "sinew").string()), quoted(run.rig.string()), quoted(run.clip), run.frames - 1,
      quoted(out.string()), quoted(said.string()));
  if (std::system(command.c_str()) != 0) {
    std::ifstream stream(said);
    std::string line, last;
    while (std::getline(stream, line)) last = line;
    return failed(last);
  }
  std::ifstream stream(out / "report.json");
  const nlohmann::json report = nlohmann::json::parse(stream);
  double torn = 0.0, creases = 0.0, roughness = 0.0, mended = 0.0, total = 0.0;
  int steps = 0;
  for (const nlohmann::json& frame : report.at("frames")) {
    const nlohmann::json& skin = frame.at("skin");
    torn = std::max(torn, skin.at("torn_area").get<double>());
    creases = std::max(creases, skin.at("creases_heights").get<double>());
    roughness = std::max(roughness, skin.at("roughness_edges").get<double>());
    mended = std::max(mended, frame.at("largest_mended_m").get<double>());
    steps += frame.at("steps").get<int>();
  }
  for (const auto& [phase, seconds] : report.at("seconds").items()) total += seconds.get<double>();
  const double stepping = report.at("seconds").at("simulate and write frames").get<double>();
  const nlohmann::json& skin = report.at("skin");
  const auto verdict = skin.at("verdict").get<std::string>();
  const auto place = skin.value("worst_place", std::string());
  return {verdict,
          fmt::format("| {} | {:.2f} | {:.2f} | {:.2f} | {:.2g} | {}: {} | {:.1f} | {:.1f} |", verdict,
                      100.0 * torn, creases, roughness, 100.0 * mended / report.at("height_m").get<double>(),
                      skin.at("worst_frame").get<int>(), escaped(place), 1e3 * stepping / std::max(steps, 1),
                      total)};
}

/// "12 of 20 (60 %)".
std::string share(std::ptrdiff_t part, std::size_t whole) {
  return fmt::format("{} of {} ({:.0f} %)", part, whole,
                     100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

std::string summary(const std::vector<Row>& rows) {
  const auto count = [&](const std::string& verdict) {
    return std::count_if(rows.begin(), rows.end(), [&](const Row& row) { return row.verdict == verdict; });
  };
  const std::ptrdiff_t fine = count("fine"), whole = fine + count("rough");
  return fmt::format("Fine: {}; not torn: {}.", share(fine, rows.size()), share(whole, rows.size()));
}

int run(int argc, char** argv) {
  CLI::App app{"Simulates animated rigs with no option given and prints a table of verdicts on their skins."};
  Options options;
  app.add_option("RIGS", options.places,
                 "rig files, or folders of them; the bundled samples where none is given");
  app.add_option("--frames", options.frames, "first frames of every clip")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--clips", options.clips, "first clips of every rig")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (options.places.empty()) options.places.emplace_back(SINEW_SAMPLES);
  std::vector<Run> runs;
  int without = 0;
  for (const fs::path& rig : tools::find_rigs(options.places)) {
    const std::vector<Run> of_rig = runs_of(rig, options);
    if (of_rig.empty()) ++without;
    runs.insert(runs.end(), of_rig.begin(), of_rig.end());
  }
  if (runs.empty()) throw std::runtime_error("no animated, skinned rig among the files given");
  const fs::path folder = fs::temp_directory_path() / fmt::format("sinew_verdicts_{}", ::getpid());
  std::vector<Row> rows(runs.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&](int worker) {
    for (std::size_t i = next++; i < runs.size(); i = next++) {
      try {
        rows[i] = simulate(runs[i], folder / std::to_string(worker));
      } catch (const std::exception& error) {  // of a report that is none
        rows[i] = failed(error.what());
      }
      fmt::print(stderr, "{}, {}: {}\n", runs[i].rig.filename().string(), runs[i].clip, rows[i].verdict);
    }
  };
  std::vector<std::thread> workers;
  for (int worker = 0; worker < kAtOnce; ++worker) workers.emplace_back(work, worker);
  for (std::thread& worker : workers) worker.join();
  fs::remove_all(folder);
  fmt::print(
      "| rig | clip | skin | torn area, % | creases, heights | roughness, edges | mended, % of the "
      "height | worst frame and place | ms per step | s in all "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < runs.size(); ++i)
    fmt::print("| {} | {} {}\n", escaped(runs[i].rig.filename().string()), escaped(runs[i].clip),
               rows[i].cells);
  fmt::print("\n{} Files without a skinned, animated character: {}.\n", summary(rows), without);
  return 0;
}

}  // namespace

/// verdict_table [RIGS...] [--frames N] [--clips N]. The table goes to stdout, progress to stderr.
int main(int argc, char** argv) try { return run(argc, argv); } catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 3;
}
