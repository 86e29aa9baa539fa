#include "assets/atomic_output.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "assets/detail/descriptor.h"
#include "assets/error.h"

namespace sinew::assets {
namespace {

namespace fs = std::filesystem;
using detail::Descriptor;

/// Ending of the name under which an earlier run waits to be removed, where a file system cannot swap names.
constexpr const char* kAside = "-replaced";

[[noreturn]] void fail(const std::string& shown, const std::string& what, int error) {
  throw IoError(shown + ": " + what + ": " + std::strerror(error));
}

/// Absolute, without a slash at its end; the name itself is not followed if it is a symbolic link to nowhere.
fs::path absolute_target(const std::string& shown) {
  if (shown.empty()) throw IoError("the output path is empty");
  fs::path path = fs::absolute(shown).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  if (!path.has_filename()) throw IoError(shown + ": cannot be replaced by an output");
  std::error_code error;
  const bool is_link = fs::is_symlink(path, error);
  if (is_link) {
    fs::path real = fs::canonical(path, error);
    if (error) fail(shown, "a symbolic link that leads nowhere", error.value());
    return real;
  }
  return path;
}

std::string partial_prefix(const fs::path& target) {
  return fmt::format(".{}.partial-", target.filename().string());
}

/// Locked by the process that fills a folder, for as long as it does. Not the folder itself: writing a file
/// in it locks that for a moment.
constexpr const char* kLockName = ".writing";

/// Opens a file and takes its lock without waiting; -1 where another process has it or it is gone.
int open_locked(const fs::path& path, int flags = O_RDONLY) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC, 0666);
  if (fd < 0) return -1;
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  ::close(fd);
  return -1;
}

/// Removes what dead processes left of this output. The lock, not the process number, tells who lives:
/// numbers are used again. Throws BusyError where somebody else is at it.
void clear_partials(const fs::path& target, const std::string& shown) {
  const std::string prefix = partial_prefix(target);
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator it(target.parent_path(), error), end; !error && it != end; it.increment(error))
    if (it->path().filename().string().rfind(prefix, 0) == 0) found.push_back(it->path());
  if (error) fail(shown, "cannot read folder '" + target.parent_path().string() + "'", error.value());
  for (const fs::path& partial : found) {
    const fs::path lock_file = fs::is_directory(partial, error) ? partial / kLockName : partial;
    const Descriptor lock(open_locked(lock_file));
    if (lock.get() < 0 && fs::exists(lock_file, error))
      throw BusyError(shown + ": process " + partial.filename().string().substr(prefix.size()) +
                      " is writing it; hint: wait for it or choose another output");
    // Killed after it moved the earlier run aside and before it put the new one in place: the earlier comes
    // back.
    if (partial.string().ends_with(kAside) && !fs::exists(fs::symlink_status(target, error)) &&
        ::rename(partial.c_str(), target.c_str()) == 0)
      continue;
    fs::remove_all(partial, error);
    if (error)
      fail(shown, "cannot remove '" + partial.string() + "', which a stopped run left", error.value());
  }
}

/// The folders above an output that were not there. Without keep() those that are still empty go again: a run
/// that fails leaves no trail of them.
class NewFolders {
 public:
  NewFolders(const fs::path& folder, const std::string& shown) {
    std::vector<fs::path> missing;
    std::error_code ignored;
    for (fs::path at = folder; !fs::exists(fs::symlink_status(at, ignored)); at = at.parent_path())
      missing.push_back(at);
    for (auto at = missing.rbegin(); at != missing.rend(); ++at) {
      if (::mkdir(at->c_str(), 0777) == 0) {
        made_.push_back(at->string());
      } else if (errno != EEXIST) {  // another process may have been faster
        const int reason = errno;
        remove(made_);
        fail(shown, "cannot make folder '" + at->string() + "'", reason);
      }
    }
  }
  ~NewFolders() { remove(made_); }
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;

  std::vector<std::string> keep() { return std::exchange(made_, {}); }

  static void remove(const std::vector<std::string>& made) {
    for (auto at = made.rbegin(); at != made.rend(); ++at) ::rmdir(at->c_str());
  }

 private:
  std::vector<std::string> made_;  ///< from the top down.
};

/// Holds the lock of the parent folder, so that of two processes that start together one sees the other's
/// sibling.
Descriptor lock_parent(const fs::path& target, const std::string& shown) {
  const fs::path parent = target.parent_path();
  Descriptor fd(::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0) fail(shown, "cannot open folder '" + parent.string() + "'", errno);
  if (::access(parent.c_str(), W_OK | X_OK) != 0)
    fail(shown, "cannot write in folder '" + parent.string() + "'", errno);
  while (::flock(fd.get(), LOCK_EX) != 0)
    if (errno != EINTR) fail(shown, "cannot lock folder '" + parent.string() + "'", errno);
  return Descriptor(fd.release());
}

void sync_path(const fs::path& path, const std::string& shown) {
  const Descriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  // Some file systems have no fsync for folders and say EINVAL.
  if (fd.get() < 0 || (::fsync(fd.get()) != 0 && errno != EINVAL))
    fail(shown, "cannot bring '" + path.filename().string() + "' to the disk", errno);
}

