#include "server/live/limits/startup.h"

#include <fmt/core.h>
#include <pwd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "server/live/limits/disk_room.h"

namespace needlelab {
namespace {

constexpr std::int64_t kYear2020_s = 1'577'836'800;
// in addition to connections: database, log, readers, monitor, standard streams
constexpr std::size_t kOtherFiles = 64;

std::string userName(uid_t id) {
  const passwd* const entry = ::getpwuid(id);
  return entry != nullptr && entry->pw_name != nullptr ? entry->pw_name : std::to_string(id);
}

}  // namespace

Status checkClock(std::int64_t now_unix_s) {
  if (now_unix_s >= kYear2020_s) return {};
  return Error{ErrorCode::kFailed, "this machine's clock says " +
                                       localTime(now_unix_s * 1'000'000'000, TimeForm::kZoned) +
                                       ", which is before 2020: certificates would not be valid and sessions "
                                       "would have wrong dates; set the clock (timedatectl) and start again"};
}

Status checkFolderRights(const std::filesystem::path& folder) {
  if (folder.empty()) return {};  // reported elsewhere
  std::error_code error;
  std::filesystem::path there = std::filesystem::absolute(folder, error);
  while (!there.empty() && there != there.root_path() && !std::filesystem::exists(there, error))
    there = there.parent_path();
  if (::access(there.c_str(), R_OK | W_OK | X_OK) == 0) return {};
  if (errno == EROFS)
    return Error{ErrorCode::kFailed,
                 "--data " + folder.string() + ": cannot be written" + diskAdvice(EROFS, folder)};
  struct stat info {};
  std::string owner = "an unknown user";
  unsigned mode = 0;
  if (::stat(there.c_str(), &info) == 0) {
    owner = userName(info.st_uid);
    mode = info.st_mode & 07777;
    if (!S_ISDIR(info.st_mode)) return {};  // reported elsewhere
  }
  const std::string me = userName(::geteuid());
  return Error{ErrorCode::kFailed,
               fmt::format("--data {}: {} may not write in {} (mode {:04o}, owner {}); run the server as {}, "
                           "or give it the folder: chown -R {} {}",
                           folder.string(), me, there.string(), mode, owner, owner, me, there.string())};
}

Status checkRoom(const std::filesystem::path& folder, std::uint64_t min_free_bytes) {
  std::error_code error;
  std::filesystem::path there = std::filesystem::absolute(folder, error);
  while (!there.empty() && there != there.root_path() && !std::filesystem::exists(there, error))
    there = there.parent_path();
  const auto space = std::filesystem::space(there, error);
  if (error || space.available >= min_free_bytes) return {};
  return Error{ErrorCode::kUnavailable,
               fmt::format("--data {}: its disk has {} MiB left, the server wants {} to begin: make room "
                           "there, move the folder to a larger disk, or give --min-free MIB",
                           folder.string(), space.available >> 20, min_free_bytes >> 20)};
}

std::string readOnlyBecause(const std::filesystem::path& folder, std::optional<std::uint64_t> free_bytes,
                            std::uint64_t min_free_bytes) {
  const std::uint64_t least = min_free_bytes / DiskRoom::kDiskShare;
  if (!free_bytes || *free_bytes >= least) return {};
  return fmt::format(
      "the disk of {} is full: {} MiB are left, with less than {} MiB nothing is written; make room on it",
      folder.string(), *free_bytes >> 20, least >> 20);
}

std::string tooFewFiles(std::size_t connections) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return {};
  const std::size_t needed = connections + kOtherFiles;
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= needed) return {};
  return fmt::format(
      "this process may open {} files, {} connections need {}: start it with 'ulimit -n {}' or "
      "LimitNOFILE={}, or give --max-connections {}",
      limit.rlim_cur, connections, needed, needed, needed,
      std::max(1LL, static_cast<long long>(limit.rlim_cur) - static_cast<long long>(kOtherFiles)));
}

}  // namespace needlelab
