#include "assets/detail/fbx_tree.h"

#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <stdexcept>

#include <zlib.h>

namespace sinew::assets::detail {

namespace {

constexpr std::string_view kBinaryMagic = "Kaydara FBX Binary  ";
/// Matrices have 16 numbers; nothing longer is of interest.
constexpr std::uint32_t kLongestList = 16;
/// Real files nest about six deep.
constexpr int kMaxDepth = 64;

[[noreturn]] void fail(const char* what) { throw std::runtime_error(what); }

bool of_interest(std::string_view section) {
  return section == "Definitions" || section == "Objects" || section == "Connections";
}

class BinaryParser {
 public:
  explicit BinaryParser(std::string_view bytes) : bytes_(bytes) {
    at_ = 23;  // magic, two bytes, then the version
    version_ = take<std::uint32_t>();
  }

  FbxNode run() {
    FbxNode root;
    while (at_ < bytes_.size()) {
      FbxNode section;
      if (!parse_node(section, 0)) break;
      if (of_interest(section.name)) root.children.push_back(std::move(section));
    }
    return root;
  }

 private:
  template <typename T>
  T take() {
    if (bytes_.size() - at_ < sizeof(T)) fail("the file ends within a value");
    T value{};
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::uint64_t take_size() { return version_ >= 7500 ? take<std::uint64_t>() : take<std::uint32_t>(); }
  std::string_view take_bytes(std::uint64_t count) {
    if (count > bytes_.size() - at_) fail("the file ends within a value");
    const std::string_view taken = bytes_.substr(at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
    return taken;
  }

  /// False at the empty record that ends a list of nodes.
  bool parse_node(FbxNode& node, int depth) {
    if (depth > kMaxDepth) fail("nodes are nested too deeply");
    const std::uint64_t end = take_size();
    const std::uint64_t num_values = take_size();
    take_size();  // bytes of the values
    node.name = std::string(take_bytes(take<std::uint8_t>()));
    if (end == 0) return false;
    if (end < at_ || end > bytes_.size()) fail("a node ends outside the file");
    if (depth == 0 && !of_interest(node.name)) {
      at_ = static_cast<std::size_t>(end);
      return true;
    }
    for (std::uint64_t i = 0; i < num_values; ++i) node.values.push_back(parse_value());
    while (at_ < end) {
      FbxNode child;
      if (!parse_node(child, depth + 1)) break;
      node.children.push_back(std::move(child));
    }
    at_ = static_cast<std::size_t>(end);
    return true;
  }

  static FbxValue whole(std::int64_t v) {
    FbxValue value;
    value.kind = FbxValue::Kind::Number;
    value.whole = v;
    value.number = static_cast<double>(v);
    return value;
  }
  static FbxValue number(double v) {
    FbxValue value;
    value.kind = FbxValue::Kind::Number;
    value.number = v;
    return value;
  }

  FbxValue parse_value() {
    FbxValue value;
    switch (take<char>()) {
      case 'C':
      case 'B':
        return whole(take<std::uint8_t>());
      case 'Y':
        return whole(take<std::int16_t>());
      case 'I':
        return whole(take<std::int32_t>());
      case 'L':
        return whole(take<std::int64_t>());
      case 'F':
        return number(static_cast<double>(take<float>()));
      case 'D':
        return number(take<double>());
      case 'S':
        value.kind = FbxValue::Kind::Text;
        value.text = std::string(take_bytes(take<std::uint32_t>()));
        return value;
      case 'R':
        take_bytes(take<std::uint32_t>());
        return value;
      case 'd':
        return parse_list();
      case 'f':
      case 'l':
      case 'i':
      case 'b':
        take<std::uint32_t>();
        take<std::uint32_t>();
        take_bytes(take<std::uint32_t>());
        return value;
      default:
        fail("a value has an unknown type");
    }
  }

  FbxValue parse_list() {
    const auto count = take<std::uint32_t>();
    const auto encoding = take<std::uint32_t>();
    const std::string_view data = take_bytes(take<std::uint32_t>());
    FbxValue value;
    if (count > kLongestList) return value;
    std::array<double, kLongestList> numbers{};
    if (encoding == 1) {
      uLongf size = count * sizeof(double);
      const int result = ::uncompress(reinterpret_cast<Bytef*>(numbers.data()), &size,
                                      reinterpret_cast<const Bytef*>(data.data()), data.size());
      if (result != Z_OK || size != count * sizeof(double)) fail("a list cannot be decompressed");
    } else {
      if (data.size() != count * sizeof(double)) fail("a list has the wrong length");
      std::memcpy(numbers.data(), data.data(), data.size());
    }
    value.kind = FbxValue::Kind::List;
    value.list.assign(numbers.begin(), numbers.begin() + count);
    return value;
  }

  std::string_view bytes_;
  std::size_t at_ = 0;
  std::uint32_t version_ = 0;
};

/// Text FBX: `Name: value, value, *count { a: numbers } { children }`; comments from ; to the end of the
/// line.
class TextParser {
 public:
  explicit TextParser(std::string_view text) : text_(text) {}

  FbxNode run() {
    FbxNode root;
    parse_children(root, 0, /*keep=*/true);
    return root;
  }

 private:
  void skip_blanks() {
    while (at_ < text_.size()) {
      if (text_[at_] == ';') {
        while (at_ < text_.size() && text_[at_] != '\n') ++at_;
      } else if (std::isspace(static_cast<unsigned char>(text_[at_])) != 0) {
        ++at_;
      } else {
        return;
      }
    }
  }
  bool next_is(char c) {
    skip_blanks();
    return at_ < text_.size() && text_[at_] == c;
  }
  bool accept(char c) {
    if (!next_is(c)) return false;
    ++at_;
    return true;
  }

  /// A bare word up to a separator; empty where there is none.
  std::string_view word() {
    skip_blanks();
    const std::size_t begin = at_;
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) == 0 &&
           std::string_view(",:{}*\";").find(text_[at_]) == std::string_view::npos) {
      ++at_;
    }
    return text_.substr(begin, at_ - begin);
  }

