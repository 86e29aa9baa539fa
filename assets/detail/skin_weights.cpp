#include "assets/detail/skin_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "assets/detail/text.h"

namespace sinew::assets::detail {

namespace {

using lattice::Influence;

/// Sums below this carry no direction: the smallest step of a 16-bit weight is 1.5e-5.
constexpr double kNoWeight = 1e-6;
/// Four 8-bit weights, each rounded by half a step, are off by at most 4 * 0.5 / 255 = 0.8 %: not worth a
/// word.
constexpr double kWorthReporting = 0.01;
/// Comparing every lost vertex with every weighted one would be quadratic; this many candidates place it well
/// enough.
constexpr std::size_t kMaxCandidates = 4096;

struct Statistics {
  std::size_t num_off = 0;
  std::size_t worst_vertex = 0;
  double worst_sum = 1.0;
  std::size_t num_missing = 0;
  std::size_t num_not_numbers = 0;  ///< vertices.
  std::size_t max_influences = 0;
};

void merge_joints(std::vector<Influence>& influences) {
  std::stable_sort(influences.begin(), influences.end(),
                   [](const Influence& a, const Influence& b) { return a.frame < b.frame; });
  std::vector<Influence> merged;
  for (const Influence& influence : influences) {
    if (!merged.empty() && merged.back().frame == influence.frame) {
      merged.back().weight += influence.weight;
    } else {
      merged.push_back(influence);
    }
  }
  influences = std::move(merged);
}

Statistics divide_by_sums(ImportedMesh& mesh) {
  Statistics statistics;
  for (std::size_t v = 0; v < mesh.weights.size(); ++v) {
    std::vector<Influence>& influences = mesh.weights[v];
    if (std::erase_if(influences, [](const Influence& i) { return !std::isfinite(i.weight); }) > 0)
      ++statistics.num_not_numbers;
    merge_joints(influences);
    double sum = 0.0;
    for (const Influence& influence : influences) sum += influence.weight;
    if (sum < kNoWeight) {
      influences.clear();
      ++statistics.num_missing;
      continue;
    }
    statistics.max_influences = std::max(statistics.max_influences, influences.size());
    if (std::abs(sum - 1.0) > kWorthReporting) ++statistics.num_off;
    if (std::abs(sum - 1.0) > std::abs(statistics.worst_sum - 1.0)) {
      statistics.worst_sum = sum;
      statistics.worst_vertex = v;
    }
    for (Influence& influence : influences) influence.weight /= sum;
  }
  return statistics;
}

/// Spreads weights along triangle edges, ring by ring; lower vertex numbers give first.
void fill_along_edges(ImportedMesh& mesh) {
  bool changed = true;
  while (changed) {
    changed = false;
    std::vector<int> giver(mesh.weights.size(), -1);
    for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
      for (int c = 0; c < 3; ++c) {
        for (int d = 0; d < 3; ++d) {
          const int to = mesh.triangles(t, c), from = mesh.triangles(t, d);
          if (!mesh.weights[static_cast<std::size_t>(to)].empty()) continue;
          if (mesh.weights[static_cast<std::size_t>(from)].empty()) continue;
          int& best = giver[static_cast<std::size_t>(to)];
          if (best < 0 || from < best) best = from;
        }
      }
    }
    for (std::size_t v = 0; v < giver.size(); ++v) {
      if (giver[v] < 0) continue;
      mesh.weights[v] = mesh.weights[static_cast<std::size_t>(giver[v])];
      changed = true;
    }
  }
}

void fill_from_nearest(ImportedMesh& mesh) {
  std::vector<std::size_t> weighted, lost;
  for (std::size_t v = 0; v < mesh.weights.size(); ++v)
    (mesh.weights[v].empty() ? lost : weighted).push_back(v);
  if (weighted.empty()) return;
  const std::size_t stride = weighted.size() / kMaxCandidates + 1;
  for (const std::size_t v : lost) {
    double best = std::numeric_limits<double>::infinity();
    std::size_t giver = weighted.front();
    for (std::size_t i = 0; i < weighted.size(); i += stride) {
      const double distance_squared = (mesh.points.row(static_cast<Eigen::Index>(weighted[i])) -
                                       mesh.points.row(static_cast<Eigen::Index>(v)))
                                          .squaredNorm();
      if (distance_squared < best) {
        best = distance_squared;
        giver = weighted[i];
      }
    }
    mesh.weights[v] = mesh.weights[giver];
  }
}

void report(const ImportedMesh& mesh, const Statistics& statistics, std::vector<Finding>& findings) {
  const std::string num_vertices = std::to_string(mesh.weights.size());
  if (statistics.num_off > 0) {
    findings.push_back(
        {Finding::Severity::Warning, "weights-normalised", mesh.name,
         std::to_string(statistics.num_off) + " of " + num_vertices +
             " vertices had weights that did not sum to 1 (worst: " + number(statistics.worst_sum) +
             " at vertex " + std::to_string(statistics.worst_vertex) + "); they were normalised",
         "normalise the weights in the modelling program"});
  }
  if (statistics.num_not_numbers > 0) {
    findings.push_back({Finding::Severity::Warning, "weights-not-numbers", mesh.name,
                        std::to_string(statistics.num_not_numbers) + " of " + num_vertices +
                            " vertices had weights that are no numbers (nan or inf); those count as 0",
                        "weight these vertices again"});
  }
  if (statistics.num_missing > 0) {
    findings.push_back({Finding::Severity::Warning, "weights-missing", mesh.name,
                        std::to_string(statistics.num_missing) + " of " + num_vertices +
                            " vertices had no weight at all; they follow their neighbours",
                        "weight every vertex of the mesh"});
  }
  if (statistics.max_influences > 4) {
    findings.push_back({Finding::Severity::Info, "many-influences", mesh.name,
                        "up to " + std::to_string(statistics.max_influences) +
                            " joints move one vertex; all of them are used",
                        ""});
  }
}

}  // namespace

void normalise_weights(ImportedScene& scene) {
  std::vector<bool> skinned(scene.meshes.size(), false);
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.skin >= 0) skinned[static_cast<std::size_t>(instance.mesh)] = true;
  }
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    ImportedMesh& mesh = scene.meshes[m];
    if (!skinned[m] || mesh.weights.empty()) {
      mesh.weights.clear();
      continue;
    }
    const Statistics statistics = divide_by_sums(mesh);
    if (statistics.num_missing == mesh.weights.size()) {
      mesh.weights.clear();
      scene.findings.push_back(
          {Finding::Severity::Warning, "weights-missing", mesh.name,
           "no vertex has a weight although the mesh is bound to joints; it follows its node",
           "weight the mesh to its skeleton"});
      continue;
    }
    if (statistics.num_missing > 0) {
      fill_along_edges(mesh);
      fill_from_nearest(mesh);
    }
    report(mesh, statistics, scene.findings);
  }
  for (ImportedInstance& instance : scene.instances) {
    if (scene.meshes[static_cast<std::size_t>(instance.mesh)].weights.empty()) instance.skin = -1;
  }
}

}  // namespace sinew::assets::detail
