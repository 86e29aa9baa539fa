#include "assets/detail/importer_process.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "assets/detail/scene_archive.h"
#include "assets/detail/text.h"
#include "assets/error.h"

extern char** environ;

namespace sinew::assets::detail {

namespace {

using Clock = std::chrono::steady_clock;

/// Descriptor on which the importer answers; standard output is left to the libraries it calls.
constexpr int kAnswerDescriptor = 3;
/// A scene of the largest file that is accepted is smaller than this.
constexpr std::size_t kMaxAnswerBytes = std::size_t{4} << 30;

constexpr const char* kOpenElsewhere = "; hint: open the file in Blender and export it as .glb";

/// A child process and the reading end of its pipe; killed and reaped whatever happens.
class Child {
 public:
  Child(const std::string& executable, const std::string& file, const ImporterLimits& limits) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
      throw IoError(printable(file) + ": importer: no pipe: " + std::strerror(errno));
    }
    read_end_ = ends[0];
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], kAnswerDescriptor);
    ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    const std::string memory = std::to_string(limits.memory_bytes);
    std::vector<char*> arguments;
    for (const std::string* s : {&executable, &file, &memory})
      arguments.push_back(const_cast<char*>(s->c_str()));
    arguments.push_back(nullptr);
    const int error = ::posix_spawn(&pid_, executable.c_str(), &actions, nullptr, arguments.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    if (error != 0) {
      pid_ = -1;
      ::close(read_end_);
      throw IoError(printable(executable) + ": importer cannot be started: " + std::strerror(error) +
                    "; hint: install sinew-import beside sinew");
    }
  }

  ~Child() {
    ::close(read_end_);
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      wait();
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Everything the child writes until it closes the pipe. False when the time was up first.
  bool read_all(double seconds, std::string& answer) {
    const auto deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    std::array<char, 1 << 16> block{};
    while (true) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
      if (left <= 0) return false;
      pollfd wanted{read_end_, POLLIN, 0};
      const int ready = ::poll(&wanted, 1, static_cast<int>(std::min<long>(left, 1000)));
      if (ready < 0 && errno != EINTR) throw std::runtime_error(std::strerror(errno));
      if (ready <= 0) continue;
      const ssize_t n = ::read(read_end_, block.data(), block.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw std::runtime_error(std::strerror(errno));
      if (n == 0) return true;
      answer.append(block.data(), static_cast<std::size_t>(n));
      if (answer.size() > kMaxAnswerBytes) throw std::length_error("answer too long");
    }
  }

  /// Waits for the end; the status as wait() gives it.
  int wait() {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status;
  }

 private:
  pid_t pid_ = -1;
  int read_end_ = -1;
};

[[noreturn]] void rethrow(const std::string& file, AnswerKind kind, const std::string& message) {
  switch (kind) {
    case AnswerKind::Io:
      throw IoError(message);
    case AnswerKind::Limit:
      throw LimitError(message);
    default:
      throw InputError(file, message);
  }
}

[[noreturn]] void report_death(const std::string& file, int status) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    throw InputError(file, "importer: crashed on this file, got signal " + std::to_string(signal) + " (" +
                               ::strsignal(signal) + "); the file is probably malformed" + kOpenElsewhere);
  }
  throw InputError(file, "importer: gave up on this file without an answer, got exit code " +
                             std::to_string(WEXITSTATUS(status)) + kOpenElsewhere);
}

}  // namespace

std::string program_folder() {
  std::array<char, 4096> path{};
  const ssize_t n = ::readlink("/proc/self/exe", path.data(), path.size());
  if (n <= 0 || static_cast<std::size_t>(n) == path.size()) return "";
  const std::string whole(path.data(), static_cast<std::size_t>(n));
  return whole.substr(0, whole.rfind('/') + 1);
}

ImportedScene import_in_process(const std::string& executable, const std::string& file,
                                const ImporterLimits& limits) {
  Child child(executable, file, limits);
  std::string answer;
  if (!child.read_all(limits.seconds, answer)) {
    throw LimitError(printable(file) + ": importer: time used up, got no answer in " +
                     number(limits.seconds) + " s; hint: export a smaller scene, or as .glb");
  }
  const int status = child.wait();
  if (answer.empty() || !WIFEXITED(status) || WEXITSTATUS(status) != 0) report_death(file, status);
  const auto kind = static_cast<AnswerKind>(answer.front());
  if (kind != AnswerKind::Scene) rethrow(file, kind, answer.substr(1));
  ImportedScene scene;
  try {
    scene = read_scene(std::string_view(answer).substr(1));
  } catch (const std::runtime_error& e) {
    throw InputError(file, std::string("importer: broken answer: ") + e.what() + kOpenElsewhere);
  }
  check_scene(file, scene);
  return scene;
}

}  // namespace sinew::assets::detail
