#include "db/store/open_file.h"

#include <fcntl.h>

#include <cerrno>

#include "common/base/files/files.h"

namespace needlelab {

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
