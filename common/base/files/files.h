/// Reads whole files with a size limit and writes files atomically, so that no reader ever sees half a file.
/// Gives the user advice when a disk fails, and checks a program's outputs before its work begins.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// Reads a whole regular file. Errors: kInvalidInput (missing, not a file, over `max_bytes`); the message
/// names the path.
Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes = 256u << 20);

/// Checks a path before the program opens or replaces its own file there: opening a pipe could wait for ever
/// for the other end. Follows symbolic links. Errors: kInvalidInput when the path exists and is not a regular
/// file.
Status requireFileOrNothing(const std::filesystem::path& path);

/// Returns the file that a rename has to replace so that `path` names the new file: the target of the
/// symbolic links, or `path` itself. Errors: kInvalidInput when `path` is a folder, a pipe, or a device such
/// as /dev/null, which a file must not replace.
Result<std::filesystem::path> replaceableFile(const std::filesystem::path& path);

/// Writes to a temporary file beside `path`, fsyncs it, renames it over `path`, fsyncs the folder.
/// On any error `path` is unchanged and the temporary file is removed. `mode` sets the file's permissions
/// regardless of the umask: by default owner only; use 0644 for public files (a port, a certificate). Writes
/// into a device or pipe (/dev/stdout, /dev/null) instead of replacing it.
Status writeFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode = 0600);

/// Like writeFileAtomically, for a folder in which others may write. A link there is replaced, never
/// followed: it could point to a file that only this program may write. A device or pipe there is an error:
/// writing could wait for a reader for ever.
Status replaceFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode = 0600);

/// A temporary file is named after its file, this mark, and six random letters or digits (mkostemp). The mark
/// is distinctive because a technician's own copy may be called `ca.key.backup`.
inline constexpr std::string_view kTemporaryMark = ".being-written-";

/// Whether `name` names a temporary file of the file `own`; both without a folder.
bool isTemporaryNameOf(std::string_view own, std::string_view name);

/// Makes a folder and its missing parents, each for its owner only (0700) regardless of the umask. Leaves an
/// existing folder unchanged. Returns whether `folder` was made. Errors: kFailed, with the path.
Result<bool> makePrivateFolder(const std::filesystem::path& folder);

/// Calls fsync on a folder, so that a new directory entry survives a power cut.
Status syncFolder(const std::filesystem::path& folder);

/// Writes a file in parts; the file appears under its name only when it is complete. The bytes go to a
/// temporary file beside the path and finish() renames it; without finish() nothing is left. Only the owner
/// may read or write the file (0600). Thread: one.
class GrowingFile {
 public:
  static Result<GrowingFile> create(const std::filesystem::path& path);
  GrowingFile(GrowingFile&& other) noexcept;
  GrowingFile& operator=(GrowingFile&&) = delete;
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;
  ~GrowingFile();

  Status append(ByteView bytes);
  /// The file, for a library that writes it itself.
  [[nodiscard]] const std::string& temporary() const { return temporary_; }
  /// Calls fsync on the file, renames it, and calls fsync on the folder.
  Status finish();

 private:
  GrowingFile() = default;
  Error systemError(const std::string& what) const;
  std::filesystem::path path_;
  std::string temporary_;
  int fd_ = -1;
};

/// Returns advice for the user about a failing disk, from the errno of a failed call on `path`: the disk, its
/// free space, and the remedy. The text is appended to an error message and begins with "; ". Empty when
/// errno does not concern the disk. Thread: any.
std::string diskAdvice(int error_number, const std::filesystem::path& path);

/// Returns an error `PATH: cannot WHAT: ` with the text of errno and the advice. Call it before anything else
/// can set errno.
Error systemError(const std::filesystem::path& path, const std::string& what);

/// A file named on the command line: the option, as the user wrote it, and its value.
struct NamedFile {
  std::string option;          ///< e.g. "--json"
  std::filesystem::path path;  ///< empty: not requested, or standard output
};

/// Checks that each output can be written to its path and overwrites neither an input nor another output.
/// Writes nothing. Errors (kInvalidInput) name option, file and reason: the path is a folder; its folder does
/// not exist or is not writable; it is the same file as an input or another output, even under another name.
Status checkOutputs(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);

/// Checks that a user's new file does not replace an existing one; a device or pipe such as /dev/stdout may
/// exist. Errors: kInvalidInput; the message names the option --replace.
Status requireNewFile(const NamedFile& output, bool replace);

// --- files read or written in pieces and fsynced

class OpenFile {
 public:
  /// The result of open(2), including −1.
  explicit OpenFile(int fd) : fd_(fd) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (isOpen()) ::close(fd_);
  }
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] bool isOpen() const { return fd_ >= 0; }

 private:
  int fd_;
};

/// Fills `bytes`, or less at the end of the file. Returns the count. `path`: for messages.
Result<std::size_t> readFully(const OpenFile& file, const std::filesystem::path& path, std::uint8_t* bytes,
                              std::size_t count);
Status writeFully(const OpenFile& file, const std::filesystem::path& path, ByteView bytes);
/// Calls fsync on a file that others wrote.
Status syncFile(const std::filesystem::path& path);

}  // namespace needlelab
