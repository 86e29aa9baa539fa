#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>

#include "assets/detail/file_bytes.h"
#include "assets/detail/importer_process.h"
#include "assets/detail/rig_builder.h"
#include "assets/detail/text.h"
#include "assets/error.h"
#include "assets/rig.h"

namespace sinew::assets {

namespace {

constexpr const char* kFormats =
    "glTF (.glb, .gltf), FBX, Collada (.dae), BVH or another format that assimp reads";

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::string as_hex(const std::string& bytes) {
  constexpr std::array<char, 17> kDigits{"0123456789abcdef"};
  std::string hex;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    hex += {kDigits[byte >> 4], kDigits[byte & 15], ' '};
  }
  if (!hex.empty()) hex.pop_back();
  return hex;
}

/// What can be told from the first bytes, before any importer sees the file.
void check_head(const std::string& file, const std::string& head) {
  if (head.empty()) {
    throw InputError(file, std::string("file is empty, got 0 bytes, expected ") + kFormats +
                               "; hint: export or copy the file again");
  }
  // A GLB cut within its magic is the GLB reader's to report.
  const std::string magic = "glTF";
  if (ends_with(file, ".glb") && head.compare(0, std::min(head.size(), magic.size()), magic, 0,
                                              std::min(head.size(), magic.size())) != 0) {
    throw InputError(
        file, "GLB header: magic, got " + as_hex(head.substr(0, 4)) + " ('" +
                  detail::printable(head.substr(0, 4)) +
                  "'), expected 67 6c 54 46 ('glTF'); hint: the file is something else under this name");
  }
}

/// Beside the program that runs; else, as in programs of others that link the library, on the PATH.
std::string default_importer() {
  const std::string name = "sinew-import", beside = detail::program_folder() + name;
  std::error_code ignored;
  if (std::filesystem::exists(beside, ignored)) return beside;
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path file = std::filesystem::path(folder) / name;
    if (!folder.empty() && std::filesystem::exists(file, ignored)) return file.string();
  }
  return beside;
}

}  // namespace

Rig load_rig(const std::string& file, const LoadOptions& options) {
  if (!(options.height >= 0.0) || !std::isfinite(options.height)) {
    throw ConfigError("height: got " + detail::number(options.height) + ", expected a length in metres > 0");
  }
  const detail::FileStamp before = detail::stamp_of(file);
  check_head(file, detail::read_head(file, 16));
  const std::string importer =
      options.importer_executable.empty() ? default_importer() : options.importer_executable;
  detail::ImportedScene scene = detail::import_in_process(importer, file);
  if (detail::stamp_of(file) != before) {
    throw IoError(detail::printable(file) +
                  ": changed while reading; hint: wait until the program that writes it has finished");
  }
  return detail::build_rig(file, std::move(scene), options);
}

}  // namespace sinew::assets
