/// A file descriptor, closed on destruction; for files read or written in pieces and fsynced.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

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
