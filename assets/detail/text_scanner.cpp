#include "assets/detail/text_scanner.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
bool is_space(char c) { return is_blank(c) || c == '\n'; }

std::string shown(std::string_view word) { return printable(word.substr(0, 40)); }

/// from_chars knows no leading '+'.
std::string_view without_plus(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  return word;
}

}  // namespace

void TextScanner::fail(const std::string& what) const { fail_at(line_read_, what); }
void TextScanner::fail_at(int line, const std::string& what) const {
  throw InputError(fmt::format("{}:{}", file_, line), what);
}

void TextScanner::advance(std::size_t to) {
  line_ += static_cast<int>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                       text_.begin() + static_cast<std::ptrdiff_t>(to), '\n'));
  at_ = to;
}

std::optional<std::string_view> TextScanner::word() {
  while (at_ < text_.size()) {
    const char c = text_[at_];
    if (comment_ != '\0' && c == comment_) {
      while (at_ < text_.size() && text_[at_] != '\n') ++at_;
    } else if (is_space(c)) {
      line_ += c == '\n';
      ++at_;
    } else {
      const std::size_t first = at_;
      line_read_ = line_;
      while (at_ < text_.size() && !is_space(text_[at_]) && (comment_ == '\0' || text_[at_] != comment_))
        ++at_;
      return text_.substr(first, at_ - first);
    }
  }
  return std::nullopt;
}

std::string_view TextScanner::need_word(std::string_view thing) {
  const std::optional<std::string_view> found = word();
  if (!found) fail(fmt::format("{}: the file ends in the middle", thing));
  return *found;
}

std::string_view TextScanner::rest_of_line() {
  const std::size_t end = std::min(text_.find('\n', at_), text_.size());
  std::string_view rest = text_.substr(at_, end - at_);
  line_read_ = line_;
  if (comment_ != '\0') rest = rest.substr(0, rest.find(comment_));
  advance(std::min(end + 1, text_.size()));
  while (!rest.empty() && is_blank(rest.front())) rest.remove_prefix(1);
  while (!rest.empty() && is_blank(rest.back())) rest.remove_suffix(1);
  return rest;
}

std::optional<std::string_view> TextScanner::line_of_text() {
  while (at_ < text_.size()) {
    const std::string_view line = rest_of_line();
    if (!line.empty()) return line;
  }
  return std::nullopt;
}

double TextScanner::real(std::string_view thing) {
  const std::string_view token = without_plus(need_word(thing));
  double value = 0.0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size())
    fail(fmt::format("{}: got '{}', expected a number", thing, shown(token)));
  return value;
}

double TextScanner::coordinate(std::string_view thing) {
  const double value = real(thing);
  if (!std::isfinite(value)) fail(fmt::format("{}: got {}, expected a finite number", thing, value));
  return value;
}

std::int64_t TextScanner::integer(std::string_view thing, std::int64_t low, std::int64_t high) {
  const std::string_view token = without_plus(need_word(thing));
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size())
    fail(fmt::format("{}: got '{}', expected a whole number", thing, shown(token)));
  if (value < low || value > high) fail(fmt::format("{}: got {}, expected {}..{}", thing, value, low, high));
  return value;
}

std::int64_t TextScanner::count(std::string_view thing, std::size_t bytes_each) {
  const std::int64_t entries = integer(thing, 0, std::numeric_limits<std::int64_t>::max());
  check_count(thing, static_cast<std::uint64_t>(entries), bytes_each);
  return entries;
}

void TextScanner::check_count(std::string_view thing, std::uint64_t entries, std::size_t bytes_each) const {
  // The last entry of a text may lack the blank behind it.
  const std::uint64_t room = (bytes_left() + 1) / std::max<std::size_t>(bytes_each, 1);
  if (entries > room)
    fail(fmt::format("{}: announces {} entries, but the {} bytes that follow hold at most {}", thing, entries,
                     bytes_left(), room));
}

std::string_view TextScanner::bytes(std::string_view thing, std::size_t count) {
  if (count > bytes_left())
    fail(fmt::format("{}: needs {} bytes, but only {} follow: the file is cut short", thing, count,
                     bytes_left()));
  const std::string_view found = text_.substr(at_, count);
  at_ += count;  // bytes are no lines
  return found;
}

void TextScanner::skip_line() { advance(std::min(text_.find('\n', at_), text_.size() - 1) + 1); }

bool TextScanner::skip_to_line(std::string_view mark) {
  if (text_.substr(at_, mark.size()) == mark && (at_ == 0 || text_[at_ - 1] == '\n')) return true;
  std::string pattern = "\n";
  pattern += mark;
  const std::size_t found = text_.find(pattern, at_);
  if (found == std::string_view::npos) return false;
  advance(found + 1);
  return true;
}

}  // namespace sinew::assets::detail
