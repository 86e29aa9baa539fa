#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "lattice/points.h"

/// Frames of one mesh in a file: formats as rows of one table.
namespace sinew::assets {

using FloatPoints = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// The positions as caches of single precision store them. Throws std::domain_error naming the vertex where a
/// coordinate is not finite or beyond the range of a float.
FloatPoints to_float(const lattice::Points& points);

/// Writes a cache sample by sample.
class PointCacheWriter {
 public:
  virtual ~PointCacheWriter() = default;

  /// Appends one sample, num_points x 3. Throws std::invalid_argument for another size, std::domain_error as
  /// to_float, IoError naming the file and the sample.
  virtual void write(const lattice::Points& points) = 0;
  /// Completes and closes the file. Throws IoError.
  virtual void finish() = 0;
};

/// Reads a cache.
class PointCacheReader {
 public:
  virtual ~PointCacheReader() = default;

  virtual int num_points() const = 0;
  virtual int num_samples() const = 0;
  virtual double first_frame() const = 0;
  virtual double frames_per_sample() const = 0;
  /// Positions of a sample, 0 <= sample < num_samples. Throws std::out_of_range, IoError.
  virtual FloatPoints read(int sample) const = 0;
};

/// A row of the table.
struct PointCacheFormat {
  std::string_view extension;    ///< with its dot, in lower case.
  std::string_view description;  ///< one line.
  /// Throws IoError naming the file, std::invalid_argument where num_points < 1.
  std::unique_ptr<PointCacheWriter> (*write)(const std::string& file, int num_points, double first_frame);
  /// Throws IoError where the file cannot be read, InputError where it is damaged.
  std::unique_ptr<PointCacheReader> (*read)(const std::string& file);
};

std::span<const PointCacheFormat> point_cache_formats();

/// Of a file by its extension, in any case; nullptr where there is none.
const PointCacheFormat* find_point_cache_format(const std::string& file);

/// Opens a file for writing, or reading, in the format of its extension. Throws as the format does, and
/// ConfigError or InputError naming the extensions that there are.
std::unique_ptr<PointCacheWriter> write_point_cache(const std::string& file, int num_points,
                                                    double first_frame = 0.0);
std::unique_ptr<PointCacheReader> read_point_cache(const std::string& file);

}  // namespace sinew::assets
