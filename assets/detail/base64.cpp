#include "assets/detail/base64.h"

#include <algorithm>

namespace sinew::assets::detail {
namespace {

constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

}  // namespace

std::string encode_base64(const std::vector<std::uint8_t>& bytes) {
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < n ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= n ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return out;
}

std::optional<std::vector<std::uint8_t>> decode_base64(std::string_view text, std::size_t at_most) {
  std::vector<std::uint8_t> out;
  out.reserve(std::min(text.size() / 4 * 3, at_most) + 3);
  std::uint32_t group = 0;
  int digits = 0, padding = 0;
  for (const char c : text) {
    if (digits == 0 && out.size() >= at_most) break;
    if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
    const int digit = c == '=' ? 0 : digit_of(c);
    if (digit < 0 || (padding > 0 && c != '=')) return std::nullopt;
    padding += c == '=';
    group = group << 6 | static_cast<std::uint32_t>(digit);
    if (++digits < 4) continue;
    if (padding > 2) return std::nullopt;
    for (int k = 0; k < 3 - padding; ++k)
      out.push_back(static_cast<std::uint8_t>(group >> (16 - 8 * k) & 255u));
    group = 0;
    digits = padding = 0;
  }
  if (digits != 0) return std::nullopt;
  out.resize(std::min(out.size(), at_most));
  return out;
}

}  // namespace sinew::assets::detail
