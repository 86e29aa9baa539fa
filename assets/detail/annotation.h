#pragma once

#include <string>
#include <string_view>

/// What Sinew adds to its own files in formats that have no place for it.
namespace sinew::assets::detail {

/// Name of the array, section or comment that holds the text.
inline constexpr const char* kAnnotation = "sinew_lattice";

/// The text as lines that start with "# sinew_lattice "; nothing for an empty text.
std::string annotation_as_comments(const std::string& text);

/// The text of such lines anywhere in a file; empty where there are none.
std::string annotation_from_comments(std::string_view file);

}  // namespace sinew::assets::detail
