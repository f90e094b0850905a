#include "db/engine/sqlite.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace needlelab {
namespace {

/// Replaces open(2) for SQLite's files.
int openWithoutWaiting(const char* path, int flags, int mode) {
  return ::open(path, flags | O_NONBLOCK, static_cast<mode_t>(mode));
}

/// Makes SQLite use openWithoutWaiting(). Returns SQLite's code.
int replaceOpen() {
  if (const int rc = sqlite3_initialize(); rc != SQLITE_OK) return rc;
  // all of the system's VFSs, including those that tests derive from them, share these calls
  sqlite3_vfs* const files = sqlite3_vfs_find("unix");
  if (files == nullptr || files->iVersion < 3 || files->xSetSystemCall == nullptr) return SQLITE_MISUSE;
  return files->xSetSystemCall(files, "open", reinterpret_cast<sqlite3_syscall_ptr>(&openWithoutWaiting));
}

/// The last system error that SQLite recorded for its files, the log's first; else 0.
int fileErrorOf(sqlite3* handle) {
  if (handle == nullptr) return 0;
  int number = 0;
  sqlite3_file* log = nullptr;
  sqlite3_file_control(handle, "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
  if (log != nullptr && log->pMethods != nullptr)
    log->pMethods->xFileControl(log, SQLITE_FCNTL_LAST_ERRNO, &number);
  if (number == 0) sqlite3_file_control(handle, "main", SQLITE_FCNTL_LAST_ERRNO, &number);
  return number;
}

}  // namespace

int openDatabaseFile(const std::string& name, sqlite3** handle, int flags, const char* vfs) {
  static const int replaced = replaceOpen();
  if (replaced != SQLITE_OK) return replaced;
  return sqlite3_open_v2(name.c_str(), handle, flags, vfs);
}

std::string immutableName(const std::filesystem::path& path) {
  std::string name = "file:";
  for (const char c : path.string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                          c == '/' || c == '.' || c == '-' || c == '_';
    name += is_plain ? std::string(1, c) : fmt::format("%{:02x}", byte);
  }
  return name + "?immutable=1";
}

int systemErrorOf(int rc, sqlite3* handle, const std::filesystem::path& path) {
  switch (rc & 0xff) {
    case SQLITE_FULL:
      return ENOSPC;
    case SQLITE_READONLY:
      // SQLite opens a file read-only when it may not write to it
      return ::access(path.c_str(), W_OK) == 0 ? 0 : errno;
    case SQLITE_CORRUPT: {
      // SQLite reports a page that the disk cannot read as corrupt
      const int number = fileErrorOf(handle);
      return number == EIO || number == ENXIO ? EIO : 0;
    }
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN: {
      int number = handle == nullptr ? 0 : sqlite3_system_errno(handle);
      // a failed COMMIT does not set the connection's errno
      if (number == 0) number = fileErrorOf(handle);
      return number == 0 && (rc & 0xff) == SQLITE_IOERR ? EIO : number;
    }
    default:
      return 0;
  }
}

std::uint64_t logBytesOf(sqlite3* handle) {
  sqlite3_file* file = nullptr;
  if (sqlite3_file_control(handle, "main", SQLITE_FCNTL_JOURNAL_POINTER, &file) != SQLITE_OK) return 0;
  sqlite3_int64 size = 0;
  if (file == nullptr || file->pMethods == nullptr || file->pMethods->xFileSize(file, &size) != SQLITE_OK)
    return 0;
  return static_cast<std::uint64_t>(std::max<sqlite3_int64>(size, 0));
}

}  // namespace needlelab