  void parse_children(FbxNode& parent, int depth, bool keep) {
    if (depth > kMaxDepth) fail("nodes are nested too deeply");
    while (true) {
      skip_blanks();
      if (at_ >= text_.size() || text_[at_] == '}') return;
      FbxNode node;
      node.name = std::string(word());
      if (!accept(':')) fail("a name is not followed by a colon");
      const bool keep_this = keep && (depth > 0 || of_interest(node.name));
      parse_values(node);
      if (accept('{')) {
        parse_children(node, depth + 1, keep_this);
        if (!accept('}')) fail("a brace is not closed");
      }
      if (keep_this) parent.children.push_back(std::move(node));
    }
  }

  void parse_values(FbxNode& node) {
    while (true) {
      skip_blanks();
      if (at_ >= text_.size() || text_[at_] == '{' || text_[at_] == '}') return;
      if (text_[at_] == '"') {
        node.values.push_back(parse_text());
      } else if (text_[at_] == '*') {
        node.values.push_back(parse_list());
      } else {
        // The next node's name ends the values; it is told from a word by its colon.
        const std::size_t before = at_;
        const std::string_view token = word();
        if (next_is(':') || token.empty()) {
          at_ = before;
          return;
        }
        node.values.push_back(parse_number(token));
      }
      if (!accept(',')) return;
    }
  }

  FbxValue parse_text() {
    const std::size_t begin = ++at_;
    const std::size_t end = text_.find('"', begin);
    if (end == std::string_view::npos) fail("a text is not closed");
    at_ = end + 1;
    FbxValue value;
    value.kind = FbxValue::Kind::Text;
    value.text = std::string(text_.substr(begin, end - begin));
    return value;
  }

  static FbxValue parse_number(std::string_view token) {
    FbxValue value;
    const char* end = token.data() + token.size();
    // Words such as T, Y, W count as skipped values.
    if (std::from_chars(token.data(), end, value.number).ec != std::errc()) return value;
    value.kind = FbxValue::Kind::Number;
    std::from_chars(token.data(), end, value.whole);
    return value;
  }

  FbxValue parse_list() {
    ++at_;
    FbxValue value;
    const double count = parse_number(word()).number;
    if (!accept('{')) fail("a list has no brace");
    word();  // a
    if (!accept(':')) fail("a list has no numbers");
    while (!next_is('}')) {
      const std::string_view token = word();
      if (token.empty() && !next_is(',')) fail("a list is not closed");
      if (count <= kLongestList) value.list.push_back(parse_number(token).number);
      accept(',');
    }
    accept('}');
    if (count <= kLongestList) value.kind = FbxValue::Kind::List;
    return value;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace

const FbxNode* FbxNode::child(std::string_view wanted) const {
  for (const FbxNode& node : children) {
    if (node.name == wanted) return &node;
  }
  return nullptr;
}

FbxNode parse_fbx(std::string_view bytes) {
  const bool binary = bytes.substr(0, kBinaryMagic.size()) == kBinaryMagic;
  return binary ? BinaryParser(bytes).run() : TextParser(bytes).run();
}

}  // namespace sinew::assets::detail
