#include "common/base/files/files.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

namespace needlelab {
namespace {

/// Returns the nearest existing parent folder.
std::filesystem::path nearestFolder(const std::filesystem::path& path) {
  std::error_code error;
  auto folder = std::filesystem::absolute(path, error).parent_path();
  while (!std::filesystem::is_directory(folder, error) && folder.has_relative_path())
    folder = folder.parent_path();
  return folder;
}

std::string roomOn(const std::filesystem::path& folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  if (error) return {};
  return fmt::format(" ({} MiB free of {} MiB)", space.available >> 20, space.capacity >> 20);
}

// false: see errno
bool writeAll(int fd, ByteView bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    done += static_cast<std::size_t>(n);
  }
  return true;
}

// a device or a pipe, e.g. /dev/null: a rename would replace it with a file
bool isStream(const std::filesystem::path& path) {
  struct stat info {};
  return ::stat(path.c_str(), &info) == 0 && (S_ISCHR(info.st_mode) || S_ISFIFO(info.st_mode));
}

Status writeToStream(const std::filesystem::path& path, ByteView bytes) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) return systemError(path, "open");
  const bool written = writeAll(fd, bytes);
  const Error error = systemError(path, "write");
  ::close(fd);
  if (!written) return error;
  return {};
}

namespace fs = std::filesystem;

Error refusal(const NamedFile& output, const std::string& why) {
  return {ErrorCode::kInvalidInput, output.option + " " + output.path.string() + ": " + why};
}

Error noPlaceForAFile(const fs::path& path, const struct stat& info) {
  return {ErrorCode::kInvalidInput, path.string() + ": is " +
                                        (S_ISDIR(info.st_mode) ? "a folder" : "no regular file") +
                                        ", a file cannot take its place"};
}

fs::path folderOf(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

// compares existing files by identity (links), and new files by path
bool isSameFile(const fs::path& a, const fs::path& b) {
  std::error_code unknown;
  if (fs::equivalent(a, b, unknown)) return true;
  return a.filename() == b.filename() && fs::equivalent(folderOf(a), folderOf(b), unknown);
}

}  // namespace

std::string diskAdvice(int error_number, const std::filesystem::path& path) {
  const auto folder = nearestFolder(path);
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return "; the disk of " + folder.string() + " is full" + roomOn(folder) +
             ": make room on it, then start again";
    case EROFS:
      return "; the disk of " + folder.string() +
             " is read-only: see why (dmesg tells when a failing disk was made so), mount it for writing, "
             "then "
             "start again";
    case EIO:
      return "; the disk of " + folder.string() +
             " fails: see dmesg and smartctl, move the folder to a good disk or restore a backup, then start "
             "again";
    default:
      return {};
  }
}

Error systemError(const std::filesystem::path& path, const std::string& what) {
  const int number = errno;
  return {ErrorCode::kFailed,
          path.string() + ": cannot " + what + ": " + std::strerror(number) + diskAdvice(number, path)};
}

Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes) {
  const auto invalid = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, path.string() + ": " + why};
  };
  // opening a named pipe without a writer would block, and Ctrl-C is not handled there
  const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) return invalid(std::string("cannot open: ") + std::strerror(errno));
  struct stat info {};
  std::string text;
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    ::close(fd);
    return invalid("is not a regular file");
  }
  if (static_cast<std::uintmax_t>(info.st_size) > max_bytes) {
    ::close(fd);
    return invalid(fmt::format("has {} bytes, at most {} are read", info.st_size, max_bytes));
  }
  text.resize(static_cast<std::size_t>(info.st_size));
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::read(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const std::string why = std::strerror(errno);
      ::close(fd);
      return invalid("cannot read: " + why);
    }
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  ::close(fd);
  text.resize(done);
  return text;
}

bool isTemporaryNameOf(std::string_view own, std::string_view name) {
  constexpr std::size_t kLetters = 6;
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  return name.size() == own.size() + kTemporaryMark.size() + kLetters && name.starts_with(own) &&
         name.substr(own.size()).starts_with(kTemporaryMark) &&
         std::all_of(name.end() - kLetters, name.end(), fits);
}

Result<bool> makePrivateFolder(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (std::filesystem::is_directory(folder, ignored)) return false;
  // "a/b/" is the same as "a/b"
  const std::filesystem::path whole = folder.has_filename() ? folder : folder.parent_path();
  if (const auto above = whole.parent_path(); !above.empty() && above != whole)
    RETURN_IF_ERROR(makePrivateFolder(above));
  if (::mkdir(whole.c_str(), 0700) != 0) {
    const int why = errno;
    // "a/.", or another program has just made it
    if (why == EEXIST && std::filesystem::is_directory(whole, ignored)) return false;
    errno = why;
    return systemError(whole, "make the folder");
  }
  return true;
}

Status syncFolder(const std::filesystem::path& folder) {
  const std::filesystem::path name = folder.empty() ? std::filesystem::path(".") : folder;
  const int fd = ::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return systemError(name, "open folder");
  const int rc = ::fsync(fd);
  const int saved = errno;
  ::close(fd);
  errno = saved;
  if (rc != 0) return systemError(name, "fsync folder");
  return {};
}

Status requireFileOrNothing(const std::filesystem::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0 || S_ISREG(info.st_mode)) return {};
  const char* const what = S_ISFIFO(info.st_mode)   ? "a pipe"
                           : S_ISSOCK(info.st_mode) ? "a socket"
                           : S_ISDIR(info.st_mode)  ? "a folder"
                                                    : "a device";
  return Error{ErrorCode::kInvalidInput,
               path.string() + ": is " + what +
                   ", where needlelab keeps a file: find out who put it there, and move it away"};
}

