#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sinew::assets::detail {

/// One value of an FBX node: a whole number, a number, a text or a short list of numbers.
struct FbxValue {
  enum class Kind { Number, Text, List, Skipped };
  Kind kind = Kind::Skipped;
  double number = 0.0;
  std::int64_t whole = 0;  ///< the same without rounding: object ids use all 64 bits.
  std::string text;
  std::vector<double> list;
};

struct FbxNode {
  std::string name;
  std::vector<FbxValue> values;
  std::vector<FbxNode> children;

  const FbxNode* child(std::string_view wanted) const;
};

/// Parses the sections named "Definitions", "Objects" and "Connections" of a binary or text FBX; other
/// sections and lists longer than 16 numbers are skipped. Throws std::runtime_error where the bytes are not
/// what they say.
FbxNode parse_fbx(std::string_view bytes);

}  // namespace sinew::assets::detail
