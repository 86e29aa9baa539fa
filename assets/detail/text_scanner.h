#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace sinew::assets::detail {

/// Walks through a text file word by word, or through binary runs inside it, and never past its end.
/// Whatever is wrong is one InputError "<file>:<line>: <thing>: ...".
class TextScanner {
 public:
  /// `file` and `text` must outlive the scanner. From the character `comment` on, the rest of a line is
  /// skipped; '\0' for formats without comments.
  TextScanner(const std::string& file, std::string_view text, char comment = '\0')
      : file_(file), text_(text), comment_(comment) {}

  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_at(int line, const std::string& what) const;
  /// Of what was read last.
  int line() const { return line_read_; }

  /// The next word, or nothing at the end of the file.
  std::optional<std::string_view> word();
  std::string_view need_word(std::string_view thing);
  /// What is left of the line, without blanks at its ends; moves behind it.
  std::string_view rest_of_line();
  /// The next lines until one that is neither empty nor a comment.
  std::optional<std::string_view> line_of_text();

  /// A finite or infinite number or NaN, with or without a leading '+'.
  double real(std::string_view thing);
  /// Refuses what is not finite.
  double coordinate(std::string_view thing);
  std::int64_t integer(std::string_view thing, std::int64_t low, std::int64_t high);
  /// A number of entries of at least `bytes_each` bytes that must still follow in the file.
  std::int64_t count(std::string_view thing, std::size_t bytes_each);
  /// Refuses a number of entries that the rest of the file cannot hold.
  void check_count(std::string_view thing, std::uint64_t entries, std::size_t bytes_each) const;

  std::size_t bytes_left() const { return text_.size() - at_; }
  /// The next bytes as they are.
  std::string_view bytes(std::string_view thing, std::size_t count);
  /// Moves behind the next end of line.
  void skip_line();
  /// Moves to the next line that starts with `mark`; false where there is none.
  bool skip_to_line(std::string_view mark);

 private:
  void advance(std::size_t to);

  const std::string& file_;
  std::string_view text_;
  char comment_;
  std::size_t at_ = 0;
  int line_ = 1;       ///< at at_.
  int line_read_ = 1;  ///< of what was read last.
};

}  // namespace sinew::assets::detail