Result<std::filesystem::path> replaceableFile(const std::filesystem::path& path) {
  struct stat info {};
  if (path.empty() || ::stat(path.c_str(), &info) != 0) return path;
  if (!S_ISREG(info.st_mode)) return noPlaceForAFile(path, info);
  struct stat link {};
  if (::lstat(path.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) return path;
  std::error_code nameless;  // e.g. /dev/stdout when its file has been removed
  auto end = std::filesystem::canonical(path, nameless);
  if (nameless)
    return Error{ErrorCode::kInvalidInput,
                 path.string() + ": is a link to a file without a name: " + nameless.message()};
  return end;
}

namespace {

/// The error for a temporary file that could not be created, from errno: a missing folder is the caller's
/// mistake.
Error cannotCreate(const std::filesystem::path& path) {
  const bool no_folder = errno == ENOENT || errno == ENOTDIR;
  const Error error = systemError(path, "create a file beside it");
  return no_folder ? Error{ErrorCode::kInvalidInput, error.message} : error;
}

/// Replaces anything that is at `path`, even a link.
Status renameInto(const std::filesystem::path& path, ByteView bytes, unsigned mode) {
  std::string temporary = path.string() + std::string(kTemporaryMark) + "XXXXXX";
  const int fd = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (fd < 0) return cannotCreate(path);
  const auto fail = [&](const std::string& what) -> Status {
    const Error error = systemError(path, what);
    ::close(fd);
    ::unlink(temporary.c_str());
    return error;
  };
  if (!writeAll(fd, bytes)) return fail("write");
  if (::fchmod(fd, mode) != 0) return fail("set permissions");
  if (::fsync(fd) != 0) return fail("fsync");
  if (::rename(temporary.c_str(), path.c_str()) != 0) return fail("rename into place");
  ::close(fd);
  return syncFolder(path.parent_path());
}

}  // namespace

Status writeFileAtomically(const std::filesystem::path& name, ByteView bytes, unsigned mode) {
  if (isStream(name)) return writeToStream(name, bytes);
  ASSIGN_OR_RETURN(const std::filesystem::path path, replaceableFile(name));
  return renameInto(path, bytes, mode);
}

Status replaceFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode) && !S_ISLNK(info.st_mode))
    return noPlaceForAFile(path, info);
  return renameInto(path, bytes, mode);
}

Result<GrowingFile> GrowingFile::create(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const auto replaced, replaceableFile(path));
  GrowingFile file;
  file.path_ = replaced;
  file.temporary_ = file.path_.string() + std::string(kTemporaryMark) + "XXXXXX";
  file.fd_ = ::mkostemp(file.temporary_.data(), O_CLOEXEC);
  if (file.fd_ < 0) return cannotCreate(file.path_);
  return file;
}

GrowingFile::GrowingFile(GrowingFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      fd_(std::exchange(other.fd_, -1)) {}

GrowingFile::~GrowingFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

Status GrowingFile::append(ByteView bytes) {
  if (!writeAll(fd_, bytes)) return systemError("write");
  return {};
}

Status GrowingFile::finish() {
  if (::fchmod(fd_, 0600) != 0) return systemError("set permissions");
  if (::fsync(fd_) != 0) return systemError("fsync");
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) return systemError("rename into place");
  ::close(std::exchange(fd_, -1));
  return syncFolder(path_.parent_path());
}

Error GrowingFile::systemError(const std::string& what) const {
  return {ErrorCode::kFailed, path_.string() + ": cannot " + what + ": " + std::strerror(errno)};
}

Status checkOutputs(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const NamedFile& output = outputs[i];
    if (output.path.empty()) continue;
    std::error_code unknown;
    if (fs::is_directory(output.path, unknown))
      return refusal(output, "is a folder; give the name of a file");
    const fs::path folder = folderOf(output.path);
    if (!fs::is_directory(folder, unknown))
      return refusal(output, "there is no folder " + folder.string() + "; make it first");
    if (::access(folder.c_str(), W_OK) != 0 && !fs::exists(output.path, unknown))
      return refusal(output, "the folder " + folder.string() + " cannot be written to");
    for (const NamedFile& input : inputs)
      if (!input.path.empty() && isSameFile(output.path, input.path))
        return refusal(output, "is the same file as the input " + input.path.string() +
                                   ", which would be lost; give another name");
    for (std::size_t k = 0; k < i; ++k)
      if (!outputs[k].path.empty() && isSameFile(output.path, outputs[k].path))
        return refusal(output, "is the same file as that of " + outputs[k].option + "; give another name");
  }
  return {};
}

Status requireNewFile(const NamedFile& output, bool replace) {
  std::error_code unknown;
  if (replace || output.path.empty() || !fs::is_regular_file(output.path, unknown)) return {};
  return refusal(output, "is there already; take another name, or say --replace");
}

Result<std::size_t> readFully(const OpenFile& file, const std::filesystem::path& path, std::uint8_t* bytes,
                              std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::read(file.fd(), bytes + done, count - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return systemError(path, "read");
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

Status writeFully(const OpenFile& file, const std::filesystem::path& path, ByteView bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::write(file.fd(), bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return systemError(path, "write");
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
  return {};
}

Status syncFile(const std::filesystem::path& path) {
  const OpenFile file(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (!file.isOpen()) return systemError(path, "open");
  return ::fsync(file.fd()) == 0 ? Status() : Status(systemError(path, "fsync"));
}

}  // namespace needlelab
