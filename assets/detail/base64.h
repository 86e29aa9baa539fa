#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sinew::assets::detail {

/// RFC 4648 base64 with padding.
std::string encode_base64(const std::vector<std::uint8_t>& bytes);

/// The first `at_most` bytes, white space ignored, padding allowed between runs; nothing where a character
/// before their end is none of base64's or bits are missing.
std::optional<std::vector<std::uint8_t>> decode_base64(std::string_view text, std::size_t at_most = SIZE_MAX);

}  // namespace sinew::assets::detail
