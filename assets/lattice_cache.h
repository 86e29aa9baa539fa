#pragma once

#include <optional>
#include <string>

#include "lattice/build.h"

/// Built lattices kept for the next run: a folder of files, each named by the hash of everything that made
/// the lattice. What is found there is believed only if its checksum holds.
namespace sinew::assets {

/// 32 hexadecimal digits over skin, weights, joints, every option and the builder itself (its sources, its
/// compiler and CGAL): where any of them changes, so does the key.
std::string lattice_key(const lattice::Surface& skin, const lattice::JointTree& joints,
                        const lattice::BuildOptions& options);

/// The folder for outputs at `output` (a file or a folder): `.sinew-cache` beside it.
std::string cache_folder(const std::string& output);

/// The lattice of that key; nothing where there is none, or where the file is damaged or not readable.
std::optional<lattice::BuildResult> find_lattice(const std::string& folder, const std::string& key,
                                                 const lattice::JointTree& joints);

/// Keeps a lattice, unless it cannot be simulated, and of all of them the sixteen that were stored last.
/// Makes the folder where it is missing. Returns whether it worked: a folder that cannot be written is no
/// failure of the run. To be called when the run has succeeded, so that one that fails leaves nothing behind.
bool keep_lattice(const std::string& folder, const std::string& key, const lattice::BuildResult& result,
                  const lattice::JointTree& joints);

/// What build_lattice did.
enum class CacheUse {
  Off,    ///< no folder was given.
  Hit,    ///< nothing was built.
  Built,  ///< and may be kept.
};

struct CachedBuild {
  lattice::BuildResult result;
  CacheUse use = CacheUse::Off;
  std::string key;  ///< under which keep_lattice may keep it; empty with CacheUse::Off.
};

/// lattice::build, or the same bits from the cache in `folder`; an empty folder switches it off. Writes
/// nothing. Throws what lattice::build throws.
CachedBuild build_lattice(const std::string& folder, const lattice::Surface& skin,
                          const lattice::JointTree& joints, const lattice::BuildOptions& options);

}  // namespace sinew::assets
