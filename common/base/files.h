/// Whole files and streams to the disk: read with a size limit, written so that nobody ever sees half of one,
/// with advice for a person when a disk refuses; and a check of a program's outputs before its work begins.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// Reads a whole regular file. Errors: kInvalidInput (missing, not a file, over `max_bytes`), the path in the
/// message.
Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes = 256u << 20);

/// The file that a rename has to replace so that `path` names the new one: the end of symbolic links, or
/// `path` itself. Errors: kInvalidInput when something stands there that no file may take the place of: a
/// folder, a device such as /dev/null, a pipe.
Result<std::filesystem::path> replaceableFile(const std::filesystem::path& path);

/// Writes to a temporary file beside `path`, fsyncs it, renames it over `path`, fsyncs the folder.
/// On any error `path` is as it was and the temporary is gone. `mode` is the file's permission, e.g. 0600 for
/// keys. A device or pipe (/dev/stdout, /dev/null) is written to, not replaced.
Status writeFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode = 0644);

/// fsync of a folder, so that a new directory entry survives a power cut.
Status syncFolder(const std::filesystem::path& folder);

/// A file that is written in parts and appears under its name only when it is whole.
/// Written beside its path, renamed by finish(); without finish() nothing is left. Thread: one.
class GrowingFile {
 public:
  static Result<GrowingFile> create(const std::filesystem::path& path);
  GrowingFile(GrowingFile&& other) noexcept;
  GrowingFile& operator=(GrowingFile&&) = delete;
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;
  ~GrowingFile();

  Status append(ByteView bytes);
  /// fsync, rename, fsync of the folder.
  Status finish();

 private:
  GrowingFile() = default;
  Error systemError(const std::string& what) const;
  std::filesystem::path path_;
  std::string temporary_;
  int fd_ = -1;
};

/// What a person should do about a disk that refuses: words to follow an error's message, beginning with ";
/// ", for the errno of a failed call on `path`: which disk it is, how much room it has, what to do. Empty for
/// an errno that says nothing of the disk. Thread: any.
std::string diskAdvice(int error_number, const std::filesystem::path& path);

/// `PATH: cannot WHAT: ` and what errno says, with the advice. Call it before anything else can set errno.
Error systemError(const std::filesystem::path& path, const std::string& what);

/// A file that a command line names: the option, as the user wrote it, and its value.
struct NamedFile {
  std::string option;          ///< e.g. "--json"
  std::filesystem::path path;  ///< empty = not asked for, or standard output
};

/// Whether each output can be written where it is asked for, and would destroy neither an input nor another
/// output. Writes nothing. Errors (kInvalidInput) name option, file and reason: a folder; in a folder that
/// does not exist or cannot be written to; the same file as an input or as another output, by whatever name.
Status checkOutputs(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);

}  // namespace needlelab
