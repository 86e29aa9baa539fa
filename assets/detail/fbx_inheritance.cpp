#include "assets/detail/fbx_inheritance.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace sinew::assets::detail {

namespace {

/// Scales closer to each other than this make no visible difference: a tenth of the self-check's 1e-4.
constexpr double kSameScale = 1e-5;
/// Samples per key interval of an inverse scale; the error of a chord falls with the square of their number:
/// for a scale that doubles between two keys it stays below 1e-3 of the scale.
constexpr int kSamplesPerKey = 16;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

using ScaleTracks = std::vector<const skeleton::VectorTrack*>;

class Inheritance {
 public:
  Inheritance(const std::map<std::string, FbxInherit>& inherit, ImportedScene& scene) : scene_(scene) {
    for (const ImportedNode& node : scene_.nodes) {
      const auto found = inherit.find(node.name);
      mode_.push_back(found == inherit.end() ? FbxInherit::RSrs : found->second);
    }
  }

  void run() {
    affected_.assign(scene_.nodes.size(), false);
    bool any = false;
    for (std::size_t n = 0; n < scene_.nodes.size(); ++n) {
      affected_[n] = makes_difference(n);
      any = any || affected_[n];
    }
    if (!any) return;
    gathered_.resize(scene_.nodes.size());
    for (std::size_t n = 0; n < scene_.nodes.size(); ++n) {
      if (affected_[n]) gathered_[n] = gathered_from(n);
    }
    insert_nodes();
    for (skeleton::Clip& clip : scene_.clips) rewrite_clip(clip);
  }

 private:
  /// Ancestors whose scale the node's mode treats unlike a matrix product does.
  std::vector<int> gathered_from(std::size_t n) const {
    std::vector<int> list;
    int up = scene_.nodes[n].parent;
    if (mode_[n] == FbxInherit::Rrs && up >= 0) list.push_back(up);
    if (mode_[n] == FbxInherit::RrSs) {
      while (up >= 0) {
        list.push_back(up);
        if (mode_[at(up)] != FbxInherit::RrSs) break;
        up = scene_.nodes[at(up)].parent;
      }
    }
    return list;
  }

  static const skeleton::VectorTrack* scale_track(const skeleton::Clip& clip, int node) {
    for (const skeleton::Channel& channel : clip.channels) {
      if (channel.joint == node) return channel.scale ? &*channel.scale : nullptr;
    }
    return nullptr;
  }

