#include "tests/powercut/watched_disk.h"

#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>

namespace needlelab::test {
namespace {

using Kind = DiskEvent::Kind;
namespace fs = std::filesystem;

std::atomic<bool> watching = false, faulty = false;

/// The state of the watched folder. Guarded by its mutex; never destroyed, because of calls during exit.
struct World {
  std::mutex mutex;
  DiskLog* log = nullptr;
  std::map<std::pair<dev_t, ino_t>, std::uint32_t> nodes;
  std::uint32_t last_node = kRootNode;
  std::string fault_folder;
  WatchedDisk::Fault fault;
};
World& world() {
  static auto* const one = new World;
  return *one;
}

bool isSharedMemory(std::string_view name) {
  return name.ends_with("-shm");
}

std::string pathOf(int fd) {
  char path[PATH_MAX] = "";
  char link[64];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const long length = ::syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
  return length < 0 ? std::string() : std::string(path, static_cast<std::size_t>(length));
}

std::string pathAt(int folder, const char* name) {
  if (folder == AT_FDCWD || name[0] == '/') return name;
  return pathOf(folder) + "/" + name;
}

// 0: not below the watched folder
std::uint32_t nodeOf(const struct stat& info) {
  const auto found = world().nodes.find({info.st_dev, info.st_ino});
  return found == world().nodes.end() ? 0 : found->second;
}
std::uint32_t nodeOf(int fd) {
  struct stat info {};
  return ::fstat(fd, &info) == 0 ? nodeOf(info) : 0;
}
std::uint32_t nodeOf(const std::string& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 ? nodeOf(info) : 0;
}
std::uint32_t folderOf(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  struct stat info {};
  return ::stat(parent.empty() ? "." : parent.c_str(), &info) == 0 ? nodeOf(info) : 0;
}
std::string nameIn(const std::string& path) {
  const fs::path whole(path);
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

std::uint32_t newNode(const struct stat& info) {
  return world().nodes[{info.st_dev, info.st_ino}] = ++world().last_node;
}

void note(DiskEvent event) {
  world().log->add(std::move(event));
}

[[noreturn]] void unseen(const std::string& path) {
  std::fprintf(stderr, "watched_disk: %s came to be by a call that is not watched\n", path.c_str());
  std::abort();
}

/// Holds the lock during a call while a folder is watched or faults are set.
class Guard {
 public:
  Guard() {
    if (watching || faulty) lock_ = std::unique_lock(world().mutex);
    watched_ = lock_.owns_lock() && watching;
  }
  [[nodiscard]] bool watched() const { return watched_; }
  /// Returns whether the call must fail, with errno set.
  [[nodiscard]] bool fails(DiskCall call, const std::string& path) const {
    const World& w = world();
    if (!lock_.owns_lock() || !w.fault || path.compare(0, w.fault_folder.size(), w.fault_folder) != 0)
      return false;
    const int error = w.fault(call, path);
    if (error != 0) errno = error;
    return error != 0;
  }
  [[nodiscard]] bool fails(DiskCall call, int fd) const {
    return lock_.owns_lock() && world().fault && fails(call, pathOf(fd));
  }

 private:
  std::unique_lock<std::mutex> lock_;
  bool watched_ = false;
};

int openIt(int folder, const char* name, int flags, mode_t mode) {
  const Guard guard;
  const std::string path = pathAt(folder, name);
  struct stat before {};
  const bool there = ::stat(path.c_str(), &before) == 0;
  if ((flags & O_ACCMODE) != O_RDONLY && guard.fails(DiskCall::kOpenToWrite, path)) return -1;
  if ((flags & O_CREAT) != 0 && !there && guard.fails(DiskCall::kCreate, path)) return -1;
  const int fd = static_cast<int>(::syscall(SYS_openat, folder, name, flags | O_LARGEFILE, mode));
  if (fd < 0 || !guard.watched()) return fd;
  const int saved = errno;
  struct stat info {};
  if (!there && (flags & O_CREAT) != 0 && !isSharedMemory(path) && ::fstat(fd, &info) == 0) {
    if (const auto parent = folderOf(path); parent != 0) {
      DiskEvent event{Kind::kCreate, newNode(info), parent};
      event.name = nameIn(path);
      note(std::move(event));
    }
  } else if (there && (flags & O_TRUNC) != 0) {
    if (const auto node = nodeOf(fd); node != 0) note({Kind::kTruncate, node});
  }
  errno = saved;
  return fd;
}

// after a write of `count` bytes that ended at `end`
void noteWrite(int fd, const void* data, std::size_t count, std::uint64_t offset) {
  const auto node = nodeOf(fd);
  if (node == 0) return;
  DiskEvent event{Kind::kWrite, node};
  event.offset = offset;
  event.data.assign(static_cast<const char*>(data), count);
  note(std::move(event));
}

int syncIt(int fd) {
  const Guard guard;
  const bool fails = guard.fails(DiskCall::kSync, fd);
  if (guard.watched()) {
    const int saved = errno;
    if (const auto node = nodeOf(fd); node != 0) note({fails ? Kind::kSyncFailed : Kind::kSync, node});
    errno = saved;
  }
  return fails ? -1 : 0;
}

int removeIt(int folder, const char* name, int flags) {
  const Guard guard;
  const std::string path = pathAt(folder, name);
  struct stat info {};
  const bool known = guard.watched() && ::lstat(path.c_str(), &info) == 0;
  const auto parent = known ? folderOf(path) : 0;
  const long rc = ::syscall(SYS_unlinkat, folder, name, flags);
  if (rc == 0 && parent != 0 && !isSharedMemory(path)) {
    DiskEvent event{Kind::kRemove, nodeOf(info), parent};
    event.name = nameIn(path);
    note(std::move(event));
    if (S_ISDIR(info.st_mode) || info.st_nlink == 1) world().nodes.erase({info.st_dev, info.st_ino});
  }
  return static_cast<int>(rc);
}

int renameIt(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  const Guard guard;
  const std::string from_path = pathAt(from_folder, from), to_path = pathAt(to_folder, to);
  if (guard.fails(DiskCall::kRename, to_path)) return -1;
  const auto parent = guard.watched() ? folderOf(from_path) : 0;
  const auto to_parent = guard.watched() ? folderOf(to_path) : 0;
  const auto node = guard.watched() ? nodeOf(from_path) : 0;
  const long rc = ::syscall(SYS_renameat2, from_folder, from, to_folder, to, flags);
  if (rc == 0 && to_parent != 0) {
    if (node == 0 || parent == 0) unseen(from_path);
    DiskEvent event{Kind::kRename, node, parent, to_parent};
    event.name = nameIn(from_path);
    event.to_name = nameIn(to_path);
    note(std::move(event));
  }
  return static_cast<int>(rc);
}

int mkdirIt(const char* path, mode_t mode) {
  const Guard guard;
  if (guard.fails(DiskCall::kCreate, path)) return -1;
  const long rc = ::syscall(SYS_mkdirat, AT_FDCWD, path, mode);
  struct stat info {};
  if (rc == 0 && guard.watched() && ::lstat(path, &info) == 0) {
    if (const auto parent = folderOf(path); parent != 0) {
      DiskEvent event{Kind::kMkdir, newNode(info), parent};
      event.name = nameIn(path);
      note(std::move(event));
    }
  }
  return static_cast<int>(rc);
}

ssize_t writeIt(int fd, const void* data, std::size_t count) {
  const Guard guard;
  if (guard.fails(DiskCall::kWrite, fd)) return -1;
  const ssize_t wrote = ::syscall(SYS_write, fd, data, count);
  if (wrote > 0 && guard.watched() && nodeOf(fd) != 0) {
    const off_t end = ::lseek(fd, 0, SEEK_CUR);
    noteWrite(fd, data, static_cast<std::size_t>(wrote), static_cast<std::uint64_t>(end - wrote));
  }
  return wrote;
}

ssize_t pwriteIt(int fd, const void* data, std::size_t count, off64_t at) {
  const Guard guard;
  if (guard.fails(DiskCall::kWrite, fd)) return -1;
  const ssize_t wrote = ::syscall(SYS_pwrite64, fd, data, count, at);
  if (wrote > 0 && guard.watched())
    noteWrite(fd, data, static_cast<std::size_t>(wrote), static_cast<std::uint64_t>(at));
  return wrote;
}

int truncateIt(int fd, off64_t size) {
  const Guard guard;
  if (guard.fails(DiskCall::kTruncate, fd)) return -1;
  const long rc = ::syscall(SYS_ftruncate, fd, size);
  if (rc == 0 && guard.watched()) {
    if (const auto node = nodeOf(fd); node != 0) {
      DiskEvent event{Kind::kTruncate, node};
      event.offset = static_cast<std::uint64_t>(size);
      note(std::move(event));
    }
  }
  return static_cast<int>(rc);
}

int makeTemporary(char* name, int flags) {
  const std::size_t length = std::strlen(name);
  static std::atomic<unsigned> counter = 0;
  for (int tries = 0; tries < 1000; ++tries) {
    std::snprintf(name + length - 6, 7, "%06x",
                  (counter++ + static_cast<unsigned>(::getpid()) * 64) & 0xFFFFFFu);
    const int fd = openIt(AT_FDCWD, name, O_RDWR | O_CREAT | O_EXCL | flags, 0600);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
  return -1;
}

// logs the initial content
void takeIn(const fs::path& folder, std::uint32_t node) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    struct stat info {};
    if (isSharedMemory(name) || ::lstat(entry.path().c_str(), &info) != 0) continue;
    DiskEvent event{entry.is_directory() ? Kind::kFolder : Kind::kFile, newNode(info), node};
    event.name = name;
    if (!entry.is_directory()) {
      std::ifstream file(entry.path(), std::ios::binary);
      std::stringstream text;
      text << file.rdbuf();
      event.data = text.str();
    }
    const std::uint32_t made = event.node;
    note(std::move(event));
    if (entry.is_directory()) takeIn(entry.path(), made);
  }
}

}  // namespace

void WatchedDisk::watch(const fs::path& folder, DiskLog& log) {
  const std::scoped_lock lock(world().mutex);
  World& w = world();
  w.log = &log;
  w.nodes.clear();
  w.last_node = kRootNode;
  struct stat info {};
  if (::stat(folder.c_str(), &info) != 0) unseen(folder);
  w.nodes[{info.st_dev, info.st_ino}] = kRootNode;
  takeIn(folder, kRootNode);
  watching = true;
}

void WatchedDisk::stop() {
  const std::scoped_lock lock(world().mutex);
  watching = false;
}

void WatchedDisk::setFault(const fs::path& folder, Fault fault) {
  const std::scoped_lock lock(world().mutex);
  faulty = static_cast<bool>(fault);
  world().fault_folder = folder.string();
  world().fault = std::move(fault);
}

}  // namespace needlelab::test

