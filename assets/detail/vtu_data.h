#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

/// How .vtu files pack the numbers of an array.
namespace sinew::assets::detail {

/// The text of a .vtu file in two parts: the XML, and what stands behind the '_' of <AppendedData>, which may
/// hold any byte.
class VtuMarkup {
 public:
  /// `text` must outlive the markup.
  explicit VtuMarkup(const std::string& text);

  const std::string& text() const { return text_; }
  std::string_view appended() const { return appended_; }

 private:
  std::string text_;
  std::string_view appended_;
};

struct VtuEncoding {
  std::size_t header_bytes = 4;  ///< of every length: 4 or 8.
  bool swap_bytes = false;       ///< the file is big-endian.
  bool zlib = false;             ///< blocks of compressed data.
  bool appended_is_raw = false;  ///< else base64.
};

/// Called with what is wrong; throws.
using Refuse = std::function<void(const std::string&)>;

/// The bytes of an array whose text is base64. Throws LimitError where they unpack to more than a file may
/// hold.
std::vector<std::uint8_t> vtu_inline_data(const VtuEncoding& encoding, std::string_view text,
                                          const Refuse& refuse);

/// The bytes of an array at `offset` (decimal) of the appended data.
std::vector<std::uint8_t> vtu_appended_data(const VtuEncoding& encoding, std::string_view appended,
                                            const std::string& offset, const Refuse& refuse);

/// The numbers that the bytes are; their count must be a multiple of the number's size.
template <class T>
std::vector<T> numbers_from_bytes(std::vector<std::uint8_t> bytes, bool swap_bytes) {
  std::vector<T> numbers(bytes.size() / sizeof(T));
  if (swap_bytes)
    for (std::size_t i = 0; i < numbers.size(); ++i)
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i * sizeof(T)),
                   bytes.begin() + static_cast<std::ptrdiff_t>((i + 1) * sizeof(T)));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(T));
  return numbers;
}

}  // namespace sinew::assets::detail
