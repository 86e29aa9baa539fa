#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sinew::tools {

/// A TOML string literal, in quotes. Throws assets::ConfigError, opened by `key`, for text that is not UTF-8:
/// TOML cannot hold it.
std::string toml_quoted(const std::string& text, std::string_view key);
/// An array of them.
std::string toml_quoted(const std::vector<std::string>& texts, std::string_view key);

}  // namespace sinew::tools
