#include <cerrno>
#include <cstdlib>
#include <exception>
#include <new>
#include <string>

#include <sys/resource.h>
#include <unistd.h>

#include "assets/detail/assimp_reader.h"
#include "assets/detail/file_bytes.h"
#include "assets/detail/gltf_reader.h"
#include "assets/detail/importer_process.h"
#include "assets/detail/scene_archive.h"
#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

constexpr int kAnswerDescriptor = 3;

/// AddressSanitizer reserves terabytes of address space for its shadow, so the limit would end it at once.
#if defined(__SANITIZE_ADDRESS__)
constexpr bool kLimitMemory = false;
#else
constexpr bool kLimitMemory = true;
#endif

void limit_self(std::uint64_t memory_bytes) {
  // No core files: a crash here is an answer, not a bug to be kept.
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  if (!kLimitMemory || memory_bytes == 0) return;
  const rlimit memory{memory_bytes, memory_bytes};
  ::setrlimit(RLIMIT_AS, &memory);
}

bool write_all(const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(kAnswerDescriptor, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    done += static_cast<std::size_t>(n);
  }
  return true;
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// By content where it shows, by name otherwise.
bool is_gltf(const std::string& file) {
  return read_head(file, 4) == "glTF" || ends_with(file, ".gltf") || ends_with(file, ".glb") ||
         ends_with(file, ".GLTF") || ends_with(file, ".GLB");
}

std::string answer_with(AnswerKind kind, const std::string& payload) {
  return std::string(1, static_cast<char>(kind)) + payload;
}

std::string import(const std::string& file) {
  try {
    return answer_with(AnswerKind::Scene,
                       write_scene(is_gltf(file) ? read_gltf(file) : read_with_assimp(file)));
  } catch (const InputError& e) {
    return answer_with(AnswerKind::Input, without_file(file, e.what()));  // the parent puts it back
  } catch (const IoError& e) {
    return answer_with(AnswerKind::Io, e.what());
  } catch (const LimitError& e) {
    return answer_with(AnswerKind::Limit, e.what());
  } catch (const std::bad_alloc&) {
    return answer_with(AnswerKind::Limit,
                       printable(file) + ": importer: memory used up; hint: export a smaller scene");
  } catch (const std::exception& e) {
    return answer_with(AnswerKind::Input, std::string("importer: ") + printable(e.what()));
  }
}

}  // namespace

int importer_main(int argc, char** argv) {
  if (argc != 3) return 2;
  limit_self(std::strtoull(argv[2], nullptr, 10));
  return write_all(import(argv[1])) ? 0 : 5;
}

}  // namespace sinew::assets::detail
