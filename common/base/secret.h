/// Protects passwords and keys: wipes them from memory, keeps them out of core dumps, and warns when other
/// users may read their file.
#pragma once

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>

namespace needlelab {

/// Overwrites the text, up to its capacity, and makes it empty. The compiler cannot optimise this away.
/// Buffers inside libraries (TLS, Protobuf) are not wiped.
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

/// Disables core dumps of this program: they would hold keys and passwords. A limit of 0 prevents only core
/// files: a `core_pattern` that is a pipe (systemd-coredump, apport) still gets the whole memory. A limit of
/// 1 byte refuses both (Linux, fs/coredump.c: a pipe gets nothing when the limit is 1, "RLIMIT_CORE is set to
/// 1, aborting core"; a file is not written below the format's `min_coredump`, for ELF a page). If the hard
/// limit does not allow 1, the limit becomes 0 and the program is made not dumpable, which hides its
/// /proc/PID/fd and the like from other programs of the same user; otherwise it stays visible in /proc, so
/// that its memory and files can be monitored. To investigate a crash, run the program under a debugger.
inline void keepOutOfCoreDumps() {
  const rlimit one_byte{1, 1};
  if (::setrlimit(RLIMIT_CORE, &one_byte) == 0) return;
  const rlimit none{0, 0};
  static_cast<void>(::setrlimit(RLIMIT_CORE, &none));
  static_cast<void>(::prctl(PR_SET_DUMPABLE, 0, 0, 0, 0));
}

/// Warns on standard error when users other than the owner may read a file that holds a secret.
inline void warnWhenOthersMayRead(const std::filesystem::path& file) {
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || (info.st_mode & 0077) == 0) return;
  std::fprintf(stderr, "warning: %s may be read by others: chmod 600 it\n", file.c_str());
}

}  // namespace needlelab
