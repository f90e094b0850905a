#include "base/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace needlelab {
namespace {

Error systemError(const std::string& what, const std::filesystem::path& path) {
  return {ErrorCode::kFailed, path.string() + ": cannot " + what + ": " + std::strerror(errno)};
}

}  // namespace

Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes) {
  const auto invalid = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, path.string() + ": " + why};
  };
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
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
  if (fd < 0) return systemError("open folder", name);
  const int rc = ::fsync(fd);
  const int saved = errno;
  ::close(fd);
  errno = saved;
  if (rc != 0) return systemError("fsync folder", name);
  return {};
}

Status writeFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode) {
  std::string temporary = path.string() + ".XXXXXX";
  const int fd = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (fd < 0) return systemError("create a file beside it", path);
  const auto fail = [&](const std::string& what) -> Status {
    const Error error = systemError(what, path);
    ::close(fd);
    ::unlink(temporary.c_str());
    return error;
  };
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return fail("write");
    done += static_cast<std::size_t>(n);
  }
  if (::fchmod(fd, mode) != 0) return fail("set permissions");
  if (::fsync(fd) != 0) return fail("fsync");
  if (::rename(temporary.c_str(), path.c_str()) != 0) return fail("rename into place");
  ::close(fd);
  return syncFolder(path.parent_path());
}

}  // namespace needlelab
