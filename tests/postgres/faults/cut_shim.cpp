// A disk below PostgreSQL that may lose unsynced data: preloaded (LD_PRELOAD) into all its processes.
//
// Before each write to a regular file it appends to NEEDLELAB_CUT_LOG the data about to be replaced; each
// sync is logged instead of executed. After the processes have been killed, power_cuts.py undoes any part of
// what was written after a file's last sync. Files are identified by their inode, because one process writes
// a file and another one syncs it. Names (new, renamed, removed files) are on the disk at once, and so is
// stdio output. All processes share the log's lock: its order is that of the calls.
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

/// Read by power_cuts.py; `length` bytes follow.
struct Record {
  std::uint64_t
      kind;  ///< 'W': the old `length` bytes at `offset`, and the old file size; 'S': synced; 'D': deleted
  std::uint64_t inode, offset, size, length;
};

/// In a file mapped by all processes.
struct Shared {
  pthread_mutex_t mutex;
};

int log_fd = -1;
Shared* shared = nullptr;

[[noreturn]] void fail(const char* what) {
  std::perror(what);
  std::abort();
}

__attribute__((constructor)) void openLog() {
  const char* path = std::getenv("NEEDLELAB_CUT_LOG");
  if (path == nullptr) return;
  const std::string lock_path = std::string(path) + ".lock";
  // the first process creates the lock before it starts the others
  const int made = ::open(lock_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const int fd = made >= 0 ? made : ::open(lock_path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0 || (made >= 0 && ::syscall(SYS_ftruncate, fd, sizeof(Shared)) != 0)) fail(lock_path.c_str());
  void* const mapped = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (mapped == MAP_FAILED) fail(lock_path.c_str());
  shared = static_cast<Shared*>(mapped);
  if (made >= 0) {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    pthread_mutex_init(&shared->mutex, &attributes);
  }
  ::close(fd);
  log_fd = ::open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (log_fd < 0) fail(path);
}

/// Blocks signals while the lock is held: a handler that ends the process, or writes, would deadlock.
class Locked {
 public:
  Locked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
    if (pthread_mutex_lock(&shared->mutex) == EOWNERDEAD) pthread_mutex_consistent(&shared->mutex);
  }
  ~Locked() {
    const int kept = errno;
    pthread_mutex_unlock(&shared->mutex);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    errno = kept;
  }
  Locked(const Locked&) = delete;
  Locked& operator=(const Locked&) = delete;

 private:
  sigset_t before_{};
};

void append(const Record& record, const std::string& bytes = {}) {
  std::string all(reinterpret_cast<const char*>(&record), sizeof record);
  all += bytes;
  if (::syscall(SYS_write, log_fd, all.data(), all.size()) != static_cast<long>(all.size()))
    fail("the log of cuts");
}

/// A regular file's state; false: something else, which is passed through.
bool isFile(int fd, struct stat& found) {
  return log_fd >= 0 && fd > STDERR_FILENO && ::fstat(fd, &found) == 0 && S_ISREG(found.st_mode);
}

/// Logs the content of [offset, offset + count) before it changes or is cut off. `path`: for a file that is
/// not open for reading. Call with the lock.
void noteOld(const std::string& path, const struct stat& found, std::uint64_t offset, std::uint64_t count) {
  const auto size = static_cast<std::uint64_t>(found.st_size);
  std::string old(offset < size ? std::min(count, size - offset) : 0, '\0');
  if (!old.empty()) {
    const int fd = static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path.c_str(), O_RDONLY | O_CLOEXEC));
    std::size_t done = 0;
    while (fd >= 0 && done < old.size()) {
      const ssize_t got =
          ::pread(fd, old.data() + done, old.size() - done, static_cast<off_t>(offset + done));
      if (got <= 0) break;
      done += static_cast<std::size_t>(got);
    }
    if (done != old.size()) fail(path.c_str());
    ::close(fd);
  }
  append({'W', found.st_ino, offset, size, old.size()}, old);
}

std::string pathOf(int fd) {
  return "/proc/self/fd/" + std::to_string(fd);
}

