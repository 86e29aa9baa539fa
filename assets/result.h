#pragma once

#include <memory>
#include <string>

#include "assets/point_cache.h"

/// Reading back what a run has written: the frames of a point cache in metres, Y up, whatever the cache's own
/// units.
namespace sinew::assets {

/// One result, opened. Reads frames from the disk when asked: a result may be larger than the memory.
class Result {
 public:
  /// `path`: an output folder of a run (skin.pc2 with skin.json and its rest mesh), or a point cache, with or
  /// without a sidecar of the same name beside it. Throws IoError where a file cannot be read, InputError
  /// where one is damaged or they do not fit each other.
  explicit Result(const std::string& path);

  const std::string& path() const { return path_; }  ///< as the user gave it.
  int num_points() const { return cache_->num_points(); }
  int num_frames() const { return cache_->num_samples(); }
  int first_frame() const { return first_frame_; }
  /// Frames per second; 0 where no sidecar says it.
  double fps() const { return fps_; }
  /// False for a bare cache: then its units are taken as metres with Y up.
  bool has_sidecar() const { return has_sidecar_; }
  /// Rest positions, num_points x 3 [m], Y up; without rows for a bare cache.
  const lattice::Points& rest() const { return rest_; }
  /// Extent along Y of the rest positions, or of the first frame of a bare cache [m].
  double height() const { return height_; }
  /// Positions of a frame, num_points x 3 [m], Y up; first_frame() <= frame < first_frame() + num_frames().
  lattice::Points frame(int number) const;

 private:
  void read_sidecar(const std::string& file);
  lattice::Points in_metres(const lattice::Points& points) const;

  std::string path_;
  std::unique_ptr<PointCacheReader> cache_;
  lattice::Points rest_;
  Eigen::Matrix3d metres_from_file_ = Eigen::Matrix3d::Identity();
  int first_frame_ = 0;
  double fps_ = 0.0, height_ = 0.0;
  bool has_sidecar_ = false;
};

}  // namespace sinew::assets
