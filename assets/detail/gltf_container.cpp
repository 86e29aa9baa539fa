#include "assets/detail/gltf_container.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "assets/detail/file_bytes.h"
#include "assets/detail/text.h"
#include "assets/error.h"

namespace sinew::assets::detail {

namespace {

using nlohmann::json;

constexpr std::string_view kMagic = "glTF";
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
/// glTF nests about ten deep; extras may nest more, but no honest file needs hundreds.
constexpr int kMaxJsonDepth = 128;
/// Whole numbers above this are not exact in JavaScript or in a double, so no exporter can mean them.
constexpr double kMaxExactInteger = 9007199254740992.0;

struct Chunks {
  std::string_view json;
  std::string_view binary;
};

std::uint32_t read_u32(std::string_view bytes, std::size_t offset) {
  std::array<unsigned char, 4> b{};
  std::memcpy(b.data(), bytes.data() + offset, 4);
  return static_cast<std::uint32_t>(b[0]) | static_cast<std::uint32_t>(b[1]) << 8 |
         static_cast<std::uint32_t>(b[2]) << 16 | static_cast<std::uint32_t>(b[3]) << 24;
}

void append_u32(std::string& bytes, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>((value >> shift) & 0xFF));
}

std::string chunk_name(std::uint32_t type) {
  if (type == kJsonChunk) return "JSON";
  if (type == kBinaryChunk) return "BIN";
  return fmt::format("0x{:08x}", type);
}

class ContainerReader {
 public:
  ContainerReader(const std::string& file, std::string_view bytes) : file_(file), bytes_(bytes) {}

