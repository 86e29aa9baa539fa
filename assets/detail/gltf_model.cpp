// The one translation unit that holds tinygltf's implementation.
#include "assets/detail/gltf_model.h"

// tinygltf leaves out what it needs under TINYGLTF_NO_FS.
#include <fstream>

#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunused-function"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

/// The name that follows the last slash: tinygltf puts a directory before the stand-in names of the
/// container.
std::string stand_in(const std::string& path) { return path.substr(path.rfind('/') + 1); }

const GltfContainer& container_of(void* user_data) { return *static_cast<const GltfContainer*>(user_data); }

bool exists(const std::string& path, void* user_data) {
  return container_of(user_data).external_buffers.count(stand_in(path)) != 0;
}

bool read_stand_in(std::vector<unsigned char>* out, std::string* error, const std::string& path,
                   void* user_data) {
  const auto found = container_of(user_data).external_buffers.find(stand_in(path));
  if (found == container_of(user_data).external_buffers.end()) {
    if (error != nullptr) *error += "no such buffer";
    return false;
  }
  out->assign(found->second.begin(), found->second.end());
  return true;
}

/// tinygltf gathers several lines; the first names the cause.
std::string first_line(const std::string& text) { return printable(text.substr(0, text.find('\n'))); }

}  // namespace

void parse_gltf(const std::string& file, const GltfContainer& container, tinygltf::Model& model) {
  tinygltf::TinyGLTF loader;
  GltfContainer& user_data = const_cast<GltfContainer&>(container);  // handed back as const above
  loader.SetFsCallbacks(
      {&exists, [](const std::string& path, void*) { return path; }, &read_stand_in,
       [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; },
       &user_data});
  std::string error, warning;
  const bool ok = loader.LoadBinaryFromMemory(
      &model, &error, &warning, reinterpret_cast<const unsigned char*>(container.glb.data()),
      static_cast<unsigned int>(container.glb.size()), "", tinygltf::REQUIRE_VERSION);
  if (ok && error.empty()) return;
  throw InputError(file, "glTF: cannot be read: " + (error.empty() ? "no reason given" : first_line(error)) +
                             "; hint: check the file with a glTF validator and export it again");
}

}  // namespace sinew::assets::detail
