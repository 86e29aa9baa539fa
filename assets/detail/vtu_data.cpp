#include "assets/detail/vtu_data.h"

#include <charconv>
#include <stdexcept>

#include <fmt/format.h>
#include <zlib.h>

#include "assets/detail/base64.h"
#include "assets/detail/file_bytes.h"
#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// The first n bytes of an array's data, fewer where there are fewer.
using Source = std::function<Bytes(std::size_t n)>;

std::uint64_t header_number(const VtuEncoding& encoding, const Bytes& bytes, std::size_t index) {
  const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(index * encoding.header_bytes);
  const Bytes number(first, first + static_cast<std::ptrdiff_t>(encoding.header_bytes));
  return encoding.header_bytes == 8 ? numbers_from_bytes<std::uint64_t>(number, encoding.swap_bytes)[0]
                                    : numbers_from_bytes<std::uint32_t>(number, encoding.swap_bytes)[0];
}

/// `length`: of everything the source can give.
Bytes plain_data(const VtuEncoding& encoding, const Source& source, std::size_t length, bool ends_there,
                 const Refuse& refuse) {
  const std::size_t header = encoding.header_bytes;
  const Bytes head = source(header);
  const std::uint64_t announced = head.size() < header ? 0 : header_number(encoding, head, 0);
  Bytes bytes = announced <= length ? source(ends_there ? SIZE_MAX : header + announced) : head;
  const std::size_t have = bytes.size() - std::min(bytes.size(), header);
  if (head.size() < header || announced != have)
    refuse(fmt::format("the data hold {} bytes, got a header of {}", have, announced));
  bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(header));
  return bytes;
}

/// Header: number of blocks, size of a block, size of the last one (0: a whole one), packed size of each.
Bytes unpacked_data(const VtuEncoding& encoding, const Source& source, std::size_t length,
                    const Refuse& refuse) {
  const std::size_t number = encoding.header_bytes;
  const auto cut_short = [&] { refuse("the compressed data are cut short"); };
  const Bytes head = source(3 * number);
  if (head.size() < 3 * number) cut_short();
  const std::uint64_t blocks = header_number(encoding, head, 0), whole = header_number(encoding, head, 1),
                      partial = header_number(encoding, head, 2);
  if (blocks == 0) return {};
  if (blocks > length / number) cut_short();
  const std::size_t header = (3 + blocks) * number;
  const Bytes sizes = source(header);
  if (sizes.size() < header) cut_short();
  std::uint64_t packed = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::uint64_t size = header_number(encoding, sizes, 3 + b);
    if (size > length - packed) cut_short();
    packed += size;
  }
  const std::uint64_t last = partial == 0 ? whole : partial;
  if (whole > kMaxFileBytes || last > whole || (blocks - 1) * whole + last > kMaxFileBytes)
    throw LimitError(fmt::format("compressed data: {} blocks of {} bytes, the limit is {} bytes in all",
                                 blocks, whole, kMaxFileBytes));
  // DEFLATE cannot do better than 1032 : 1.
  constexpr std::uint64_t kMostRatio = 1032;
  const std::uint64_t total = (blocks - 1) * whole + last;
  if (total / kMostRatio > packed)
    refuse(fmt::format("{} bytes of compressed data cannot hold {} bytes", packed, total));
  const Bytes all = source(header + packed);
  if (all.size() < header + packed) cut_short();
  Bytes out(total);
  std::size_t from = header, to = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::uint64_t size = header_number(encoding, sizes, 3 + b);
    const std::uint64_t expected = b + 1 < blocks ? whole : last;
    uLongf unpacked = expected;
    if (uncompress(out.data() + to, &unpacked, all.data() + from, size) != Z_OK || unpacked != expected)
      refuse(fmt::format("block {} of the compressed data is damaged", b));
    from += size;
    to += expected;
  }
  return out;
}

}  // namespace

VtuMarkup::VtuMarkup(const std::string& text) {
  const std::size_t tag = text.find("<AppendedData");
  const std::size_t close = tag == std::string::npos ? tag : text.find('>', tag);
  const std::size_t mark = close == std::string::npos ? close : text.find('_', close);
  const std::size_t end = text.rfind("</AppendedData");
  if (mark == std::string::npos || end == std::string::npos || end < mark) {
    text_ = text;
    return;
  }
  text_ = text.substr(0, mark) + text.substr(end);
  appended_ = std::string_view(text).substr(mark + 1, end - mark - 1);
}

Bytes vtu_inline_data(const VtuEncoding& encoding, std::string_view text, const Refuse& refuse) {
  const Source source = [&](std::size_t n) {
    auto bytes = decode_base64(text, n);
    if (!bytes) refuse("the data are not base64");
    return std::move(*bytes);
  };
  return encoding.zlib ? unpacked_data(encoding, source, text.size(), refuse)
                       : plain_data(encoding, source, text.size(), true, refuse);
}

Bytes vtu_appended_data(const VtuEncoding& encoding, std::string_view appended, const std::string& offset,
                        const Refuse& refuse) {
  std::uint64_t at = 0;
  const auto [end, error] = std::from_chars(offset.data(), offset.data() + offset.size(), at);
  if (error != std::errc() || end != offset.data() + offset.size() || at > appended.size())
    refuse(fmt::format("offset, got '{}', expected 0..{}", offset, appended.size()));
  const std::string_view data = appended.substr(at);
  const Source source = [&](std::size_t n) {
    if (encoding.appended_is_raw)
      return Bytes(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(std::min(n, data.size())));
    auto bytes = decode_base64(data, n);
    if (!bytes) refuse("the data are not base64");
    return std::move(*bytes);
  };
  return encoding.zlib ? unpacked_data(encoding, source, data.size(), refuse)
                       : plain_data(encoding, source, data.size(), false, refuse);
}

}  // namespace sinew::assets::detail
