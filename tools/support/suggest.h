#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sinew::tools {

/// Fewest insertions, deletions, replacements and swaps of neighbours that turn `a` into `b` (no part edited
/// twice).
int edit_distance(std::string_view a, std::string_view b);

/// The shortest candidate that begins with `word`, of two letters at least; else the one nearest to it, the
/// first of several; empty where none is near (more than a third of the
/// letters, and more than two, would have to change).
std::string nearest(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace sinew::tools