  GltfContainer run() {
    const Chunks chunks = split_chunks();
    json document = parse(chunks.json);
    check_version(document);
    check_extensions(document);
    check_numbers(document, "");
    take_uncompressed(document);
    spell_out_defaults(document);
    for (const char* unused : {"images", "textures", "materials", "samplers", "cameras", "extensions",
                               "extensionsUsed", "extensionsRequired"}) {
      document.erase(unused);
    }
    GltfContainer result;
    resolve_buffers(document, chunks, result);
    result.glb = pack(document, chunks.binary);
    return result;
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const { throw InputError(file_, message); }

  Chunks split_chunks() const {
    if (bytes_.substr(0, 4) != kMagic) return {bytes_, {}};
    if (bytes_.size() < kHeaderBytes) {
      refuse("GLB header: file is truncated, got " + std::to_string(bytes_.size()) +
             " bytes, expected at least 12; hint: copy or export the file again");
    }
    const std::uint32_t version = read_u32(bytes_, 4);
    if (version != 2) {
      refuse("GLB header: version, got " + std::to_string(version) +
             ", expected 2; hint: export as glTF 2.0");
    }
    const std::uint32_t declared = read_u32(bytes_, 8);
    if (declared > bytes_.size()) {
      refuse("GLB header: file is truncated, got " + std::to_string(bytes_.size()) + " bytes, expected " +
             std::to_string(declared) + " as declared at offset 8; hint: copy or export the file again");
    }
    const std::string_view whole = bytes_.substr(0, declared);
    Chunks chunks;
    std::size_t offset = kHeaderBytes;
    chunks.json = take_chunk(whole, offset, kJsonChunk);
    if (offset < whole.size()) chunks.binary = take_chunk(whole, offset, kBinaryChunk);
    return chunks;
  }

  std::string_view take_chunk(std::string_view whole, std::size_t& offset, std::uint32_t wanted) const {
    const std::string thing = "GLB " + chunk_name(wanted) + " chunk at offset " + std::to_string(offset);
    if (whole.size() - offset < kChunkHeaderBytes) {
      refuse(thing + ": header is cut short, got " + std::to_string(whole.size() - offset) +
             " bytes, expected 8");
    }
    const std::uint32_t length = read_u32(whole, offset);
    const std::uint32_t type = read_u32(whole, offset + 4);
    if (type != wanted) {
      refuse(thing + ": wrong chunk type, got " + chunk_name(type) + ", expected " + chunk_name(wanted) +
             "; hint: export the file again");
    }
    const std::size_t left = whole.size() - offset - kChunkHeaderBytes;
    if (length > left) {
      refuse(thing + ": longer than the file, got a declared " + std::to_string(length) +
             " bytes, expected at most " + std::to_string(left) + "; hint: copy or export the file again");
    }
    const std::string_view data = whole.substr(offset + kChunkHeaderBytes, length);
    offset += kChunkHeaderBytes + length;
    return data;
  }

  json parse(std::string_view text) const {
    // Blanks pad a chunk; some exporters pad with zeros against the specification.
    while (!text.empty() && (text.back() == '\0' || text.back() == ' ')) text.remove_suffix(1);
    const auto watch_depth = [this](int depth, json::parse_event_t, json&) {
      if (depth > kMaxJsonDepth) {
        refuse("JSON: nested too deeply, got more than " + std::to_string(kMaxJsonDepth) +
               " levels; hint: export the file again");
      }
      return true;
    };
    json document;
    try {
      document = json::parse(text.begin(), text.end(), watch_depth);
    } catch (const json::exception& e) {
      refuse("JSON: cannot be parsed: " + plain(e.what()) + "; hint: copy or export the file again");
    }
    if (!document.is_object()) refuse("JSON: the root, expected an object; hint: export the file again");
    return document;
  }

  /// The parser's own sentence without its number: "[json.exception.parse_error.101] parse error at line 3,
  /// ...".
  static std::string plain(std::string_view what) {
    const std::size_t end = what.find("] ");
    return printable(end == std::string_view::npos ? what : what.substr(end + 2));
  }

  void check_version(const json& document) const {
    std::string version;
    if (const auto asset = document.find("asset"); asset != document.end() && asset->is_object()) {
      if (const auto v = asset->find("version"); v != asset->end() && v->is_string())
        version = v->get<std::string>();
    }
    if (version.rfind("2.", 0) == 0) return;
    refuse("/asset/version: got '" + printable(version) + "', expected 2.x; hint: export as glTF 2.0");
  }

  /// Extensions that change neither points nor joints may be required: they are about looks.
  static bool about_looks(const std::string& name) {
    for (const char* prefix : {"KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_",
                               "KHR_lights_", "EXT_lights_", "KHR_xmp"}) {
      if (name.rfind(prefix, 0) == 0) return true;
    }
    return name == "KHR_mesh_quantization";
  }

  void check_extensions(const json& document) const {
    const auto required = document.find("extensionsRequired");
    if (required == document.end()) return;
    if (!required->is_array()) refuse("/extensionsRequired: expected an array of names");
    for (const json& entry : *required) {
      const std::string name = entry.is_string() ? entry.get<std::string>() : entry.dump();
      if (about_looks(name)) continue;
      const bool compressed = name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression" ||
                              name == "KHR_meshopt_compression";
      refuse("/extensionsRequired: extension '" + printable(name) + "' is not supported; hint: " +
             (compressed ? "export again with mesh compression switched off" : "export again without it"));
    }
  }

  /// Compression that is not required may stand beside plain data, which is then taken; where it stands alone
  /// it is refused by its name, before anyone looks for the data.
  void take_uncompressed(json& document) const {
    static constexpr const char* kDraco = "KHR_draco_mesh_compression";
    static constexpr const char* kMeshopt = "EXT_meshopt_compression";
    const auto refuse_compressed = [&](const std::string& path, const char* name) {
      refuse(path + ": extension '" + name +
             "' is not supported; hint: export again with mesh compression switched off");
    };
    const auto is_plain = [&](const json& accessor) {
      const json* found = element(document, "accessors", accessor);
      return found == nullptr || found->contains("bufferView") || found->contains("sparse");
    };
    for_each(document, "meshes", [&](json& mesh, const std::string& mesh_path) {
      for_each(mesh, "primitives", [&](json& primitive, const std::string& path) {
        const auto extensions = primitive.find("extensions");
        if (extensions == primitive.end() || !extensions->is_object() || !extensions->contains(kDraco))
          return;
        bool plain = !primitive.contains("indices") || is_plain(primitive["indices"]);
        if (const auto attributes = primitive.find("attributes");
            attributes != primitive.end() && attributes->is_object()) {
          for (const json& accessor : *attributes) plain = plain && is_plain(accessor);
        }
        if (!plain) refuse_compressed(mesh_path + path, kDraco);
        extensions->erase(kDraco);
      });
    });
    for_each(document, "bufferViews", [&](json& view, const std::string& path) {
      const auto extensions = view.find("extensions");
      if (extensions == view.end() || !extensions->is_object() || !extensions->contains(kMeshopt)) return;
      const json* buffer = view.contains("buffer") ? element(document, "buffers", view["buffer"]) : nullptr;
      // A fallback buffer without a URI is a promise that whoever reads the file decompresses it.
      if (buffer != nullptr && buffer->contains("extensions") && !buffer->contains("uri"))
        refuse_compressed(path, kMeshopt);
    });
  }

  /// What glTF lets a file leave out and the parser wants to see.
  static void spell_out_defaults(json& document) {
    // Without inverse bind matrices they are the identity.
    for_each(document, "skins", [](json& skin, const std::string&) {
      if (!skin.contains("inverseBindMatrices")) skin["inverseBindMatrices"] = -1;
    });
    // Without a node the target belongs to an extension.
    for_each(document, "animations", [](json& animation, const std::string&) {
      for_each(animation, "channels", [](json& channel, const std::string&) {
        const auto target = channel.find("target");
        if (target == channel.end() || !target->is_object()) return;
        if (!target->contains("node")) (*target)["node"] = -1;
        if (!target->contains("path")) (*target)["path"] = "";
      });
    });
  }

  /// Calls `visit(object, "/name/index")` for every object of the array `name` in `parent`, where there is
  /// one.
  template <typename Visit>
  static void for_each(json& parent, const char* name, const Visit& visit) {
    const auto list = parent.find(name);
    if (list == parent.end() || !list->is_array()) return;
    for (std::size_t i = 0; i < list->size(); ++i) {
      if ((*list)[i].is_object()) visit((*list)[i], "/" + std::string(name) + "/" + std::to_string(i));
    }
  }

  /// The object that an index points to; null where there is none, which is for others to complain about.
  static const json* element(const json& document, const char* name, const json& index) {
    const auto list = document.find(name);
    if (list == document.end() || !list->is_array() || !index.is_number_unsigned()) return nullptr;
    const auto i = index.get<std::size_t>();
    return i < list->size() && (*list)[i].is_object() ? &(*list)[i] : nullptr;
  }

  /// Whole numbers must fit what they are read into later: sizes and offsets 2^53, everything else an int.
  void check_numbers(const json& value, const std::string& path) const {
    if (value.is_array()) {
      std::size_t i = 0;
      for (const json& item : value) check_numbers(item, path + "/" + std::to_string(i++));
    } else if (value.is_object()) {
      for (const auto& [key, item] : value.items()) {
        if (key == "extras" || key == "extensions") continue;
        check_numbers(item, path + "/" + printable(key));
      }
    } else if (value.is_number_integer()) {
      const bool size =
          path.find("/sparse/") == std::string::npos &&
          (ends_with(path, "/byteOffset") || ends_with(path, "/byteLength") || ends_with(path, "/count"));
      const double number = value.is_number_unsigned() ? static_cast<double>(value.get<std::uint64_t>())
                                                       : static_cast<double>(value.get<std::int64_t>());
      const double low = size ? 0.0 : static_cast<double>(std::numeric_limits<int>::min());
      const double high = size ? kMaxExactInteger : static_cast<double>(std::numeric_limits<int>::max());
      if (number >= low && number <= high) return;
      refuse(path + ": whole number, got " + value.dump() + ", expected " + fmt::format("{:.0f}", low) +
             " to " + fmt::format("{:.0f}", high) + "; hint: export the file again");
    }
  }

  static bool ends_with(const std::string& text, std::string_view end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
  }

  void resolve_buffers(json& document, const Chunks& chunks, GltfContainer& result) const {
    const auto buffers = document.find("buffers");
    if (buffers == document.end()) return;
    if (!buffers->is_array()) refuse("/buffers: expected an array");
    for (std::size_t i = 0; i < buffers->size(); ++i) {
      const std::string path = "/buffers/" + std::to_string(i);
      json& buffer = (*buffers)[i];
      if (!buffer.is_object() || !buffer.contains("byteLength") ||
          !buffer["byteLength"].is_number_unsigned() || buffer["byteLength"].get<std::uint64_t>() == 0) {
        refuse(path + "/byteLength: missing or not a positive whole number");
      }
      const auto length = buffer["byteLength"].get<std::uint64_t>();
      if (!buffer.contains("uri")) {
        if (chunks.binary.empty())
          refuse(path + ": has no data: no uri and no BIN chunk; hint: export again as .glb");
        check_length(path, length, chunks.binary.size());
        continue;
      }
      if (!buffer["uri"].is_string()) refuse(path + "/uri: expected a string");
      const auto uri = buffer["uri"].get<std::string>();
      if (uri.rfind("data:", 0) == 0) {
        // Base64 carries three bytes in four characters.
        check_length(path, length, uri.size() / 4 * 3);
        continue;
      }
      std::string data = read_external(path, uri);
      check_length(path, length, data.size());
      data.resize(static_cast<std::size_t>(length));
      const std::string stand_in = "buffer" + std::to_string(i);
      result.external_buffers[stand_in] = std::move(data);
      buffer["uri"] = stand_in;
    }
  }

  void check_length(const std::string& path, std::uint64_t declared, std::uint64_t actual) const {
    if (declared <= actual) return;
    refuse(path + "/byteLength: more than there is, got " + std::to_string(declared) + ", expected at most " +
           std::to_string(actual) + "; hint: copy or export the file again");
  }

  std::string percent_decoded(const std::string& path, const std::string& uri) const {
    const auto digit = [](char c) {
      if (c >= '0' && c <= '9') return c - '0';
      if (c >= 'a' && c <= 'f') return c - 'a' + 10;
      if (c >= 'A' && c <= 'F') return c - 'A' + 10;
      return -1;
    };
    std::string decoded;
    for (std::size_t i = 0; i < uri.size(); ++i) {
      if (uri[i] != '%') {
        decoded.push_back(uri[i]);
        continue;
      }
      const int high = i + 1 < uri.size() ? digit(uri[i + 1]) : -1;
      const int low = i + 2 < uri.size() ? digit(uri[i + 2]) : -1;
      if (high < 0 || low < 0) refuse(path + "/uri: '" + printable(uri) + "' has a broken percent code");
      decoded.push_back(static_cast<char>(16 * high + low));
      i += 2;
    }
    return decoded;
  }

  [[noreturn]] void refuse_outside(const std::string& path, const std::string& uri) const {
    refuse(path + "/uri: '" + printable(uri) +
           "' is outside the asset directory; hint: put the buffer beside the file, or export as .glb");
  }

  /// Reads a buffer that lies in the asset's own directory or below, links followed.
  std::string read_external(const std::string& path, const std::string& uri) const {
    namespace fs = std::filesystem;
    const std::string name = percent_decoded(path, uri);
    const std::size_t colon = name.find(':');
    if (colon != std::string::npos && colon < name.find('/')) {
      if (name.rfind("file:", 0) == 0) refuse_outside(path, uri);
      refuse(path + "/uri: '" + printable(uri.substr(0, 200)) +
             "': remote URIs are not supported; hint: download the buffer and put it beside the file");
    }
    if (name.empty() || name.find('\\') != std::string::npos || name.find('\0') != std::string::npos ||
        fs::path(name).is_absolute()) {
      refuse_outside(path, uri);
    }
    std::error_code error;
    const fs::path directory = fs::canonical(fs::absolute(file_).parent_path(), error);
    if (error) refuse(path + "/uri: the asset's directory cannot be resolved: " + error.message());
    const fs::path target = fs::weakly_canonical(directory / name, error);
    const fs::path relative = error ? fs::path("..") : target.lexically_relative(directory);
    if (relative.empty() || *relative.begin() == "..") refuse_outside(path, uri);
    if (!fs::exists(target, error)) {
      refuse(path + "/uri: buffer '" + printable(uri) +
             "' is missing; hint: keep it beside the file, or export as "
             ".glb");
    }
    return read_whole(target.string());
  }

  std::string pack(const json& document, std::string_view binary) const {
    std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
    while (text.size() % 4 != 0) text.push_back(' ');
    const std::size_t padding = (4 - binary.size() % 4) % 4;
    std::size_t total = kHeaderBytes + kChunkHeaderBytes + text.size();
    if (!binary.empty()) total += kChunkHeaderBytes + binary.size() + padding;
    if (total > std::numeric_limits<std::uint32_t>::max()) {
      throw LimitError(printable(file_) + ": larger than a GLB can be, got " + std::to_string(total) +
                       " bytes, expected at most 4294967295");
    }
    std::string glb;
    glb.reserve(total);
    glb.append(kMagic);
    append_u32(glb, 2);
    append_u32(glb, static_cast<std::uint32_t>(total));
    append_u32(glb, static_cast<std::uint32_t>(text.size()));
    append_u32(glb, kJsonChunk);
    glb.append(text);
    if (!binary.empty()) {
      append_u32(glb, static_cast<std::uint32_t>(binary.size() + padding));
      append_u32(glb, kBinaryChunk);
      glb.append(binary);
      glb.append(padding, '\0');
    }
    return glb;
  }

  const std::string& file_;
  std::string_view bytes_;
};

}  // namespace

GltfContainer read_gltf_container(const std::string& file, std::string_view bytes) {
  return ContainerReader(file, bytes).run();
}

}  // namespace sinew::assets::detail
