#include "common/base/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "common/base/disk_words.h"

namespace needlelab {
namespace {

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

// a device or a pipe: a rename would put a file in its place, e.g. of /dev/null
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

}  // namespace

Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes) {
  const auto invalid = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, path.string() + ": " + why};
  };
  // a named pipe that nobody writes would hold up the open, where no Ctrl-C is taken
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
    return invalid("has " + std::to_string(info.st_size) + " bytes, at most " + std::to_string(max_bytes) +
                   " are read");
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

Result<std::filesystem::path> replaceableFile(const std::filesystem::path& path) {
  struct stat info {};
  if (path.empty() || ::stat(path.c_str(), &info) != 0) return path;
  if (!S_ISREG(info.st_mode))
    return Error{ErrorCode::kInvalidInput, path.string() + ": is " +
                                               (S_ISDIR(info.st_mode) ? "a folder" : "no regular file") +
                                               ", a file cannot take its place"};
  struct stat link {};
  if (::lstat(path.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) return path;
  std::error_code nameless;  // as /dev/stdout of a file that was removed meanwhile
  auto end = std::filesystem::canonical(path, nameless);
  if (nameless)
    return Error{ErrorCode::kInvalidInput,
                 path.string() + ": is a link to a file without a name: " + nameless.message()};
  return end;
}

Status writeFileAtomically(const std::filesystem::path& name, ByteView bytes, unsigned mode) {
  if (isStream(name)) return writeToStream(name, bytes);
  const auto replaced = replaceableFile(name);
  if (!replaced.ok()) return replaced.error();
  const std::filesystem::path& path = *replaced;
  std::string temporary = path.string() + ".XXXXXX";
  const int fd = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (fd < 0) return systemError(path, "create a file beside it");
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

}  // namespace needlelab
