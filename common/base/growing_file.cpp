#include "common/base/growing_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "common/base/atomic_file.h"

namespace needlelab {

Result<GrowingFile> GrowingFile::create(const std::filesystem::path& path) {
  const auto replaced = replaceableFile(path);
  if (!replaced.ok()) return replaced.error();
  GrowingFile file;
  file.path_ = *replaced;
  file.temporary_ = file.path_.string() + ".XXXXXX";
  file.fd_ = ::mkostemp(file.temporary_.data(), O_CLOEXEC);
  if (file.fd_ < 0) {
    const Error error = file.systemError("create a file beside it");
    // a folder that is not there is the caller's mistake
    if (errno == ENOENT || errno == ENOTDIR) return Error{ErrorCode::kInvalidInput, error.message};
    return error;
  }
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
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return systemError("write");
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return {};
}

Status GrowingFile::finish() {
  if (::fchmod(fd_, 0644) != 0) return systemError("set permissions");
  if (::fsync(fd_) != 0) return systemError("fsync");
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) return systemError("rename into place");
  ::close(std::exchange(fd_, -1));
  return syncFolder(path_.parent_path());
}

Error GrowingFile::systemError(const std::string& what) const {
  return {ErrorCode::kFailed, path_.string() + ": cannot " + what + ": " + std::strerror(errno)};
}

}  // namespace needlelab
