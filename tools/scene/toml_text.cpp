#include "tools/scene/toml_text.h"

#include <fmt/format.h>

#include "assets/error.h"
#include "tools/support/text.h"

namespace sinew::tools {

std::string toml_quoted(const std::string& text, std::string_view key) {
  if (!is_utf8(text)) {
    throw assets::ConfigError(
        fmt::format("{}: got '{}', expected UTF-8; hint: rename the file, TOML cannot hold the name", key,
                    single_line(text)));
  }
  std::string literal = "\"";
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    if (letter == '"' || letter == '\\') literal += '\\';
    if (byte < 0x20 || byte == 0x7F) {
      literal += fmt::format("\\u{:04X}", byte);
    } else {
      literal += letter;
    }
  }
  return literal + '"';
}

std::string toml_quoted(const std::vector<std::string>& texts, std::string_view key) {
  std::string list;
  for (const std::string& text : texts) list += (list.empty() ? "" : ", ") + toml_quoted(text, key);
  return "[" + list + "]";
}

}  // namespace sinew::tools
