#include "tools/session/skin_report.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "fem/body/limb_radius.h"
#include "tools/session/whole_skin.h"
#include "tools/support/errors.h"

namespace sinew::tools {
namespace {

using fem::SkinFault;
using fem::SkinVerdict;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// How many cells the limb at a vertex is thick.
double cells_across(const Character& c, const fem::Body& body, int vertex) {
  const lattice::ControlLattice& lattice = c.lattice.lattice;
  const lattice::Surface& skin = c.input.skin.surface;
  const int at = c.input.skin.surface_of_vertex[static_cast<std::size_t>(vertex)];
  if (at < 0 || lattice.bones.empty()) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d p = skin.points.row(at).transpose();
  int nearest = 0;
  double least = std::numeric_limits<double>::infinity(), along = 0.0;
  for (std::size_t b = 0; b < lattice.bones.size(); ++b) {
    const Eigen::Vector3d start = lattice.bones[b].rest_start, span = lattice.bones[b].rest_end - start;
    const double share = std::clamp((p - start).dot(span) / std::max(span.squaredNorm(), 1e-300), 0.0, 1.0);
    const double distance = (p - start - share * span).norm();
    if (distance >= least) continue;
    least = distance;
    nearest = static_cast<int>(b);
    along = share * span.norm();
  }
  const fem::LimbRadii radii(lattice, body.tree, skin, lattice.edge_length);
  return 2.0 * radii.near(nearest, along) / lattice.edge_length;
}

std::string fault_text(const fem::SkinFrame& frame, SkinFault fault) {
  switch (fault) {
    case SkinFault::TornArea:
      return fmt::format(
          "{:.2g} % of the skin's area is turned over, stretched beyond 2.5 or squeezed below 0.2",
          100.0 * frame.torn_area);
    case SkinFault::Creases:
      return fmt::format("creases {:.2g} times as long as the character is tall", frame.creases);
    case SkinFault::Roughness:
      return fmt::format("bumps of {:.2g} of the length of the skin's edges", frame.roughness);
    case SkinFault::FarAway:
      break;
  }
  return fmt::format("{:.2g} % of the height from plain skinning before anything has moved",
                     100.0 * frame.away_most);
}

std::string remedy(const Scene& scene, const Character& c, const fem::Body& body, int vertex,
                   SkinFault fault) {
  if (scene.guard == Switch::Off && fault != SkinFault::FarAway)
    return "--guard on, which lays torn skin back towards plain skinning";
  // What is away before anything has moved sags or bends otherwise than the rig; only the first gets better
  // by stiffer flesh.
  if (fault == SkinFault::FarAway)
    return "--offset 1, which starts at the rig's own shape and adds what the flesh moves";
  const double across = cells_across(c, body, vertex);
  const std::string stiffer = fmt::format("--young {:.2g}", much_stiffer(c));
  constexpr double kEnough = 0.5;
  constexpr double kMostCells = 8000.0;
  if (across >= kEnough || !scene.lattice.empty() || scene.cell_size) return stiffer + ", stiffer flesh";
  const double cells = std::min(kMostCells, scene.cells * std::clamp(std::pow(1.0 / across, 3.0), 2.0, 5.0));
  return fmt::format("--cells {:.0f}, as the limb is {:.2g} of a cell thick, and {}", cells, across, stiffer);
}

SkinFinding describe(const Scene& scene, const Character& c, const fem::Body& body,
                     const fem::SkinFrame& frame, const fem::Judgement& judgement, const std::string& when) {
  SkinFinding finding;
  finding.verdict = judgement.verdict;
  if (frame.worst_vertex < 0) return finding;
  finding.place = place_of(c.rig, frame.worst_vertex);
  if (finding.verdict == SkinVerdict::Fine) return finding;
  finding.line = fmt::format("{}: {}: the skin is {} at {}: {}; hint: {}", c.rig.file, when,
                             fem::name(finding.verdict), finding.place, fault_text(frame, judgement.fault),
                             remedy(scene, c, body, frame.worst_vertex, judgement.fault));
  return finding;
}

/// How far volume is off [-], by rest or by plain skinning, whichever is nearer: limbs that cross each other
/// count twice in both.
double volume_error(const fem::SkinFrame& frame) {
  return std::min(std::abs(frame.volume_of_rest - 1.0), std::abs(frame.volume_ratio - 1.0));
}

/// No remedy is named: neo-Hookean flesh helps a snake and not a spider.
std::string volume_text(const Character& c, const fem::SkinFrame& frame, const std::string& when) {
  constexpr double kAllowed = 0.05;
  if (volume_error(frame) <= kAllowed) return {};
  return fmt::format("{}: {}: the skin holds {:.2f} times its volume at rest", c.rig.file, when,
                     frame.volume_of_rest);
}

}  // namespace

double much_stiffer(const Character& c) {
  double young = c.body_options.material.young;
  for (const fem::JointMaterial& of_joint : c.body_options.materials)
    young = std::max(young, of_joint.material.young);
  return 4.0 * young;
}

std::optional<fem::SkinJudge> make_skin_judge(const Character& c, const std::vector<double>& times) {
  if (!(c.rig.height > 0.0) || c.clip < 0) return std::nullopt;
  std::vector<bool> flesh;
  for (const int on_surface : c.input.skin.surface_of_vertex) flesh.push_back(on_surface >= 0);
  std::vector<lattice::Points> plain;
  // Rest and three poses tell what is one vertex from what only touches.
  for (const std::size_t k : {std::size_t{0}, times.size() / 2, times.size() - 1})
    plain.push_back(assets::skin(c.rig, c.pose(times[k])));
  const lattice::Points rest = rest_points(c.rig);
  return fem::SkinJudge({rest, all_triangles(c.rig), flesh, plain, c.rig.height});
}

// A plain scene has no skinning of an artist's to be judged by.
FrameJudge::FrameJudge(const Scene& scene, const Character& character, const FrameRange& frames) {
  if (scene.plain) return;
  const auto start = std::chrono::steady_clock::now();
  std::vector<double> times;
  for (int number = frames.first; number <= frames.last; ++number)
    times.push_back(character.the_clip().start + number / scene.fps);
  judge_ = make_skin_judge(character, times);
  seconds_ = seconds_since(start);
}

std::optional<fem::SkinFrame> FrameJudge::measure(const lattice::Points& flesh, const lattice::Points& plain,
                                                  fem::FrameKind kind) {
  if (!judge_) return std::nullopt;
  const auto start = std::chrono::steady_clock::now();
  const fem::SkinFrame frame = judge_->measure(flesh, plain, kind);
  seconds_ += seconds_since(start);
  return frame;
}

SkinFinding find_fault(const Scene& scene, const Character& c, const fem::Body& body,
                       const std::vector<fem::SkinFrame>& frames, const std::vector<int>& numbers) {
  const fem::SkinSummary summary = fem::summarise(frames);
  if (summary.worst_frame < 0) return {};
  const auto worst = static_cast<std::size_t>(summary.worst_frame);
  SkinFinding finding =
      describe(scene, c, body, frames[worst], summary.judgement, fmt::format("frame {}", numbers[worst]));
  finding.frame = numbers[worst];
  finding.torn_frames = summary.torn_frames;
  const auto swollen = std::ranges::max_element(frames, {}, volume_error);
  finding.volume_line = volume_text(
      c, *swollen, fmt::format("frame {}", numbers[static_cast<std::size_t>(swollen - frames.begin())]));
  return finding;
}

SkinFinding find_fault(const Scene& scene, const Character& c, const fem::Body& body,
                       const fem::SkinFrame& pose, double time) {
  const std::string when = fmt::format("pose at {:.4g} s", time);
  SkinFinding finding = describe(scene, c, body, pose, fem::judge(pose, fem::FrameKind::First), when);
  finding.volume_line = volume_text(c, pose, when);
  finding.torn_frames = finding.verdict == SkinVerdict::Torn ? 1 : 0;
  return finding;
}

void tell(const SkinFinding& finding, const Talk& talk) {
  if (!finding.volume_line.empty()) talk("note: " + finding.volume_line);
  // Last, where it is seen.
  if (!finding.line.empty())
    talk((finding.verdict == SkinVerdict::Torn ? "warning: " : "note: ") + finding.line);
}

void refuse_torn(const SkinFinding& finding) {
  if (finding.verdict == SkinVerdict::Torn) throw NumericalError(finding.line);
}

}  // namespace sinew::tools
