#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include "tools/make_samples/samples.h"

/// Writes the bundled characters into a folder: sinew-make-samples DIR.
int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: sinew-make-samples DIR\n");
    return 2;
  }
  const std::filesystem::path folder(argv[1]);
  const auto write = [&](const char* name, const sinew::assets::GlbScene& scene) {
    const std::string bytes = sinew::assets::glb_bytes(scene);
    std::ofstream file(folder / name, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) throw std::runtime_error((folder / name).string() + ": cannot be written");
    std::fprintf(stderr, "%s: %zu bytes\n", (folder / name).c_str(), bytes.size());
  };
  write("arm.glb", sinew::samples::make_arm());
  write("hopper.glb", sinew::samples::make_hopper());
  write("patchwork.glb", sinew::samples::make_patchwork());
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 5;
}