void write_all(int fd, std::string_view bytes, const std::string& shown) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(shown, fmt::format("cannot be written, {} bytes missing", bytes.size()), errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void check_replaceable(const fs::path& target, const std::string& shown, Overwrite overwrite,
                       const std::vector<std::string>& own_names) {
  std::error_code error;
  const fs::file_status status = fs::status(target, error);
  if (!fs::exists(status)) {
    if (error && error != std::errc::no_such_file_or_directory)
      fail(shown, "cannot be reached", error.value());
    return;
  }
  if (!fs::is_directory(status)) throw IoError(shown + ": is a file, expected a folder or a new name");
  std::vector<std::string> names;
  for (fs::directory_iterator it(target, error), end; !error && it != end; it.increment(error))
    names.push_back(it->path().filename().string());
  if (error) fail(shown, "cannot be read", error.value());
  if (names.empty()) return;
  std::sort(names.begin(), names.end());
  if (overwrite == Overwrite::Refuse)
    throw BusyError(
        fmt::format("{}: is not empty, it holds '{}'{}; hint: `overwrite` replaces an earlier run", shown,
                    names.front(), names.size() > 1 ? fmt::format(" and {} more", names.size() - 1) : ""));
  for (const std::string& name : names)
    if (std::find(own_names.begin(), own_names.end(), name) == own_names.end())
      throw BusyError(
          shown + ": holds '" + name +
          "', which is not of an earlier run and would be lost; hint: move it away or choose another output");
}

/// Swaps two names in one step where the file system can; otherwise moves the old one aside first.
void put_in_place(const fs::path& partial, const fs::path& target, const std::string& shown) {
  if (::renameat2(AT_FDCWD, partial.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno == ENOENT) {  // nothing to swap with
    if (::rename(partial.c_str(), target.c_str()) == 0) return;
    fail(shown, "cannot be put in place", errno);
  }
  if (errno != EINVAL && errno != ENOSYS) fail(shown, "cannot be put in place", errno);
  // Under a name of the same kind, so that the next run removes it if this one is killed before it does.
  const fs::path aside = partial.string() + kAside;
  if (::rename(target.c_str(), aside.c_str()) != 0) fail(shown, "cannot be moved aside", errno);
  if (::rename(partial.c_str(), target.c_str()) != 0) {
    const int error = errno;
    ::rename(aside.c_str(), target.c_str());
    fail(shown, "cannot be put in place", error);
  }
  if (::rename(aside.c_str(), partial.c_str()) != 0) fail(shown, "cannot remove the earlier run", errno);
}

}  // namespace

void write_file(const std::string& path, std::string_view bytes, Overwrite overwrite) {
  const fs::path target = absolute_target(path);
  const fs::path partial = target.parent_path() / (partial_prefix(target) + std::to_string(::getpid()));
  NewFolders folders(target.parent_path(), path);
  const Descriptor parent = lock_parent(target, path);
  clear_partials(target, path);
  std::error_code error;
  if (fs::is_directory(target, error)) throw IoError(path + ": is a folder, expected a file or a new name");
  if (overwrite == Overwrite::Refuse && fs::exists(target, error))
    throw BusyError(path + ": exists already; hint: `overwrite` replaces it");
  const Descriptor file(::open(partial.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (file.get() < 0) fail(path, "cannot be created", errno);
  try {
    ::flock(file.get(), LOCK_EX | LOCK_NB);
    write_all(file.get(), bytes, path);
    if (::fsync(file.get()) != 0) fail(path, "cannot be brought to the disk", errno);
    if (::rename(partial.c_str(), target.c_str()) != 0) fail(path, "cannot be put in place", errno);
  } catch (...) {
    ::unlink(partial.c_str());
    throw;
  }
  folders.keep();
  sync_path(target.parent_path(), path);
}

OutputDirectory::OutputDirectory(const std::string& path, Overwrite overwrite,
                                 const std::vector<std::string>& own_names)
    : shown_(path), overwrite_(overwrite), own_names_(own_names) {
  const fs::path target = absolute_target(path);
  NewFolders folders(target.parent_path(), path);
  const Descriptor parent = lock_parent(target, path);
  clear_partials(target, path);
  check_replaceable(target, path, overwrite, own_names);
  const fs::path partial = target.parent_path() / (partial_prefix(target) + std::to_string(::getpid()));
  if (::mkdir(partial.c_str(), 0777) != 0) fail(path, "cannot be created", errno);
  target_ = target.string();
  partial_ = partial.string();
  lock_ = open_locked(partial / kLockName, O_WRONLY | O_CREAT | O_EXCL);
  if (lock_ < 0) {
    const int reason = errno;
    fs::remove_all(partial);
    fail(path, "cannot be created", reason);
  }
  made_ = folders.keep();
}

OutputDirectory::~OutputDirectory() {
  // The lock goes last: until then nobody takes the sibling for one that was left behind.
  std::error_code ignored;
  if (!partial_.empty()) fs::remove_all(partial_, ignored);
  if (lock_ >= 0) ::close(lock_);
  NewFolders::remove(made_);
}

void OutputDirectory::write(const std::string& name, std::string_view bytes) const {
  const Descriptor out(::open(file(name).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (out.get() < 0) fail(shown_ + "/" + name, "cannot be created", errno);
  write_all(out.get(), bytes, shown_ + "/" + name);  // commit() brings it to the disk
}

void OutputDirectory::commit() {
  const fs::path target(target_), partial(partial_);
  std::error_code error;
  for (fs::recursive_directory_iterator it(partial, error), end; !error && it != end; it.increment(error))
    sync_path(it->path(), shown_);
  if (error) fail(shown_, "cannot be read back", error.value());
  sync_path(partial, shown_);
  const Descriptor parent = lock_parent(target, shown_);
  check_replaceable(target, shown_, overwrite_, own_names_);  // it may have been filled since we started
  if (::unlink((partial / kLockName).c_str()) != 0) fail(shown_, "cannot be finished", errno);
  put_in_place(partial, target, shown_);
  sync_path(target.parent_path(), shown_);
  // Now the sibling is the earlier run, if there was one.
  fs::remove_all(partial, error);
  if (error) fail(shown_, "the new output is in place, but the earlier one cannot be removed", error.value());
  partial_.clear();
  made_.clear();
}

}  // namespace sinew::assets
