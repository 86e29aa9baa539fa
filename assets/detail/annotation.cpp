#include "assets/detail/annotation.h"

#include <algorithm>

namespace sinew::assets::detail {
namespace {

// Readers of these formats have buffers of 1024 or 2048 characters for a line.
constexpr std::size_t kWidth = 120;

std::string mark() { return std::string("# ") + kAnnotation + ' '; }

}  // namespace

std::string annotation_as_comments(const std::string& text) {
  std::string flat = text;
  std::replace(flat.begin(), flat.end(), '\n', ' ');
  std::string out;
  for (std::size_t i = 0; i < flat.size(); i += kWidth) {
    out += mark();
    // Bars keep blanks at the ends of a line.
    out += '|';
    out += flat.substr(i, kWidth);
    out += "|\n";
  }
  return out;
}

std::string annotation_from_comments(std::string_view file) {
  std::string text;
  const std::string start = mark() + '|';
  for (std::size_t at = file.find(start); at != std::string_view::npos; at = file.find(start, at)) {
    if (at > 0 && file[at - 1] != '\n') {
      ++at;
      continue;
    }
    at += start.size();
    const std::size_t end = std::min(file.find('\n', at), file.size());
    std::string_view line = file.substr(at, end - at);
    while (!line.empty() && line.back() != '|') line.remove_suffix(1);
    if (!line.empty()) line.remove_suffix(1);
    text += line;
    at = end;
  }
  return text;
}

}  // namespace sinew::assets::detail
