/// Passwords and keys in a program's memory and files: wiped where they were held, kept out of core dumps,
/// and a word when others may read their file.
#pragma once

#include <sys/resource.h>
#include <sys/stat.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>

namespace needlelab {

/// Overwrites the text, up to its capacity, and makes it empty. The compiler does not leave it out. Libraries
/// (TLS, Protobuf) keep buffers of their own, which this does not reach.
inline void wipe(std::string& secret) {
  secret.resize(secret.capacity());
  ::explicit_bzero(secret.data(), secret.size());
  secret.clear();
}

/// Wipes a text when it goes out of scope. Owns nothing: the text must live longer.
class WipeAtEnd {
 public:
  explicit WipeAtEnd(std::string& secret) : secret_(secret) {}
  ~WipeAtEnd() { wipe(secret_); }
  WipeAtEnd(const WipeAtEnd&) = delete;
  WipeAtEnd& operator=(const WipeAtEnd&) = delete;

 private:
  std::string& secret_;
};

/// No core dump of this program: it would hold keys and passwords. The program stays visible in /proc, so
/// that its memory and files can be watched; systemd-coredump and the kernel both respect the limit. Who
/// looks for a fault runs it under a debugger.
inline void keepOutOfCoreDumps() {
  const rlimit none{0, 0};
  static_cast<void>(::setrlimit(RLIMIT_CORE, &none));
}

/// Says on standard error when others than the owner may read a file that holds a secret.
inline void warnWhenOthersMayRead(const std::filesystem::path& file) {
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || (info.st_mode & 0077) == 0) return;
  std::fprintf(stderr, "warning: %s may be read by others: chmod 600 it\n", file.c_str());
}

}  // namespace needlelab
