#include "db/backup/database_files.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <initializer_list>
#include <utility>

#include "common/base/files/files.h"

namespace needlelab {
namespace {

bool isThere(const std::filesystem::path& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0;
}

Status removeFiles(const std::filesystem::path& path, std::initializer_list<const char*> suffixes) {
  for (const char* suffix : suffixes) {
    const std::string file = path.string() + suffix;
    if (::unlink(file.c_str()) != 0 && errno != ENOENT) return systemError(file, "remove");
  }
  return {};
}

}  // namespace

Status makeDatabaseFile(const std::filesystem::path& path) {
  const OpenFile made(::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  return made.isOpen() || errno == EEXIST ? Status() : Status(systemError(path, "make the database"));
}

Status removeDatabase(const std::filesystem::path& path) {
  return removeFiles(path, {"-wal", "-shm", "-journal", ""});
}

Status closeIntoOneFile(Connection database) {
  const std::filesystem::path path = database.path();
  {
    Connection last = std::move(database);
    const auto emptied = last.emptyLog(0);
    if (!emptied) return emptied.error();
    RETURN_IF_ERROR(last.script("PRAGMA journal_mode=DELETE"));
  }
  RETURN_IF_ERROR(syncFile(path));
  return removeFiles(path, {"-wal", "-shm", "-journal"});
}

std::string timeForNames(std::int64_t unix_ns) {
  const std::time_t now = unix_ns / 1'000'000'000;
  std::tm parts{};
  std::array<char, 32> time{};
  std::strftime(time.data(), time.size(), "%Y%m%dT%H%M%SZ", ::gmtime_r(&now, &parts));
  return time.data();
}

std::string freeNameIn(const std::filesystem::path& folder, std::string_view base, std::int64_t now_unix_ns) {
  const std::string first = std::string(base) + timeForNames(now_unix_ns);
  std::string name = first;
  for (int number = 2; isThere(folder / name); ++number) name = fmt::format("{}-{}", first, number);
  return name;
}

Status renameInFolder(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (!isThere(from)) return {};
  if (isThere(to))
    return Error{ErrorCode::kFailed,
                 fmt::format("{} is to get the name {}, which something has: move that away", from.string(),
                             to.string())};
  if (::rename(from.c_str(), to.c_str()) != 0) return systemError(from, "rename");
  return {};
}

Status keepReplacedDatabase(const std::filesystem::path& folder, const std::string& kept,
                            const std::filesystem::path& named_in) {
  // the file could contain a path: accept only this program's own names
  if (!kept.starts_with(kReplacedDatabase) || kept.find('/') != std::string::npos)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: '{}' is not a name that this program writes there ({}TIME): look at the "
                             "files of this folder, and remove it",
                             named_in.string(), kept, kReplacedDatabase)};
  const std::filesystem::path database = folder / kDatabaseFile;
  // the log first: the old database must never be opened without it
  RETURN_IF_ERROR(renameInFolder(database.string() + "-wal", folder / (kept + "-wal")));
  RETURN_IF_ERROR(renameInFolder(database, folder / kept));
  RETURN_IF_ERROR(removeFiles(database, {"-shm"}));
  return syncFolder(folder);
}

}  // namespace needlelab
