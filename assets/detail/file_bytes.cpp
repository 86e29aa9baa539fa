#include "assets/detail/file_bytes.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "assets/detail/descriptor.h"
#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

[[noreturn]] void fail(const std::string& file, const std::string& what) {
  throw IoError(printable(file) + ": " + what);
}

std::string absolute_path(const std::string& file) {
  std::error_code ignored;
  const std::filesystem::path path = std::filesystem::absolute(file, ignored);
  return ignored ? file : path.string();
}

/// O_NONBLOCK: opening a FIFO without a writer would wait for ever.
int open_or_fail(const std::string& file) {
  if (file.find('\0') != std::string::npos) fail(file, "file name holds a NUL byte, expected none");
  const int fd = ::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd >= 0) return fd;
  const int error = errno;
  if (error == ENOENT || error == ENOTDIR) {
    fail(file, "not found, looked for " + printable(absolute_path(file)) +
                   "; hint: check the spelling of the path");
  }
  fail(file, std::string("cannot be opened: ") + std::strerror(error));
}

FileStamp stamp(const std::string& file, int fd) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) fail(file, std::string("cannot be examined: ") + std::strerror(errno));
  if (!S_ISREG(info.st_mode)) {
    const char* kind = S_ISDIR(info.st_mode)    ? "a directory"
                       : S_ISFIFO(info.st_mode) ? "a pipe"
                       : S_ISSOCK(info.st_mode) ? "a socket"
                                                : "a device";
    fail(file,
         std::string("not a regular file, got ") + kind + "; hint: name the file of the character itself");
  }
  const auto bytes = static_cast<std::uint64_t>(info.st_size);
  if (bytes > kMaxFileBytes) {
    throw LimitError(printable(file) + ": file size, got " + std::to_string(bytes) +
                     " bytes, expected at most " + std::to_string(kMaxFileBytes) +
                     "; hint: export the character alone");
  }
  return {bytes, info.st_mtim.tv_sec, info.st_mtim.tv_nsec};
}

/// Reads up to `count` bytes; fewer only at the end of the file.
std::string read_up_to(const std::string& file, int fd, std::size_t count) {
  std::string bytes(count, '\0');
  std::size_t have = 0;
  while (have < count) {
    const ssize_t n = ::read(fd, bytes.data() + have, count - have);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(file, std::string("cannot be read: ") + std::strerror(errno));
    if (n == 0) break;
    have += static_cast<std::size_t>(n);
  }
  bytes.resize(have);
  return bytes;
}

}  // namespace

FileStamp stamp_of(const std::string& file) {
  const Descriptor fd(open_or_fail(file));
  return stamp(file, fd.get());
}

std::string read_head(const std::string& file, std::size_t count) {
  const Descriptor fd(open_or_fail(file));
  const FileStamp before = stamp(file, fd.get());
  return read_up_to(file, fd.get(), static_cast<std::size_t>(std::min<std::uint64_t>(count, before.bytes)));
}

std::string read_whole(const std::string& file) {
  const Descriptor fd(open_or_fail(file));
  const FileStamp before = stamp(file, fd.get());
  std::string bytes = read_up_to(file, fd.get(), static_cast<std::size_t>(before.bytes));
  if (bytes.size() != before.bytes || stamp(file, fd.get()) != before) {
    fail(file, "changed while reading; hint: wait until the program that writes it has finished");
  }
  return bytes;
}

}  // namespace sinew::assets::detail
