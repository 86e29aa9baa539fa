#include "tools/measured/rig_files.h"

#include <algorithm>

namespace sinew::tools {

namespace fs = std::filesystem;

namespace {

bool is_rig(const fs::path& path) {
  static const std::vector<std::string> kEndings{".glb", ".gltf", ".fbx", ".dae"};
  return std::find(kEndings.begin(), kEndings.end(), path.extension().string()) != kEndings.end();
}

}  // namespace

std::vector<fs::path> find_rigs(const std::vector<std::string>& places) {
  std::vector<fs::path> rigs;
  for (const std::string& place : places) {
    if (!fs::is_directory(place)) {
      rigs.emplace_back(place);
      continue;
    }
    std::vector<fs::path> here;
    for (const fs::directory_entry& entry : fs::directory_iterator(place)) {
      if (is_rig(entry.path())) here.push_back(entry.path());
    }
    std::sort(here.begin(), here.end());
    rigs.insert(rigs.end(), here.begin(), here.end());
  }
  return rigs;
}

}  // namespace sinew::tools
