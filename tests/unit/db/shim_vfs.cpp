#include "tests/unit/db/shim_vfs.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace needlelab::test {
namespace {

/// Our file object, followed by the real file in the same allocation.
struct ShimFile {
  sqlite3_file base;
  sqlite3_file* real;
  std::string* path;  ///< null for nameless temporary files
};

ShimFile* shim(sqlite3_file* file) {
  return reinterpret_cast<ShimFile*>(file);
}
sqlite3_file* real(sqlite3_file* file) {
  return shim(file)->real;
}
sqlite3_vfs* realVfs(sqlite3_vfs* vfs) {
  return static_cast<sqlite3_vfs*>(vfs->pAppData);
}

int xClose(sqlite3_file* file) {
  delete shim(file)->path;
  return real(file)->pMethods->xClose(real(file));
}
int xRead(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
  return real(file)->pMethods->xRead(real(file), to, size, offset);
}
int xWrite(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
  auto& vfs = ShimVfs::instance();
  if (const int rc = vfs.ask(ShimVfs::Op::kWrite, *shim(file)->path, offset, size); rc != SQLITE_OK)
    return rc;
  const int rc = real(file)->pMethods->xWrite(real(file), from, size, offset);
  if (rc == SQLITE_OK) vfs.noteWrite(*shim(file)->path, offset, from, size);
  return rc;
}
int xTruncate(sqlite3_file* file, sqlite3_int64 size) {
  auto& vfs = ShimVfs::instance();
  if (const int rc = vfs.ask(ShimVfs::Op::kTruncate, *shim(file)->path, size, 0); rc != SQLITE_OK) return rc;
  const int rc = real(file)->pMethods->xTruncate(real(file), size);
  if (rc == SQLITE_OK) vfs.noteTruncate(*shim(file)->path, size);
  return rc;
}
int xSync(sqlite3_file* file, int flags) {
  auto& vfs = ShimVfs::instance();
  if (const int rc = vfs.ask(ShimVfs::Op::kSync, *shim(file)->path, 0, 0); rc != SQLITE_OK) return rc;
  // Does not wait for the real disk: our own record determines which bytes survive. This keeps the tests
  // fast.
  (void)flags;
  vfs.noteSync(*shim(file)->path);
  return SQLITE_OK;
}
int xFileSize(sqlite3_file* file, sqlite3_int64* size) {
  return real(file)->pMethods->xFileSize(real(file), size);
}
int xLock(sqlite3_file* file, int kind) {
  return real(file)->pMethods->xLock(real(file), kind);
}
int xUnlock(sqlite3_file* file, int kind) {
  return real(file)->pMethods->xUnlock(real(file), kind);
}
int xCheckReservedLock(sqlite3_file* file, int* out) {
  return real(file)->pMethods->xCheckReservedLock(real(file), out);
}
int xFileControl(sqlite3_file* file, int op, void* arg) {
  return real(file)->pMethods->xFileControl(real(file), op, arg);
}
int xSectorSize(sqlite3_file* file) {
  return real(file)->pMethods->xSectorSize(real(file));
}
/// No promises about the disk: neither atomic sectors nor "power-safe overwrite".
int xDeviceCharacteristics(sqlite3_file*) {
  return 0;
}
int xShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
  return real(file)->pMethods->xShmMap(real(file), page, size, extend, out);
}
int xShmLock(sqlite3_file* file, int offset, int n, int flags) {
  return real(file)->pMethods->xShmLock(real(file), offset, n, flags);
}
void xShmBarrier(sqlite3_file* file) {
  real(file)->pMethods->xShmBarrier(real(file));
}
/// No memory mapping.
int xFetch(sqlite3_file*, sqlite3_int64, int, void** out) {
  *out = nullptr;
  return SQLITE_OK;
}
/// SQLite calls this in a checkpoint between reading the log's header and using it.
int xUnfetch(sqlite3_file* file, sqlite3_int64, void*) {
  return ShimVfs::instance().ask(ShimVfs::Op::kHeaderRead, *shim(file)->path, 0, 0);
}
int xShmUnmap(sqlite3_file* file, int del) {
  return real(file)->pMethods->xShmUnmap(real(file), del);
}

const sqlite3_io_methods kMethods = {3,
                                     xClose,
                                     xRead,
                                     xWrite,
                                     xTruncate,
                                     xSync,
                                     xFileSize,
                                     xLock,
                                     xUnlock,
                                     xCheckReservedLock,
                                     xFileControl,
                                     xSectorSize,
                                     xDeviceCharacteristics,
                                     xShmMap,
                                     xShmLock,
                                     xShmBarrier,
                                     xShmUnmap,
                                     xFetch,
                                     xUnfetch};