  bool matters(FbxInherit mode, const Eigen::Vector3d& scale) const {
    if (mode == FbxInherit::Rrs) return (scale - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff() > kSameScale;
    // A uniform scale commutes with every rotation.
    const double largest = scale.cwiseAbs().maxCoeff();
    return scale.maxCoeff() - scale.minCoeff() > kSameScale * std::max(largest, 1e-30);
  }

  bool makes_difference(std::size_t n) const {
    if (mode_[n] == FbxInherit::RSrs) return false;
    for (const int up : gathered_from(n)) {
      if (matters(mode_[n], scene_.nodes[at(up)].local.scale)) return true;
      for (const skeleton::Clip& clip : scene_.clips) {
        const skeleton::VectorTrack* track = scale_track(clip, up);
        if (track == nullptr) continue;
        for (const Eigen::Vector3d& scale : track->values) {
          if (matters(mode_[n], scale)) return true;
        }
      }
    }
    return false;
  }

  static Eigen::Vector3d inverse(const Eigen::Vector3d& scale) {
    // A scale of nothing hides the node; what hangs on it stays hidden whatever stands here.
    return scale.unaryExpr([](double s) { return std::abs(s) > 1e-12 ? 1.0 / s : 1.0; });
  }

  Eigen::Vector3d still_scale(std::size_t n) const {
    Eigen::Vector3d product = Eigen::Vector3d::Ones();
    for (const int up : gathered_[n]) product = product.cwiseProduct(scene_.nodes[at(up)].local.scale);
    return product;
  }

  /// New nodes stand right before the node they serve; every index of the scene follows.
  void insert_nodes() {
    std::vector<ImportedNode> nodes;
    moved_.resize(scene_.nodes.size());
    helper_.assign(scene_.nodes.size(), -1);
    old_scales_.reserve(scene_.nodes.size());
    for (const ImportedNode& node : scene_.nodes) old_scales_.push_back(node.local.scale);
    for (std::size_t n = 0; n < scene_.nodes.size(); ++n) {
      ImportedNode node = scene_.nodes[n];
      if (node.parent >= 0) node.parent = moved_[at(node.parent)];
      if (affected_[n]) {
        const Eigen::Vector3d scale = still_scale(n);
        ImportedNode helper;
        helper.name = node.name + "_scale";
        helper.parent = node.parent;
        helper.helper = true;
        helper.local.translation = node.local.translation;
        helper.local.scale = inverse(scale);
        helper.parent_from_node = helper.local.matrix();
        helper_[n] = static_cast<int>(nodes.size());
        nodes.push_back(helper);
        node.parent = helper_[n];
        node.local.translation.setZero();
        if (mode_[n] == FbxInherit::RrSs) node.local.scale = node.local.scale.cwiseProduct(scale);
        node.parent_from_node = node.local.matrix();
      }
      moved_[n] = static_cast<int>(nodes.size());
      nodes.push_back(std::move(node));
    }
    scene_.nodes = std::move(nodes);
    for (ImportedSkin& skin : scene_.skins) {
      for (int& joint : skin.joints) joint = moved_[at(joint)];
    }
    for (ImportedInstance& instance : scene_.instances) instance.node = moved_[at(instance.node)];
  }

  Eigen::Vector3d scale_at(const skeleton::Clip& clip, int node, double time) const {
    const skeleton::VectorTrack* track = scale_track(clip, node);
    return track == nullptr ? old_scales_[at(node)] : skeleton::sample(*track, time);
  }

  Eigen::Vector3d gathered_at(const skeleton::Clip& clip, std::size_t n, double time) const {
    Eigen::Vector3d product = Eigen::Vector3d::Ones();
    for (const int up : gathered_[n]) product = product.cwiseProduct(scale_at(clip, up, time));
    return product;
  }

  /// Times of all keys that bear on the scale of node n, with samples between them; empty: nothing is
  /// animated.
  std::vector<double> times_for(const skeleton::Clip& clip, std::size_t n) const {
    std::set<double> keys;
    for (const int up : gathered_[n]) {
      if (const auto* track = scale_track(clip, up)) keys.insert(track->times.begin(), track->times.end());
    }
    if (keys.empty()) return {};
    if (const auto* track = scale_track(clip, static_cast<int>(n))) {
      keys.insert(track->times.begin(), track->times.end());
    }
    std::vector<double> times;
    for (auto key = keys.begin(); key != keys.end(); ++key) {
      const auto next = std::next(key);
      times.push_back(*key);
      if (next == keys.end()) break;
      for (int i = 1; i < kSamplesPerKey; ++i) times.push_back(*key + (*next - *key) * i / kSamplesPerKey);
    }
    return times;
  }

  void rewrite_clip(skeleton::Clip& clip) const {
    const skeleton::Clip old = clip;
    std::vector<skeleton::Channel> added;
    for (std::size_t n = 0; n < affected_.size(); ++n) {
      if (!affected_[n]) continue;
      skeleton::Channel helper;
      helper.joint = helper_[n];
      auto own = std::find_if(clip.channels.begin(), clip.channels.end(),
                              [&](const skeleton::Channel& c) { return c.joint == static_cast<int>(n); });
      const std::vector<double> times = times_for(old, n);
      if (own != clip.channels.end()) {
        helper.translation = std::move(own->translation);
        own->translation.reset();
      }
      if (!times.empty()) {
        helper.scale.emplace();
        helper.scale->times = times;
        for (const double t : times) helper.scale->values.push_back(inverse(gathered_at(old, n, t)));
        if (mode_[n] == FbxInherit::RrSs) multiply_own_scale(old, n, times, clip, added);
      } else if (mode_[n] == FbxInherit::RrSs && own != clip.channels.end() && own->scale) {
        for (Eigen::Vector3d& scale : own->scale->values)
          scale = scale.cwiseProduct(gathered_at(old, n, 0.0));
      }
      if (helper.translation || helper.scale) added.push_back(std::move(helper));
    }
    // Old indices are still in use up to here; helpers carry new ones already.
    for (skeleton::Channel& channel : clip.channels) channel.joint = moved_[at(channel.joint)];
    clip.channels.insert(clip.channels.end(), std::make_move_iterator(added.begin()),
                         std::make_move_iterator(added.end()));
  }

  void multiply_own_scale(const skeleton::Clip& old, std::size_t n, const std::vector<double>& times,
                          skeleton::Clip& clip, std::vector<skeleton::Channel>& added) const {
    skeleton::VectorTrack track;
    track.times = times;
    for (const double t : times) {
      track.values.push_back(scale_at(old, static_cast<int>(n), t).cwiseProduct(gathered_at(old, n, t)));
    }
    for (skeleton::Channel& channel : clip.channels) {
      if (channel.joint != static_cast<int>(n)) continue;
      channel.scale = std::move(track);
      return;
    }
    skeleton::Channel channel;
    channel.joint = moved_[n];
    channel.scale = std::move(track);
    added.push_back(std::move(channel));
  }

  ImportedScene& scene_;
  std::vector<FbxInherit> mode_;
  std::vector<bool> affected_;
  std::vector<std::vector<int>> gathered_;  ///< old indices.
  std::vector<int> moved_;                  ///< old to new index.
  std::vector<int> helper_;                 ///< new index of the inserted node.
  std::vector<Eigen::Vector3d> old_scales_;
};

}  // namespace

void apply_fbx_inheritance(const std::map<std::string, FbxInherit>& inherit, ImportedScene& scene) {
  Inheritance(inherit, scene).run();
}

}  // namespace sinew::assets::detail
