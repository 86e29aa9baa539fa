#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sinew::tools {

/// The rigs among files and folders, each folder's by name: files of the endings of glTF, FBX and Collada. A
/// file is taken as it is. For programs that make tables of many rigs.
std::vector<std::filesystem::path> find_rigs(const std::vector<std::string>& places);

}  // namespace sinew::tools
