#include "db/service/data_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <system_error>

#include "common/base/files.h"
#include "db/acknowledged.h"
#include "db/audit_chain.h"
#include "db/audit_head.h"
#include "db/backup.h"
#include "db/erasure_list.h"
#include "db/old_backups.h"
#include "db/service/restore.h"
#include "db/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Files beside the database that a start reads or writes.
constexpr std::string_view kOwnFiles[] = {
    "lock",          "pseudonym.key",        kErasuresFile, kAuditKeyFile,     kAuditHeadFile,
    kRestorePending, kReplacedAuditHeadFile, kStoreFile,    kAcknowledgedFile, kServerFile};

/// What else lies there: SQLite's, and what an undone restore leaves (deploy/OPERATIONS.md).
constexpr std::string_view kOthersOwnFiles[] = {"needlelab.db-wal", "needlelab.db-shm",
                                                "needlelab.db-journal", "audit.head.replaced-undone"};

bool isTemporary(std::string_view name) {
  return std::any_of(std::begin(kOwnFiles), std::end(kOwnFiles),
                     [&](std::string_view own) { return isTemporaryNameOf(own, name); });
}

/// Temporary files beside our own ones.
void addTemporary(const fs::path& folder, std::vector<fs::path>& left) {
  std::error_code error;
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::directory_iterator();
       at.increment(error))
    if (isTemporary(at->path().filename().string())) left.push_back(at->path());
}

}  // namespace

Status checkOwnFiles(const fs::path& folder) {
  for (const std::string_view name : kOwnFiles) RETURN_IF_ERROR(requireFileOrNothing(folder / name));
  return {};
}

std::vector<fs::path> removeFolderLeftovers(const fs::path& folder) {
  std::vector<fs::path> left;
  for (const fs::path& copy : {folder / kRestoringCopy, plainCopyBeside(folder / "needlelab.db")})
    for (const char* suffix : {"", "-wal", "-shm", "-journal"}) left.emplace_back(copy.string() + suffix);
  addTemporary(folder, left);
  for (const fs::path& place : {folder, folder / "backups"}) {
    std::error_code error;
    if (place != folder && !fs::is_directory(fs::symlink_status(place, error))) continue;
    const auto partials = partialsIn(place, fs::file_time_type::max());
    left.insert(left.end(), partials.begin(), partials.end());
  }
  std::erase_if(left, [](const fs::path& path) {
    struct stat info {};
    return ::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || ::unlink(path.c_str()) != 0;
  });
  std::sort(left.begin(), left.end());
  return left;
}

bool isOwnFile(const fs::path& folder, const fs::path& path) {
  const std::string file = path.filename().string();
  const std::string_view name = file;
  const fs::path in = path.parent_path();
  // of the authority, the next one and the server (common/wire/certificates.h)
  if (in == folder / "tls") {
    const std::string_view written = name.substr(0, name.find(kTemporaryMark));
    return (written == name || isTemporaryNameOf(written, name)) &&
           (written.ends_with(".crt") || written.ends_with(".key"));
  }
  const auto has = [&](const auto& names) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
  };
  return in == folder && (has(kOwnFiles) || has(kOthersOwnFiles) || isTemporary(name));
}

}  // namespace needlelab
