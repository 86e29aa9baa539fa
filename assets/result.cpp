#include "assets/result.h"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/detail/file_bytes.h"
#include "assets/detail/units.h"
#include "assets/error.h"
#include "assets/obj.h"

namespace sinew::assets {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using lattice::Points;

double extent_along_y(const Points& points) {
  return points.rows() == 0 ? 0.0 : points.col(1).maxCoeff() - points.col(1).minCoeff();
}

/// The cache of a run in its output folder: of the first format of which there is one.
std::string cache_in(const std::string& folder) {
  std::string first;
  for (const PointCacheFormat& format : point_cache_formats()) {
    const fs::path file = fs::path(folder) / ("skin" + std::string(format.extension));
    std::error_code ignored;
    if (fs::exists(file, ignored)) return file.string();
    if (first.empty()) first = file.string();
  }
  return first;
}

/// A member of the sidecar; what is missing or of another type makes it no sidecar of ours.
template <class T>
T member(const std::string& file, const Json& json, const Json::json_pointer& at) {
  try {
    return json.at(at).get<T>();
  } catch (const Json::exception&) {
    throw InputError(file, at.to_string() + ": missing or of the wrong type, expected the sidecar of a run");
  }
}

}  // namespace

Result::Result(const std::string& path) : path_(path) {
  std::error_code ignored;
  const bool folder = fs::is_directory(path, ignored);
  const std::string cache = folder ? cache_in(path) : path;
  const fs::file_status status = fs::status(cache, ignored);
  if (!fs::exists(status)) {
    throw IoError(fmt::format("{}: not found ({}){}", cache, fs::absolute(cache, ignored).string(),
                              folder ? "; hint: is the folder the output of sinew simulate?" : ""));
  }
  // A pipe might never answer.
  if (!fs::is_regular_file(status)) throw IoError(cache + ": not a regular file");
  cache_ = read_point_cache(cache);
  first_frame_ = static_cast<int>(std::lround(cache_->first_frame()));
  const std::string sidecar = fs::path(cache).replace_extension(".json").string();
  if (folder || fs::exists(sidecar, ignored)) read_sidecar(sidecar);
  if (num_frames() == 0)
    throw InputError(cache, "holds no frame, expected at least one; hint: was the run stopped?");
  height_ = extent_along_y(has_sidecar_ ? rest_ : frame(first_frame_));
}

void Result::read_sidecar(const std::string& file) {
  const std::string text = detail::read_whole(file);
  const Json json = Json::parse(text, nullptr, false);
  using At = Json::json_pointer;
  if (!json.is_object() || json.value("format", "") != "sinew-cache")
    throw InputError(file, "no sidecar of a run, expected JSON with \"format\": \"sinew-cache\"");
  const double unit = member<double>(file, json, At("/units/metres_per_unit"));
  const std::string up = member<std::string>(file, json, At("/axes/up"));
  fps_ = member<double>(file, json, At("/fps"));
  if (!(unit > 0.0) || !std::isfinite(unit) || !(fps_ > 0.0))
    throw InputError(file,
                     fmt::format("units and fps: got {} m and {}, expected positive numbers", unit, fps_));
  if (up != "X" && up != "Y" && up != "Z")
    throw InputError(file, fmt::format("/axes/up: got '{}', expected X, Y or Z", up));
  const UpAxis axis = up == "X" ? UpAxis::X : up == "Z" ? UpAxis::Z : UpAxis::Y;
  metres_from_file_ = unit * detail::y_up_from(axis);
  const std::string rest_name = member<std::string>(file, json, At("/rest_mesh"));
  // Only a file beside the sidecar: a name with folders in it might lead anywhere.
  const fs::path rest_file = fs::path(file).parent_path() / fs::path(rest_name).filename();
  rest_ = in_metres(read_surface(rest_file.string()).points);
  if (rest_.rows() != num_points()) {
    throw InputError(rest_file.string(), fmt::format("{} vertices, expected the {} of the cache beside it",
                                                     rest_.rows(), num_points()));
  }
  has_sidecar_ = true;
}

Points Result::in_metres(const Points& points) const { return points * metres_from_file_.transpose(); }

Points Result::frame(int number) const {
  const FloatPoints points = cache_->read(number - first_frame_);
  if (!points.allFinite()) {
    throw InputError(
        path_, fmt::format("frame {}: a coordinate is not finite, expected positions of vertices", number));
  }
  return in_metres(points.cast<double>());
}

}  // namespace sinew::assets
