#include "db/service/store_switch.h"

#include <system_error>

#include "common/base/files.h"
#include "db/connection.h"
#include "db/copy_marks.h"
#include "db/database_files.h"
#include "db/store_address.h"

namespace needlelab {
namespace {

Status moveCopyIntoPlace(const std::filesystem::path& folder) {
  const auto copy = folder / kCopyingDatabase;
  {
    ASSIGN_OR_RETURN(auto reader, Connection::open(copy, {.mode = Connection::Mode::kReader}));
    ASSIGN_OR_RETURN(const auto mark, readCopyMark(reader));
    if (!mark || !mark->compared) return {};  // nobody decided for it
  }
  RETURN_IF_ERROR(renameInFolder(copy, folder / kDatabaseFile));
  return syncFolder(folder);
}

}  // namespace

Result<std::filesystem::path> switchToPostgres(const std::filesystem::path& folder, const std::string& url,
                                               const std::string& lab, std::int64_t now_unix_ns) {
  const std::string kept = freeNameIn(folder, kReplacedDatabase, now_unix_ns);
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
  ASSIGN_OR_RETURN(auto file, readStoreFile(folder));
  if (file && !file->kept.empty()) {
    RETURN_IF_ERROR(keepReplacedDatabase(folder, file->kept, folder / kStoreFile));
    file->kept.clear();
    return writeStoreFile(folder, *file);
  }
  std::error_code error;
  if (!file && !std::filesystem::exists(folder / kDatabaseFile, error) &&
      std::filesystem::exists(folder / kCopyingDatabase, error))
    return moveCopyIntoPlace(folder);
  return {};
}

}  // namespace needlelab
