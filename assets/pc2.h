#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include "assets/point_cache.h"

/// Point caches (PC2): a 32-byte header and then every sample's positions as 32-bit floats, all
/// little-endian.
///
///     bytes 0-11   "POINTCACHE2" and a zero
///     bytes 12-15  int32    version, 1
///     bytes 16-19  int32    points per sample
///     bytes 20-23  float32  frame of the first sample
///     bytes 24-27  float32  frames between samples
///     bytes 28-31  int32    samples
///     then         float32  x y z of point 0 of sample 0, of point 1, ...
namespace sinew::assets {

/// Writes a cache sample by sample. Until finish() the header says that there are no samples.
class Pc2Writer final : public PointCacheWriter {
 public:
  /// Throws IoError naming the file, std::invalid_argument where num_points < 1.
  Pc2Writer(const std::string& file, int num_points, double first_frame = 0.0);
  ~Pc2Writer() override;
  Pc2Writer(const Pc2Writer&) = delete;
  Pc2Writer& operator=(const Pc2Writer&) = delete;

  /// Appends one sample, num_points x 3. Throws std::invalid_argument for another size, std::domain_error as
  /// to_float, IoError naming the file and the sample.
  void write(const lattice::Points& points) override;

  /// Enters the number of samples and closes the file. Throws IoError.
  void finish() override;

  int num_samples() const { return num_samples_; }

 private:
  void put(const void* data, std::size_t size);

  std::string file_;
  std::FILE* stream_ = nullptr;
  int num_points_;
  std::int32_t num_samples_ = 0;
};

/// Reads a cache.
class Pc2Reader final : public PointCacheReader {
 public:
  /// Throws IoError where the file cannot be read, InputError where it is no PC2 file or not as long as its
  /// header says.
  explicit Pc2Reader(const std::string& file);

  int num_points() const override { return num_points_; }
  int num_samples() const override { return num_samples_; }
  double first_frame() const override { return first_frame_; }
  double frames_per_sample() const override { return frames_per_sample_; }

  /// Positions of a sample, 0 <= sample < num_samples. Throws std::out_of_range, IoError.
  FloatPoints read(int sample) const override;

 private:
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  std::string file_;
  std::unique_ptr<std::FILE, Close> stream_;
  int num_points_ = 0, num_samples_ = 0;
  float first_frame_ = 0.0f, frames_per_sample_ = 1.0f;
};

}  // namespace sinew::assets
