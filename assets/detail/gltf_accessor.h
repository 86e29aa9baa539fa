#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tinygltf {
class Model;
}

namespace sinew::assets::detail {

/// Checked access to the accessors of a parsed glTF. Nothing is read that was not first compared with the
/// bytes that are really there.
class GltfAccessors {
 public:
  /// Keeps references: file and model must outlive it.
  GltfAccessors(const std::string& file, const tinygltf::Model& model) : file_(file), model_(model) {}

  /// Compares every view with its buffer and every accessor with its view. Throws InputError.
  void check_all() const;

  /// Number of elements. Throws InputError where there is no such accessor; `user` names who asks
  /// ("/meshes/0/primitives/1/attributes/POSITION").
  std::size_t count(int accessor, const std::string& user) const;

  /// All elements, component after component, as numbers: normalised integers as glTF 2.0 section 3.11 has
  /// them, sparse values filled in. `type` is what it must be ("VEC3"). Throws InputError.
  std::vector<double> read(int accessor, const std::string& type, const std::string& user) const;

  /// Like read() for SCALAR indices of 8, 16 or 32 bits, each checked to be below `num_vertices`.
  std::vector<std::uint32_t> read_indices(int accessor, std::size_t num_vertices,
                                          const std::string& user) const;

 private:
  void check_view(std::size_t view) const;
  void check_accessor(std::size_t accessor) const;
  void check_sparse(std::size_t accessor) const;
  /// Compares `count` elements of `bytes_each`, `stride` apart, from `offset` on, with a view.
  void check_fits(const std::string& thing, int view, std::uint64_t offset, std::uint64_t stride,
                  std::uint64_t bytes_each, std::uint64_t count) const;
  const unsigned char* bytes_of(int view, std::uint64_t offset) const;

  const std::string& file_;
  const tinygltf::Model& model_;
};

}  // namespace sinew::assets::detail
