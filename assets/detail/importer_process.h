#pragma once

#include <cstdint>
#include <string>

#include "assets/detail/imported_scene.h"

/// Third-party importers run in a process of their own (`sinew-import`), so that a file that makes one crash,
/// loop or eat memory costs one clear message.
namespace sinew::assets::detail {

struct ImporterLimits {
  /// Address space of the importer [bytes]; 0 = none.
  std::uint64_t memory_bytes = 4ull << 30;
  /// Wall clock [s] after which the importer is killed.
  double seconds = 60.0;
};

/// First byte of the importer's answer: what follows is a scene, or the text of an error of that kind.
enum class AnswerKind : char { Scene = 'S', Input = 'I', Io = 'O', Limit = 'L' };

/// Folder of the running program, with a slash at its end; empty where the system does not tell.
std::string program_folder();

/// Runs `executable file` and takes its answer apart. Throws InputError (also where the importer died on the
/// file), IoError (also where it cannot be started) or LimitError (memory or time used up).
ImportedScene import_in_process(const std::string& executable, const std::string& file,
                                const ImporterLimits& limits = {});

/// What the importer executable does: limits itself, reads argv[1] with the right reader and writes the
/// answer to descriptor 3. Returns its exit code.
int importer_main(int argc, char** argv);

}  // namespace sinew::assets::detail
