#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sinew::assets::detail {

/// One start tag (`name`) or end tag ("/name") of an XML file, and the text up to the next tag.
struct XmlTag {
  std::string name;
  std::vector<std::pair<std::string, std::string>> attributes;
  std::string_view text;  ///< into the text that was scanned.
  int line = 0;           ///< of the tag; from 1.
  int text_line = 0;      ///< of the first character of `text`.

  /// The value, or an empty string.
  std::string attribute(std::string_view key) const;
};

/// The tags of `text` in order; an element that closes itself gives its start tag only. Comments and
/// processing instructions are skipped; entities other than the five of XML and any <!DOCTYPE> are refused,
/// and end tags must match. Throws InputError with the line. `text` must outlive the result.
std::vector<XmlTag> xml_tags(const std::string& file, const std::string& text);

}  // namespace sinew::assets::detail
