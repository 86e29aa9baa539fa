#pragma once

#include <memory>
#include <string>
#include <vector>

#include "assets/atomic_output.h"
#include "assets/obj.h"
#include "assets/point_cache.h"
#include "assets/preview.h"
#include "assets/sidecar.h"
#include "tools/session/frame.h"
#include "tools/session/run_report.h"

/// The files of a run.
namespace sinew::tools {

inline constexpr const char* kRestFile = "skin.obj";
inline constexpr const char* kCacheFile = "skin.pc2";
inline constexpr const char* kSidecarFile = "skin.json";
inline constexpr const char* kLatticeFile = "lattice.vtu";
inline constexpr const char* kReportFile = "report.json";
inline constexpr const char* kPictureFile = "preview.png";

/// Which vertices are written, in which order and space.
struct OutputLayout {
  Eigen::Affine3d from_rig = Eigen::Affine3d::Identity();  ///< rig space to the output's.
  std::vector<int> rig_vertex;                             ///< rig vertex of every output vertex.
  std::vector<assets::NamedMesh> parts;                    ///< rest, in the output's space.
  assets::VertexOrder order = assets::VertexOrder::File;

  lattice::Points apply(const lattice::Points& rig_points) const {
    lattice::Points out(static_cast<Eigen::Index>(rig_vertex.size()), 3);
    for (std::size_t i = 0; i < rig_vertex.size(); ++i) {
      out.row(static_cast<Eigen::Index>(i)) =
          (from_rig * rig_points.row(rig_vertex[i]).transpose()).transpose();
    }
    return out;
  }
};

/// Throws assets::InputError where the scene's --output-mesh is not the rig's.
OutputLayout make_layout(const Scene& scene, const Character& character);

/// Writes the frames of a run into a point cache.
class CacheSink final : public FrameSink {
 public:
  /// All of them must outlive it; the format is that of the file's extension.
  CacheSink(const OutputLayout& layout, const Character& character, const std::string& file, int first_frame);

  /// Throws NumericalError naming frame and vertex for a position that a cache cannot hold.
  void take(const Frame& frame) override;
  void finish() override;

 private:
  const OutputLayout& layout_;
  const Character& character_;
  std::unique_ptr<assets::PointCacheWriter> writer_;
};

/// Keeps the frames that a contact sheet shows.
class PreviewSink final : public FrameSink {
 public:
  /// Of a run of `num_frames` frames. The character must outlive it.
  PreviewSink(const Character& character, int num_frames);

  void take(const Frame& frame) override;
  void write(const std::string& file) const;

 private:
  const Character& character_;
  std::vector<int> shown_;
  int taken_ = 0;
  std::vector<assets::PreviewFrame> frames_;
};

/// The files that stand beside the cache.
void write_companions(const Scene& scene, const Character& character, const OutputLayout& layout,
                      const RunReport& report, const fem::Body& body, const FrameRange& frames,
                      const assets::OutputDirectory& out);

}  // namespace sinew::tools