// replace libc's functions for everything in this program and its libraries
using namespace needlelab::test;  // NOLINT(google-build-using-namespace)
extern "C" {

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return openIt(AT_FDCWD, path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return openIt(AT_FDCWD, path, flags, mode);
}
int openat(int folder, const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return openIt(folder, path, flags, mode);
}
int openat64(int folder, const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return openIt(folder, path, flags, mode);
}
int mkostemp(char* name, int flags) {
  return makeTemporary(name, flags);
}
int mkostemp64(char* name, int flags) {
  return makeTemporary(name, flags);
}
int mkstemp(char* name) {
  return makeTemporary(name, 0);
}
int mkstemp64(char* name) {
  return makeTemporary(name, 0);
}
ssize_t write(int fd, const void* data, size_t count) {
  return writeIt(fd, data, count);
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
  const Guard guard;
  if (guard.fails(DiskCall::kWrite, fd)) return -1;
  const ssize_t wrote = ::syscall(SYS_writev, fd, parts, count);
  if (wrote > 0 && guard.watched() && nodeOf(fd) != 0) {
    std::string all;
    for (int i = 0; i < count; ++i) all.append(static_cast<const char*>(parts[i].iov_base), parts[i].iov_len);
    const off_t end = ::lseek(fd, 0, SEEK_CUR);
    noteWrite(fd, all.data(), static_cast<std::size_t>(wrote), static_cast<std::uint64_t>(end - wrote));
  }
  return wrote;
}
ssize_t pwrite(int fd, const void* data, size_t count, off_t at) {
  return pwriteIt(fd, data, count, at);
}
ssize_t pwrite64(int fd, const void* data, size_t count, off64_t at) {
  return pwriteIt(fd, data, count, at);
}
ssize_t pread(int fd, void* data, size_t count, off_t at) {
  if (const Guard guard; guard.fails(DiskCall::kRead, fd)) return -1;
  return ::syscall(SYS_pread64, fd, data, count, at);
}
ssize_t pread64(int fd, void* data, size_t count, off64_t at) {
  if (const Guard guard; guard.fails(DiskCall::kRead, fd)) return -1;
  return ::syscall(SYS_pread64, fd, data, count, at);
}
// copying then uses write(), which is logged
ssize_t sendfile(int, int, off_t*, size_t) noexcept {
  errno = EINVAL;
  return -1;
}
ssize_t sendfile64(int, int, off64_t*, size_t) noexcept {
  errno = EINVAL;
  return -1;
}
int ftruncate(int fd, off_t size) noexcept {
  return truncateIt(fd, size);
}
int ftruncate64(int fd, off64_t size) noexcept {
  return truncateIt(fd, size);
}
int fsync(int fd) {
  return syncIt(fd);
}
int fdatasync(int fd) {
  return syncIt(fd);
}
int rename(const char* from, const char* to) noexcept {
  return renameIt(AT_FDCWD, from, AT_FDCWD, to, 0);
}
int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  return renameIt(from_folder, from, to_folder, to, 0);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  return renameIt(from_folder, from, to_folder, to, flags);
}
int link(const char* from, const char* to) noexcept {
  const Guard guard;
  if (guard.fails(DiskCall::kCreate, to)) return -1;
  const long rc = ::syscall(SYS_linkat, AT_FDCWD, from, AT_FDCWD, to, 0);
  if (rc == 0 && guard.watched()) {
    if (const auto parent = folderOf(to); parent != 0) {
      DiskEvent event{Kind::kLink, nodeOf(std::string(from)), 0, parent};
      event.to_name = nameIn(to);
      if (event.node == 0) unseen(from);
      note(std::move(event));
    }
  }
  return static_cast<int>(rc);
}
int unlink(const char* path) noexcept {
  return removeIt(AT_FDCWD, path, 0);
}
int unlinkat(int folder, const char* path, int flags) noexcept {
  return removeIt(folder, path, flags);
}
int rmdir(const char* path) noexcept {
  return removeIt(AT_FDCWD, path, AT_REMOVEDIR);
}
int remove(const char* path) noexcept {
  struct stat info {};
  const bool folder = ::lstat(path, &info) == 0 && S_ISDIR(info.st_mode);
  return removeIt(AT_FDCWD, path, folder ? AT_REMOVEDIR : 0);
}
int mkdir(const char* path, mode_t mode) noexcept {
  return mkdirIt(path, mode);
}

}  // extern "C"
