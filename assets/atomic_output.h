#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Outputs that appear whole or not at all: everything is written under another name beside its place,
/// brought to the disk, and renamed.
namespace sinew::assets {

/// What to do where the output exists already.
enum class Overwrite { Refuse, Replace };

/// Writes one file, and the folders above it that are missing. `path` may not exist unless overwriting.
/// Throws BusyError where it exists or another process is writing it, IoError for anything the system refuses
/// (with its words and the path).
void write_file(const std::string& path, std::string_view bytes, Overwrite overwrite);

/// A folder of outputs. Between construction and commit() the files live in a sibling folder
/// `.<name>.partial-<pid>`; the destructor removes it unless commit() was reached, so an exception leaves
/// nothing behind and what was there before stays untouched. What a killed process left is removed by the
/// next one that writes the same output.
class OutputDirectory {
 public:
  /// Tests all that can be tested before the work starts: the parent can be written (it is made where it is
  /// missing, and goes again unless commit() is reached), `path` is no file, nobody else is writing it, and
  /// what it holds may be replaced. An empty folder may always be; any content needs Overwrite::Replace and
  /// must consist of entries named in `own_names` (what a run may have written before): a folder with
  /// anything else is never removed. Throws IoError or BusyError.
  OutputDirectory(const std::string& path, Overwrite overwrite, const std::vector<std::string>& own_names);
  ~OutputDirectory();
  OutputDirectory(const OutputDirectory&) = delete;
  OutputDirectory& operator=(const OutputDirectory&) = delete;

  /// Where to write the file of that name until commit().
  std::string file(const std::string& name) const { return partial_ + "/" + name; }

  /// Writes a whole file into the folder. Throws IoError.
  void write(const std::string& name, std::string_view bytes) const;

  /// Makes all files appear under `path`, in place of what was there. Throws IoError; then nothing changed.
  void commit();

 private:
  std::string shown_;    ///< the path as the user gave it, for messages.
  std::string target_;   ///< absolute.
  std::string partial_;  ///< the sibling, absolute.
  Overwrite overwrite_;
  std::vector<std::string> own_names_;
  std::vector<std::string> made_;  ///< folders above it that were not there.
  int lock_ = -1;                  ///< open and locked for as long as the sibling is ours.
};

}  // namespace sinew::assets
