#include "tools/support/suggest.h"

#include <algorithm>

namespace sinew::tools {

int edit_distance(std::string_view a, std::string_view b) {
  // Rows of the usual table: cell j is the distance between the first i letters of a and the first j of b.
  std::vector<int> before_last(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int replace = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replace});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
    std::swap(before_last, last);
    std::swap(last, row);
  }
  return last[b.size()];
}

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  // Who stops typing in the middle of a word means the shortest one that goes on so.
  constexpr std::size_t kLeastLetters = 2;
  std::string begun;
  const bool is_beginning = word.size() - std::min(word.size(), word.find_first_not_of('-')) >= kLeastLetters;
  for (const std::string& candidate : candidates) {
    const bool shorter = begun.empty() || candidate.size() < begun.size();
    if (is_beginning && candidate.starts_with(word) && shorter) begun = candidate;
  }
  if (!begun.empty()) return begun;
  int best = std::max(2, static_cast<int>(word.size()) / 3) + 1;
  std::string result;
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(word, candidate);
    if (distance < best && distance < static_cast<int>(candidate.size())) {
      best = distance;
      result = candidate;
    }
  }
  return result;
}

}  // namespace sinew::tools
