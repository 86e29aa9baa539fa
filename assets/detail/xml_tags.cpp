#include "assets/detail/xml_tags.h"

#include <algorithm>

#include <fmt/format.h>

#include "assets/error.h"

namespace sinew::assets::detail {
namespace {

bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }
bool is_name(char c) {
  return !is_space(c) && c != '=' && c != '>' && c != '/' && c != '<' && c != '"' && c != '\'';
}

class Scanner {
 public:
  Scanner(const std::string& file, std::string_view text) : file_(file), text_(text) {}

  std::vector<XmlTag> scan() {
    while (true) {
      const std::size_t open = text_.find('<', at_);
      if (!tags_.empty()) tags_.back().text = text_.substr(at_, std::min(open, text_.size()) - at_);
      if (open == std::string_view::npos) break;
      advance(open);
      if (skip("<!--", "-->") || skip("<?", "?>")) continue;
      if (text_.substr(at_, 2) == "<!") fail("document types and entities are not supported");
      read_tag();
    }
    if (!open_.empty()) fail(fmt::format("<{}> is never closed: the file is cut short", open_.back()));
    return std::move(tags_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}:{}", file_, line_), what);
  }

  void advance(std::size_t to) {
    line_ += static_cast<int>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                         text_.begin() + static_cast<std::ptrdiff_t>(to), '\n'));
    at_ = to;
  }
  char peek() const {
    if (at_ >= text_.size()) fail("the file ends inside a tag");
    return text_[at_];
  }
  void skip_space() {
    while (is_space(peek())) advance(at_ + 1);
  }
  bool skip(std::string_view begin, std::string_view end) {
    if (text_.substr(at_, begin.size()) != begin) return false;
    const std::size_t close = text_.find(end, at_ + begin.size());
    if (close == std::string_view::npos) fail("the file ends inside a comment");
    advance(close + end.size());
    if (!tags_.empty()) tags_.back().text_line = line_;
    return true;
  }
  std::string read_name() {
    const std::size_t first = at_;
    while (is_name(peek())) ++at_;
    return std::string(text_.substr(first, at_ - first));
  }

  void read_tag() {
    XmlTag tag;
    tag.line = line_;
    advance(at_ + 1);
    const bool is_end = peek() == '/';
    if (is_end) advance(at_ + 1);
    tag.name = read_name();
    if (tag.name.empty()) fail("a tag has no name");
    bool closes_itself = false;
    for (skip_space(); peek() != '>'; skip_space()) {
      if (peek() == '/') {
        advance(at_ + 1);
        if (peek() != '>') fail(fmt::format("<{}>: got '/' inside the tag", tag.name));
        closes_itself = true;
        break;
      }
      read_attribute(tag);
    }
    advance(at_ + 1);
    tag.text_line = line_;
    if (is_end) {
      if (open_.empty() || open_.back() != tag.name)
        fail(fmt::format("got </{}>, expected {}", tag.name,
                         open_.empty() ? "no end tag" : "</" + open_.back() + ">"));
      open_.pop_back();
      tag.name = '/' + tag.name;
    } else if (!closes_itself) {
      open_.push_back(tag.name);
    }
    tags_.push_back(std::move(tag));
  }

  void read_attribute(XmlTag& tag) {
    const std::string key = read_name();
    if (key.empty()) fail(fmt::format("<{}>: got '{}', expected an attribute", tag.name, peek()));
    skip_space();
    if (peek() != '=') fail(fmt::format("<{}>: attribute '{}' has no value", tag.name, key));
    advance(at_ + 1);
    skip_space();
    const char quote = peek();
    if (quote != '"' && quote != '\'') fail(fmt::format("<{}>: attribute '{}' is not quoted", tag.name, key));
    const std::size_t close = text_.find(quote, at_ + 1);
    if (close == std::string_view::npos)
      fail(fmt::format("<{}>: attribute '{}' is never closed", tag.name, key));
    const std::string value = unescape(text_.substr(at_ + 1, close - at_ - 1));
    advance(close + 1);
    tag.attributes.emplace_back(key, value);
  }

  std::string unescape(std::string_view raw) const {
    static constexpr std::pair<std::string_view, char> kEntities[] = {
        {"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}};
    std::string out;
    for (std::size_t i = 0; i < raw.size();) {
      const auto* entity = std::find_if(std::begin(kEntities), std::end(kEntities), [&](const auto& e) {
        return raw.substr(i, e.first.size()) == e.first;
      });
      if (entity == std::end(kEntities) && raw[i] == '&') fail("entities are not supported");
      out += entity == std::end(kEntities) ? raw[i] : entity->second;
      i += entity == std::end(kEntities) ? 1 : entity->first.size();
    }
    return out;
  }

  const std::string& file_;
  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
  std::vector<XmlTag> tags_;
  std::vector<std::string> open_;
};

}  // namespace

std::string XmlTag::attribute(std::string_view key) const {
  for (const auto& [attribute_name, value] : attributes)
    if (attribute_name == key) return value;
  return "";
}

std::vector<XmlTag> xml_tags(const std::string& file, const std::string& text) {
  return Scanner(file, text).scan();
}

}  // namespace sinew::assets::detail
