#include "db/service/store_switch.h"

#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <string_view>

#include "common/base/files.h"
#include "db/connection.h"
#include "db/copy_marks.h"
#include "db/store_address.h"

namespace needlelab {
namespace {

constexpr const char* kSwitchedDatabase = "needlelab.db";
constexpr std::string_view kKeptDatabase = "needlelab.db.replaced-";

bool isThere(const std::filesystem::path& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0;
}

/// A name that nothing in the folder has: `base` and the time.
std::string freeNameIn(const std::filesystem::path& folder, std::string_view base, std::int64_t now_unix_ns) {
  const std::time_t now = now_unix_ns / 1'000'000'000;
  std::tm parts{};
  std::array<char, 32> time{};
  std::strftime(time.data(), time.size(), "%Y%m%dT%H%M%SZ", ::gmtime_r(&now, &parts));
  std::string name = fmt::format("{}{}", base, time.data());
  for (int number = 2; isThere(folder / name); ++number)
    name = fmt::format("{}{}-{}", base, time.data(), number);
  return name;
}

/// What is not there any more was renamed before.
Status renameInFolder(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (!isThere(from)) return {};
  if (isThere(to))
    return Error{ErrorCode::kFailed,
                 fmt::format("{} is to get the name {}, which something has: move that away", from.string(),
                             to.string())};
  if (::rename(from.c_str(), to.c_str()) != 0) return systemError(from, "rename");
  return {};
}

Status keepReplacedDatabase(const std::filesystem::path& folder, StoreFile file) {
  const std::filesystem::path database = folder / kSwitchedDatabase;
  // the file may name a path: only this program's own names
  if (!file.kept.starts_with(kKeptDatabase) || file.kept.find('/') != std::string::npos)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: kept = {}: is no name that a copy writes there ({}TIME): remove the line",
                             (folder / kStoreFile).string(), file.kept, kKeptDatabase)};
  // the log first: the old database must not be opened without it
  RETURN_IF_ERROR(renameInFolder(database.string() + "-wal", folder / (file.kept + "-wal")));
  RETURN_IF_ERROR(renameInFolder(database, folder / file.kept));
  if (::unlink((database.string() + "-shm").c_str()) != 0 && errno != ENOENT)
    return systemError(database.string() + "-shm", "remove");
  RETURN_IF_ERROR(syncFolder(folder));
  file.kept.clear();
  return writeStoreFile(folder, file);
}

Status moveCopyIntoPlace(const std::filesystem::path& folder) {
  const auto copy = folder / kCopyingDatabase;
  {
    ASSIGN_OR_RETURN(auto reader, Connection::open(copy, {.mode = Connection::Mode::kReader}));
    ASSIGN_OR_RETURN(const auto mark, readCopyMark(reader));
    if (!mark || !mark->compared) return {};  // nobody decided for it
  }
  RETURN_IF_ERROR(renameInFolder(copy, folder / kSwitchedDatabase));
  return syncFolder(folder);
}

}  // namespace

Result<std::filesystem::path> switchToPostgres(const std::filesystem::path& folder, const std::string& url,
                                               const std::string& lab, std::int64_t now_unix_ns) {
  const std::string kept = freeNameIn(folder, kKeptDatabase, now_unix_ns);
  // the decision
  RETURN_IF_ERROR(writeStoreFile(folder, {url, lab, kept}));
  RETURN_IF_ERROR(finishStoreSwitch(folder));
  return folder / kept;
}

Result<std::filesystem::path> switchToSqlite(const std::filesystem::path& folder, std::int64_t now_unix_ns) {
  const std::string kept = freeNameIn(folder, kReplacedStoreFile, now_unix_ns);
  // the decision
  RETURN_IF_ERROR(renameInFolder(folder / kStoreFile, folder / kept));
  RETURN_IF_ERROR(syncFolder(folder));
  RETURN_IF_ERROR(finishStoreSwitch(folder));
  return folder / kept;
}

Status finishStoreSwitch(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(const auto file, readStoreFile(folder));
  if (file && !file->kept.empty()) return keepReplacedDatabase(folder, *file);
  if (!file && !isThere(folder / kSwitchedDatabase) && isThere(folder / kCopyingDatabase))
    return moveCopyIntoPlace(folder);
  return {};
}

}  // namespace needlelab
