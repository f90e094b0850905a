// Only in the server under test: a VFS in front of SQLite's own. It reports in a shared page whether a commit
// or a checkpoint is running, and kills its own process (kill -9) at the requested operation.
// NEEDLELAB_CRASH_PAGE names the page's file; without it nothing changes.
#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace needlelab::test {
namespace {

/// The shared page, a file mapped into memory: the server's phase, and the operation at which it must die.
/// Little-endian words; harness/crash_page.py reads and writes the same. The harness arms `die_in` before the
/// server starts or while it runs; only the server writes the others.
struct CrashPage {
  std::atomic<std::uint64_t> phase;        ///< current phase, a CrashPhase
  std::atomic<std::uint64_t> commits;      ///< syncs of the log outside of checkpoints
  std::atomic<std::uint64_t> checkpoints;  ///< started checkpoints
  std::atomic<std::uint64_t> operations;   ///< writes and syncs in the armed phase since it was armed
  std::atomic<std::uint64_t> die_in;       ///< a CrashPhase; 0: do not die
  std::atomic<std::uint64_t> die_at;       ///< before this operation of that phase, counted from 1
  std::atomic<std::uint64_t> hold_ms;      ///< first hang there for this long
};

enum CrashPhase : std::uint64_t { kElsewhere = 0, kInCommit = 1, kInCheckpoint = 2 };

CrashPage* page = nullptr;
sqlite3_vfs* system_vfs = nullptr;
sqlite3_vfs ours;
// of the writer's thread, the only one that writes
bool checkpointing = false, log_written = false;

/// After the system's own file, in the same allocation.
struct Behind {
  const sqlite3_io_methods* methods;  // the system's
  bool is_log;
};
Behind& behind(sqlite3_file* file) {
  return *reinterpret_cast<Behind*>(reinterpret_cast<char*>(file) + system_vfs->szOsFile);
}

void before(CrashPhase phase) {
  page->phase = phase;
  if (page->die_in != phase || ++page->operations != page->die_at) return;
  ::usleep(static_cast<useconds_t>(page->hold_ms * 1000));
  ::kill(::getpid(), SIGKILL);
}

int xWrite(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
  const bool log = behind(file).is_log;
  if (log) log_written = true;
  // otherwise a new database's first page, before there is a log
  if (log || checkpointing) before(log ? kInCommit : kInCheckpoint);
  return behind(file).methods->xWrite(file, from, size, offset);
}

int xSync(sqlite3_file* file, int flags) {
  // a log without writes since its last sync is synced by a checkpoint before the checkpoint is announced
  const bool commit = behind(file).is_log && log_written;
  before(commit ? kInCommit : kInCheckpoint);
  const int rc = behind(file).methods->xSync(file, flags);
  if (commit) {
    log_written = false;
    ++page->commits;
  }
  // a checkpoint lasts until SQLite says that it is done
  if (commit || (!behind(file).is_log && !checkpointing)) page->phase = kElsewhere;
  return rc;
}

int xFileControl(sqlite3_file* file, int op, void* arg) {
  if (op == SQLITE_FCNTL_CKPT_START) {
    checkpointing = true;
    ++page->checkpoints;
  } else if (op == SQLITE_FCNTL_CKPT_DONE) {
    checkpointing = false;
    page->phase = kElsewhere;
  }
  return behind(file).methods->xFileControl(file, op, arg);
}

int xOpen(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out) {
  const int rc = system_vfs->xOpen(system_vfs, name, file, flags, out);
  if (rc != SQLITE_OK || (flags & (SQLITE_OPEN_WAL | SQLITE_OPEN_MAIN_DB)) == 0) return rc;
  // backups are not killed here
  const std::string_view path = name == nullptr ? "" : name;
  if (!path.ends_with("needlelab.db") && !path.ends_with("needlelab.db-wal")) return rc;
  // the system's methods differ between a log and a database
  static sqlite3_io_methods both[2];
  sqlite3_io_methods& methods = both[(flags & SQLITE_OPEN_WAL) != 0 ? 1 : 0];
  behind(file) = {file->pMethods, (flags & SQLITE_OPEN_WAL) != 0};
  methods = *file->pMethods;
  methods.xWrite = xWrite;
  methods.xSync = xSync;
  methods.xFileControl = xFileControl;
  file->pMethods = &methods;
  return rc;
}

/// Before main(), and therefore before the first connection.
const bool registered = [] {
  const char* path = std::getenv("NEEDLELAB_CRASH_PAGE");
  if (path == nullptr) return false;
  const int fd = ::open(path, O_RDWR | O_CLOEXEC);
  void* mapped =
      fd < 0 ? MAP_FAILED : ::mmap(nullptr, sizeof(CrashPage), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (mapped == MAP_FAILED) {
    std::perror(path);
    std::abort();
  }
  page = static_cast<CrashPage*>(mapped);
  system_vfs = sqlite3_vfs_find(nullptr);
  ours = *system_vfs;
  ours.pNext = nullptr;
  ours.zName = "needlelab-crash";
  ours.szOsFile = system_vfs->szOsFile + static_cast<int>(sizeof(Behind));
  ours.xOpen = xOpen;
  return sqlite3_vfs_register(&ours, 1) == SQLITE_OK;
}();

}  // namespace
}  // namespace needlelab::test
