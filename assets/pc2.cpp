#include "assets/pc2.h"

#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#include <sys/stat.h>

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::assets {
namespace {

static_assert(std::endian::native == std::endian::little, "the header and samples are copied as they are");

struct Header {
  char magic[12] = {'P', 'O', 'I', 'N', 'T', 'C', 'A', 'C', 'H', 'E', '2', '\0'};
  std::int32_t version = 1;
  std::int32_t num_points = 0;
  float first_frame = 0.0f;
  float frames_per_sample = 1.0f;
  std::int32_t num_samples = 0;
};
static_assert(sizeof(Header) == 32);

}  // namespace

Pc2Writer::Pc2Writer(const std::string& file, int num_points, double first_frame)
    : file_(file), num_points_(num_points) {
  if (num_points < 1) throw std::invalid_argument("Pc2Writer: num_points must be positive");
  stream_ = std::fopen(file.c_str(), "wbe");
  if (stream_ == nullptr) throw IoError(file + ": cannot be created: " + std::strerror(errno));
  Header header;
  header.num_points = num_points;
  header.first_frame = static_cast<float>(first_frame);
  put(&header, sizeof header);
}

Pc2Writer::~Pc2Writer() {
  if (stream_ != nullptr) std::fclose(stream_);
}

void Pc2Writer::put(const void* data, std::size_t size) {
  if (std::fwrite(data, 1, size, stream_) != size)
    throw IoError(file_ + ": sample " + std::to_string(num_samples_) +
                  " cannot be written: " + std::strerror(errno));
}

void Pc2Writer::write(const lattice::Points& points) {
  if (points.rows() != num_points_)
    throw std::invalid_argument(fmt::format("Pc2Writer: {} points, expected {}", points.rows(), num_points_));
  if (num_samples_ == std::numeric_limits<std::int32_t>::max())
    throw LimitError(file_ + ": more samples than the format can count");
  const FloatPoints floats = to_float(points);
  put(floats.data(), sizeof(float) * static_cast<std::size_t>(floats.size()));
  ++num_samples_;
}

void Pc2Writer::finish() {
  if (std::fseek(stream_, offsetof(Header, num_samples), SEEK_SET) != 0)
    throw IoError(file_ + ": cannot be written: " + std::strerror(errno));
  put(&num_samples_, sizeof num_samples_);
  if (std::fclose(std::exchange(stream_, nullptr)) != 0)
    throw IoError(file_ + ": cannot be written: " + std::strerror(errno));
}

Pc2Reader::Pc2Reader(const std::string& file) : file_(file), stream_(std::fopen(file.c_str(), "rbe")) {
  struct stat status {};
  if (stream_ == nullptr || ::fstat(::fileno(stream_.get()), &status) != 0)
    throw IoError(file + ": cannot be read: " + std::strerror(errno));
  if (!S_ISREG(status.st_mode)) throw IoError(file + ": not a regular file");
  Header header;
  if (std::fread(&header, sizeof header, 1, stream_.get()) != 1)
    throw InputError(file, "header: " + std::to_string(status.st_size) + " bytes, expected at least 32");
  if (std::memcmp(header.magic, Header{}.magic, sizeof header.magic) != 0)
    throw InputError(file, "header: no PC2 file, it does not start with POINTCACHE2");
  if (header.version != 1)
    throw InputError(file, "header: version " + std::to_string(header.version) + ", expected 1");
  if (header.num_points < 1 || header.num_samples < 0)
    throw InputError(file, fmt::format("header: {} points and {} samples, expected at least 1 and 0",
                                       header.num_points, header.num_samples));
  const auto expected = static_cast<long long>(sizeof(Header)) +
                        12ll * header.num_points * static_cast<long long>(header.num_samples);
  if (status.st_size != expected)
    throw InputError(file, fmt::format("samples: the file has {} bytes, expected {} by its header",
                                       status.st_size, expected));
  num_points_ = header.num_points;
  num_samples_ = header.num_samples;
  first_frame_ = header.first_frame;
  frames_per_sample_ = header.frames_per_sample;
}

FloatPoints Pc2Reader::read(int sample) const {
  if (sample < 0 || sample >= num_samples_)
    throw std::out_of_range(fmt::format("{}: sample {} of {}", file_, sample, num_samples_));
  FloatPoints points(num_points_, 3);
  const auto count = static_cast<std::size_t>(points.size());
  const auto offset =
      static_cast<off_t>(sizeof(Header) + sizeof(float) * count * static_cast<std::size_t>(sample));
  if (::fseeko(stream_.get(), offset, SEEK_SET) != 0 ||
      std::fread(points.data(), sizeof(float), count, stream_.get()) != count)
    throw IoError(file_ + ": sample " + std::to_string(sample) + " cannot be read: " + std::strerror(errno));
  return points;
}

}  // namespace sinew::assets
