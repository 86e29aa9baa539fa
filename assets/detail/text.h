#pragma once

#include <string>
#include <string_view>

namespace sinew::assets::detail {

/// `text` with control characters and bytes that are not UTF-8 written as \xNN, so that names from a file
/// cannot break a line or a terminal.
std::string printable(std::string_view text);

/// A number for a message: short, and "nan" or "inf" where it is not finite.
std::string number(double value);

/// The message of an InputError on `file` without the file that opens it.
std::string without_file(const std::string& file, const std::string& what);

}  // namespace sinew::assets::detail