void noteGone(const char* path) {
  struct stat found {};
  if (::lstat(path, &found) == 0 && S_ISREG(found.st_mode) && found.st_nlink == 1)
    append({'D', found.st_ino, 0, 0, 0});
}

std::uint64_t lengthOf(const iovec* parts, int count) {
  std::uint64_t length = 0;
  for (int i = 0; i < count; ++i) length += parts[i].iov_len;
  return length;
}

int noteSync(int fd, long call) {
  struct stat found {};
  if (!isFile(fd, found)) return static_cast<int>(::syscall(call, fd));
  const Locked locked;
  append({'S', found.st_ino, 0, 0, 0});
  return 0;
}

}  // namespace

extern "C" {

ssize_t pwrite(int fd, const void* data, size_t count, off_t offset) {
  struct stat found {};
  if (!isFile(fd, found)) return ::syscall(SYS_pwrite64, fd, data, count, offset);
  const Locked locked;
  ::fstat(fd, &found);
  noteOld(pathOf(fd), found, static_cast<std::uint64_t>(offset), count);
  return ::syscall(SYS_pwrite64, fd, data, count, offset);
}

ssize_t pwritev(int fd, const iovec* parts, int count, off_t offset) {
  struct stat found {};
  const auto call = [&] { return ::syscall(SYS_pwritev, fd, parts, count, offset, 0L); };
  if (!isFile(fd, found)) return call();
  const Locked locked;
  ::fstat(fd, &found);
  noteOld(pathOf(fd), found, static_cast<std::uint64_t>(offset), lengthOf(parts, count));
  return call();
}

ssize_t write(int fd, const void* data, size_t count) {
  struct stat found {};
  if (!isFile(fd, found)) return ::syscall(SYS_write, fd, data, count);
  const Locked locked;
  ::fstat(fd, &found);
  const bool appends = (::fcntl(fd, F_GETFL) & O_APPEND) != 0;
  noteOld(pathOf(fd), found, static_cast<std::uint64_t>(appends ? found.st_size : ::lseek(fd, 0, SEEK_CUR)),
          count);
  return ::syscall(SYS_write, fd, data, count);
}

int ftruncate(int fd, off_t length) noexcept {
  struct stat found {};
  if (!isFile(fd, found)) return static_cast<int>(::syscall(SYS_ftruncate, fd, length));
  const Locked locked;
  ::fstat(fd, &found);
  noteOld(pathOf(fd), found, static_cast<std::uint64_t>(length), UINT64_MAX);
  return static_cast<int>(::syscall(SYS_ftruncate, fd, length));
}

int truncate(const char* path, off_t length) noexcept {
  struct stat found {};
  if (log_fd < 0 || ::stat(path, &found) != 0) return static_cast<int>(::syscall(SYS_truncate, path, length));
  const Locked locked;
  ::stat(path, &found);
  noteOld(path, found, static_cast<std::uint64_t>(length), UINT64_MAX);
  return static_cast<int>(::syscall(SYS_truncate, path, length));
}

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & (O_CREAT | O_TMPFILE)) != 0) {
    va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  const auto call = [&] { return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode)); };
  struct stat found {};
  if (log_fd < 0 || (flags & O_TRUNC) == 0 || ::stat(path, &found) != 0 || !S_ISREG(found.st_mode))
    return call();
  const Locked locked;
  noteOld(path, found, 0, UINT64_MAX);
  return call();
}

int fsync(int fd) {
  return noteSync(fd, SYS_fsync);
}
int fdatasync(int fd) {
  return noteSync(fd, SYS_fdatasync);
}

int unlink(const char* path) noexcept {
  if (log_fd < 0) return static_cast<int>(::syscall(SYS_unlink, path));
  const Locked locked;
  noteGone(path);
  return static_cast<int>(::syscall(SYS_unlink, path));
}

int rename(const char* from, const char* to) noexcept {
  if (log_fd < 0) return static_cast<int>(::syscall(SYS_rename, from, to));
  const Locked locked;
  noteGone(to);
  return static_cast<int>(::syscall(SYS_rename, from, to));
}

}  // extern "C"
