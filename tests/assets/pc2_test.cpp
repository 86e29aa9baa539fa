#include "assets/pc2.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "tests/temporary_path.h"

namespace sinew::assets {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::string temp_file(const std::string& name) { return tests::temporary_path(name + ".pc2"); }

std::string read_bytes(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write_bytes(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST(Pc2Writer, WritesTheBytesOfTheFormat) {
  const std::string file = temp_file("bytes");
  lattice::Points a(2, 3), b(2, 3);
  a << 1, -2, 0.5, 0, 0, 0;
  b << 0, 0, 0, 3, 0, -0.0;
  Pc2Writer writer(file, 2, 24.0);
  writer.write(a);
  writer.write(b);
  writer.finish();
  // By hand: 1 = 3f800000, -2 = c0000000, 0.5 = 3f000000, 24 = 41c00000, 3 = 40400000, -0 = 80000000, low
  // byte first.
  using namespace std::string_literals;
  const std::string expected = "POINTCACHE2\0"s + "\x01\0\0\0"s + "\x02\0\0\0"s + "\0\0\xc0\x41"s +
                               "\0\0\x80\x3f"s + "\x02\0\0\0"s + "\0\0\x80\x3f"s + "\0\0\0\xc0"s +
                               "\0\0\0\x3f"s + "\0\0\0\0\0\0\0\0\0\0\0\0"s + "\0\0\0\0\0\0\0\0\0\0\0\0"s +
                               "\0\0\x40\x40"s + "\0\0\0\0"s + "\0\0\0\x80"s;
  EXPECT_EQ(read_bytes(file), expected);
  std::filesystem::remove(file);
}

TEST(Pc2Writer, AndReaderGiveEveryFloatBack) {
  const std::string file = temp_file("round_trip");
  std::mt19937_64 rng(20021);
  std::vector<lattice::Points> samples;
  for (int s = 0; s < 5; ++s) {
    lattice::Points points(100, 3);
    for (Eigen::Index i = 0; i < points.size(); ++i)
      points.data()[i] = static_cast<double>(static_cast<std::int64_t>(rng())) * std::pow(2.0, -60 - s);
    samples.push_back(points);
  }
  Pc2Writer writer(file, 100, -3.0);
  for (const auto& points : samples) writer.write(points);
  EXPECT_EQ(writer.num_samples(), 5);
  writer.finish();
  const Pc2Reader reader(file);
  EXPECT_EQ(reader.num_points(), 100);
  EXPECT_EQ(reader.num_samples(), 5);
  EXPECT_EQ(reader.first_frame(), -3.0);
  EXPECT_EQ(reader.frames_per_sample(), 1.0);
  for (const int s : {4, 0, 2}) {
    const FloatPoints expected = samples[static_cast<std::size_t>(s)].cast<float>();
    EXPECT_TRUE(reader.read(s) == expected) << s;
  }
  EXPECT_THROW(reader.read(5), std::out_of_range);
  EXPECT_THROW(reader.read(-1), std::out_of_range);
  std::filesystem::remove(file);
}

TEST(Pc2Writer, ThatIsNotFinishedLeavesAHeaderWithoutSamples) {
  const std::string file = temp_file("unfinished");
  { Pc2Writer(file, 2).write(lattice::Points::Ones(2, 3)); }
  std::int32_t count = -1;
  std::memcpy(&count, read_bytes(file).data() + 28, 4);
  EXPECT_EQ(count, 0);
  EXPECT_THROW(Pc2Reader{file}, InputError);  // longer than its header says
  std::filesystem::remove(file);
}

TEST(Pc2Writer, RefusesWhatAFloatCannotHold) {
  const std::string file = temp_file("refuses");
  Pc2Writer writer(file, 2);
  lattice::Points points = lattice::Points::Zero(2, 3);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -1e39, 3.4028235e38 * (1 + 1e-7)}) {
    points(1, 2) = bad;
    EXPECT_THAT([&] { writer.write(points); }, ThrowsMessage<std::domain_error>(HasSubstr("vertex 1, z")));
  }
  EXPECT_EQ(writer.num_samples(), 0);
  points(1, 2) = std::numeric_limits<float>::max();
  writer.write(points);
  points(1, 2) = 1e-46;  // rounds to zero; no error
  writer.write(points);
  EXPECT_THROW(writer.write(lattice::Points::Zero(3, 3)), std::invalid_argument);
  EXPECT_THROW(Pc2Writer(file, 0), std::invalid_argument);
  writer.finish();
  std::filesystem::remove(file);
}

TEST(Pc2Writer, SaysWhichFileCannotBeWritten) {
  EXPECT_THAT([] { Pc2Writer("/nonexistent/skin.pc2", 1); },
              ThrowsMessage<IoError>(AllOf(HasSubstr("/nonexistent/skin.pc2"), HasSubstr("No such file"))));
  // /dev/full takes the buffer and refuses to store it.
  EXPECT_THROW(
      {
        Pc2Writer writer("/dev/full", 100000);
        writer.write(lattice::Points::Zero(100000, 3));
        writer.finish();
      },
      IoError);
}

TEST(Pc2Reader, SaysWhatIsWrongWithAFile) {
  const std::string file = temp_file("wrong");
  Pc2Writer writer(file, 3);
  writer.write(lattice::Points::Zero(3, 3));
  writer.finish();
  const std::string good = read_bytes(file);
  const auto expect = [&](const std::string& bytes, const std::string& words) {
    write_bytes(file, bytes);
    EXPECT_THAT([&] { Pc2Reader{file}; },
                ThrowsMessage<InputError>(AllOf(HasSubstr(file), HasSubstr(words))));
  };
  for (std::size_t length = 0; length < good.size(); ++length)
    expect(good.substr(0, length), length < 32 ? "expected at least 32" : "expected 68 by its header");
  expect(good + "x", "has 69 bytes, expected 68");
  std::string changed = good;
  changed[0] = 'Q';
  expect(changed, "does not start with POINTCACHE2");
  changed = good;
  changed[12] = 2;
  expect(changed, "version 2, expected 1");
  changed = good;
  changed[19] = '\x80';
  expect(changed, "-2147483645 points");
  std::filesystem::remove(file);
  EXPECT_THROW(Pc2Reader{file}, IoError);
  EXPECT_THAT([] { Pc2Reader{"/dev/zero"}; }, ThrowsMessage<IoError>(HasSubstr("not a regular file")));
}

// Every row of the table writes what it reads, by the extension in any case.
TEST(PointCache, FormatsAreFoundByTheirExtension) {
  for (const PointCacheFormat& format : point_cache_formats()) {
    for (const std::string& extension : {std::string(format.extension), std::string(".PC2")}) {
      const std::string file = tests::temporary_path("cache" + extension);
      const std::unique_ptr<PointCacheWriter> writer = write_point_cache(file, 2, 7.0);
      writer->write((lattice::Points(2, 3) << 1, 2, 3, 4, 5, 6).finished());
      writer->finish();
      const std::unique_ptr<PointCacheReader> reader = read_point_cache(file);
      EXPECT_EQ(reader->num_samples(), 1);
      EXPECT_EQ(reader->first_frame(), 7.0);
      EXPECT_EQ(reader->read(0)(1, 2), 6.0f);
    }
  }
  EXPECT_EQ(find_point_cache_format("a.txt"), nullptr);
  EXPECT_THAT([] { write_point_cache("a.txt", 2); },
              ThrowsMessage<ConfigError>(HasSubstr("expected one of .pc2")));
  EXPECT_THAT([] { read_point_cache("a"); }, ThrowsMessage<InputError>(HasSubstr("expected one of .pc2")));
}

}  // namespace
}  // namespace sinew::assets
