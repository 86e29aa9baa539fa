#include "assets/point_cache.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "assets/error.h"
#include "assets/pc2.h"

namespace sinew::assets {
namespace {

template <class Writer>
std::unique_ptr<PointCacheWriter> writer(const std::string& file, int num_points, double first_frame) {
  return std::make_unique<Writer>(file, num_points, first_frame);
}

template <class Reader>
std::unique_ptr<PointCacheReader> reader(const std::string& file) {
  return std::make_unique<Reader>(file);
}

constexpr std::array kFormats{
    PointCacheFormat{".pc2", "point cache 2, single precision", writer<Pc2Writer>, reader<Pc2Reader>},
};

std::string known_extensions() {
  std::string list;
  for (const PointCacheFormat& format : kFormats)
    list.append(list.empty() ? "" : ", ").append(format.extension);
  return list;
}

std::string extension_of(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

FloatPoints to_float(const lattice::Points& points) {
  constexpr double kMost = std::numeric_limits<float>::max();
  FloatPoints floats(points.rows(), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double x = points(i, c);
      if (!(std::abs(x) <= kMost))  // true for NaN
        throw std::domain_error(fmt::format(
            "vertex {}, {}: {}, expected a finite number within the range of a float", i, "xyz"[c], x));
      floats(i, c) = static_cast<float>(x);
    }
  }
  return floats;
}

std::span<const PointCacheFormat> point_cache_formats() { return kFormats; }

const PointCacheFormat* find_point_cache_format(const std::string& file) {
  const std::string extension = extension_of(file);
  const auto found = std::find_if(kFormats.begin(), kFormats.end(), [&](const PointCacheFormat& format) {
    return format.extension == extension;
  });
  return found == kFormats.end() ? nullptr : &*found;
}

std::unique_ptr<PointCacheWriter> write_point_cache(const std::string& file, int num_points,
                                                    double first_frame) {
  const PointCacheFormat* format = find_point_cache_format(file);
  if (format == nullptr)
    throw ConfigError(file + ": is no point cache by its name, expected one of " + known_extensions());
  return format->write(file, num_points, first_frame);
}

std::unique_ptr<PointCacheReader> read_point_cache(const std::string& file) {
  const PointCacheFormat* format = find_point_cache_format(file);
  if (format == nullptr)
    throw InputError(file, "is no point cache by its name, expected one of " + known_extensions());
  return format->read(file);
}

}  // namespace sinew::assets
