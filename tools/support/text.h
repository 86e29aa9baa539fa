#pragma once

#include <string>

/// Text for people.
namespace sinew::tools {

/// True for valid UTF-8; file names need not be.
bool is_utf8(const std::string& text);

/// The text on one line of valid UTF-8: control characters and bytes that are no UTF-8 (file names may hold
/// both) become \xNN.
std::string single_line(const std::string& text);

/// "45 s", "1 min 20 s", "2 h 5 min".
std::string duration_text(double seconds);

}  // namespace sinew::tools
