/// A file's descriptor, closed at the end: for what is read and written in pieces and fsynced.
#pragma once

#include <unistd.h>

namespace needlelab {

class OpenFile {
 public:
  /// What open(2) returned, also −1.
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

}  // namespace needlelab
