#include "server/live/startup.h"

#include <pwd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <sstream>

#include "common/base/files.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::int64_t kYear2020_s = 1'577'836'800;
// beside connections: database, log, readers, monitor, standard streams
constexpr std::size_t kOtherFiles = 64;

std::string userName(uid_t id) {
  const passwd* const entry = ::getpwuid(id);
  return entry != nullptr && entry->pw_name != nullptr ? entry->pw_name : std::to_string(id);
}

/// The inode of the socket that listens on the port, from one of the kernel's tables; empty: none.
std::string listeningInode(const char* table, std::uint16_t port) {
  std::ifstream file(table);
  std::string line;
  std::getline(file, line);  // the head
  const std::string wanted = formatted(":%04X", port);
  while (std::getline(file, line)) {
    // sl local_address rem_address st tx:rx tr:when retrnsmt uid timeout inode; 0A = LISTEN
    std::istringstream words(line);
    std::array<std::string, 10> field;
    for (std::string& word : field) words >> word;
    if (field[1].ends_with(wanted) && field[3] == "0A") return field[9];
  }
  return {};
}

bool isNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

Status checkClock(std::int64_t now_unix_s) {
  if (now_unix_s >= kYear2020_s) return {};
  std::array<char, 32> text{};
  const std::time_t now = now_unix_s;
  std::tm parts{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", ::gmtime_r(&now, &parts));
  return Error{ErrorCode::kFailed,
               "this machine's clock says " + std::string(text.data()) +
                   " UTC, which is before 2020: certificates would not be valid and sessions "
                   "would have wrong dates; set the clock (timedatectl) and start again"};
}

Status checkFolderRights(const std::filesystem::path& folder) {
  if (folder.empty()) return {};  // said elsewhere
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
    if (!S_ISDIR(info.st_mode)) return {};  // said elsewhere
  }
  const std::string me = userName(::geteuid());
  return Error{ErrorCode::kFailed, "--data " + folder.string() + ": " + me + " may not write in " +
                                       there.string() + formatted(" (mode %04o, owner ", mode) + owner +
                                       "); run the server as " + owner +
                                       ", or give it the folder: chown -R " + me + " " + there.string()};
}

Status checkRoom(const std::filesystem::path& folder, std::uint64_t min_free_bytes) {
  std::error_code error;
  std::filesystem::path there = std::filesystem::absolute(folder, error);
  while (!there.empty() && there != there.root_path() && !std::filesystem::exists(there, error))
    there = there.parent_path();
  const auto space = std::filesystem::space(there, error);
  if (error || space.available >= min_free_bytes) return {};
  return Error{
      ErrorCode::kUnavailable,
      formatted(
          "--data %s: its disk has %llu MiB left, the server wants %llu to begin: make room there, move "
          "the folder to a larger disk, or give --min-free MIB",
          folder.c_str(), static_cast<unsigned long long>(space.available >> 20),
          static_cast<unsigned long long>(min_free_bytes >> 20))};
}

std::string tooFewFiles(std::size_t connections) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return {};
  const std::size_t needed = connections + kOtherFiles;
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= needed) return {};
  return formatted(
      "this process may open %llu files, %zu connections need %zu: start it with 'ulimit -n %zu' or "
      "LimitNOFILE=%zu, or give --max-connections %lld",
      static_cast<unsigned long long>(limit.rlim_cur), connections, needed, needed, needed,
      std::max(1LL, static_cast<long long>(limit.rlim_cur) - static_cast<long long>(kOtherFiles)));
}

std::optional<std::string> portHolder(std::uint16_t port) {
  std::string inode = listeningInode("/proc/net/tcp", port);
  if (inode.empty()) inode = listeningInode("/proc/net/tcp6", port);
  if (inode.empty() || inode == "0") return std::nullopt;
  const std::string wanted = "socket:[" + inode + "]";
  std::error_code error;
  namespace fs = std::filesystem;
  for (auto at = fs::directory_iterator("/proc", error); !error && at != fs::directory_iterator();
       at.increment(error)) {
    const std::string pid = at->path().filename().string();
    if (!isNumber(pid)) continue;
    // of other users' processes the files are not shown: then there is no name
    std::error_code hidden;
    for (auto file = fs::directory_iterator(at->path() / "fd", hidden);
         !hidden && file != fs::directory_iterator(); file.increment(hidden)) {
      std::error_code gone;
      if (fs::read_symlink(file->path(), gone).string() != wanted || gone) continue;
      std::ifstream comm(at->path() / "comm");
      std::string name;
      std::getline(comm, name);
      return name + " (process " + pid + ")";
    }
  }
  return std::nullopt;
}

}  // namespace needlelab