int xOpen(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* out) {
  auto* ours = shim(file);
  ours->base.pMethods = nullptr;
  ours->real = reinterpret_cast<sqlite3_file*>(ours + 1);
  const int rc = realVfs(vfs)->xOpen(realVfs(vfs), name, ours->real, flags, out);
  if (rc != SQLITE_OK) return rc;
  ours->path = new std::string(name == nullptr ? "" : name);
  ours->base.pMethods = &kMethods;
  return SQLITE_OK;
}
int xDelete(sqlite3_vfs* vfs, const char* name, int sync_folder) {
  const int rc = realVfs(vfs)->xDelete(realVfs(vfs), name, sync_folder);
  if (rc == SQLITE_OK) ShimVfs::instance().noteDelete(name);
  return rc;
}

}  // namespace

ShimVfs& ShimVfs::instance() {
  static ShimVfs vfs;
  return vfs;
}

ShimVfs::ShimVfs() {
  sqlite3_vfs* system = sqlite3_vfs_find(nullptr);
  static sqlite3_vfs ours;
  ours = *system;  // the other functions are the system's and use none of our data
  ours.pNext = nullptr;
  ours.zName = kName;
  ours.pAppData = system;
  ours.szOsFile = static_cast<int>(sizeof(ShimFile)) + system->szOsFile;
  ours.xOpen = xOpen;
  ours.xDelete = xDelete;
  sqlite3_vfs_register(&ours, 0);
}

void ShimVfs::setHook(Hook hook) {
  const std::lock_guard lock(mutex_);
  hook_ = std::move(hook);
}

int ShimVfs::ask(Op op, const std::string& path, std::int64_t offset, int size) {
  Hook hook;
  {
    const std::lock_guard lock(mutex_);
    hook = hook_;
  }
  return hook ? hook(op, path, offset, size) : SQLITE_OK;
}

void ShimVfs::startRecording() {
  const std::lock_guard lock(mutex_);
  recording_ = true;
  files_.clear();
}

void ShimVfs::noteWrite(const std::string& path, std::int64_t offset, const void* data, int size) {
  const std::lock_guard lock(mutex_);
  if (!recording_) return;
  files_[path].since.push_back(
      {false, offset, std::string(static_cast<const char*>(data), static_cast<std::size_t>(size))});
}

void ShimVfs::noteTruncate(const std::string& path, std::int64_t size) {
  const std::lock_guard lock(mutex_);
  if (recording_) files_[path].since.push_back({true, size, {}});
}

namespace {

void apply(std::string& bytes, std::int64_t offset, std::string_view data) {
  const auto at = static_cast<std::size_t>(offset);
  if (bytes.size() < at + data.size()) bytes.resize(at + data.size(), '\0');
  std::copy(data.begin(), data.end(), bytes.begin() + offset);
}

}  // namespace

void ShimVfs::noteSync(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (!recording_) return;
  File& file = files_[path];
  for (const Change& change : file.since) {
    if (change.truncate) {
      file.synced.resize(static_cast<std::size_t>(change.offset));
    } else {
      apply(file.synced, change.offset, change.data);
    }
  }
  file.since.clear();
  file.exists = true;
}

void ShimVfs::noteDelete(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (recording_) files_.erase(path);
}

void ShimVfs::writeAfterPowerCut(const std::string& folder, std::mt19937_64& random) {
  const std::lock_guard lock(mutex_);
  constexpr std::size_t kSector = 512;
  for (const auto& [path, file] : files_) {
    std::string bytes = file.synced;
    // a disk may have kept any subset of the unsynced sectors
    bool any = file.exists;
    for (const Change& change : file.since) {
      if (change.truncate) {
        if ((random() & 1) != 0 && static_cast<std::size_t>(change.offset) < bytes.size()) {
          bytes.resize(static_cast<std::size_t>(change.offset));
        }
        continue;
      }
      for (std::size_t at = 0; at < change.data.size(); at += kSector) {
        if ((random() & 1) == 0) continue;
        apply(bytes, change.offset + static_cast<std::int64_t>(at),
              std::string_view(change.data).substr(at, std::min(kSector, change.data.size() - at)));
        any = true;
      }
    }
    if (!any) continue;
    std::ofstream(std::filesystem::path(folder) / std::filesystem::path(path).filename(), std::ios::binary)
        << bytes;
  }
}

}  // namespace needlelab::test
