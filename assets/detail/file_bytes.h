#pragma once

#include <cstdint>
#include <string>

namespace sinew::assets::detail {

/// Files larger than this are refused (LimitError): four times the largest rig met so far is 100 MB, and
/// GLB's own 32-bit lengths end at 4 GB.
constexpr std::uint64_t kMaxFileBytes = 2ull << 30;

/// Size and time of a regular file, to notice that it changed while it was being read.
struct FileStamp {
  std::uint64_t bytes = 0;
  std::int64_t modified_s = 0;
  std::int64_t modified_ns = 0;
  bool operator==(const FileStamp&) const = default;
};

/// Checks that `file` is a regular, readable file, without ever waiting on a FIFO or device. Throws IoError
/// (missing, no permission, not a regular file) or LimitError (too large).
FileStamp stamp_of(const std::string& file);

/// The first bytes of the file, at most `count`. Throws as stamp_of().
std::string read_head(const std::string& file, std::size_t count);

/// The whole file. Throws as stamp_of(), and IoError "changed while reading".
std::string read_whole(const std::string& file);

}  // namespace sinew::assets::detail
