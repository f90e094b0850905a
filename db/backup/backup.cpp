#include "db/backup/backup.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <map>
#include <string>
#include <string_view>

#include "common/base/files/files.h"
#include "db/backup/check.h"
#include "db/backup/database_files.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr int kPagesPerStep = 4096;

Error cancelledError() {
  return {ErrorCode::kUnavailable, "the backup was given up because the program ends: make it again"};
}

Error notAsWritten(const std::filesystem::path& path, const std::string& why = {}) {
  return {ErrorCode::kCorrupt, "the backup was discarded: the data read back from " + path.string() +
                                   " is not what was written" + why + ": look at its disk (dmesg, smartctl)"};
}

bool isSet(const std::atomic<bool>* flag) {
  return flag != nullptr && flag->load();
}

Error logTooLarge(std::uint64_t bytes) {
  return {
      ErrorCode::kUnavailable,
      fmt::format("the backup was given up: the log beside the database grew to {} MiB meanwhile, and can be "
                  "emptied only when the backup has ended: make it when fewer lessons run, or to a faster "
                  "disk",
                  bytes >> 20)};
}

Status copy(Connection& reader, const std::filesystem::path& path, const std::atomic<bool>* cancelled,
            std::uint64_t max_log_bytes) {
  // create an empty private file first, so that other users can never read the copy
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) return systemError(path, "create the copy");
  ::close(fd);
  sqlite3* target = nullptr;
  const int opened =
      sqlite3_open_v2(path.c_str(), &target, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, nullptr);
  const auto failure = [&](int rc) {
    const Error error{ErrorCode::kFailed, fmt::format("{}: cannot write the copy: {} (SQLite {})",
                                                      path.string(), sqlite3_errstr(rc), rc)};
    sqlite3_close(target);
    return error;
  };
  if (opened != SQLITE_OK) return failure(opened);

  // one view of the source for all steps; otherwise each commit of the writer would restart the copy
  auto view = Transaction::begin(reader, Transaction::Kind::kRead);
  if (!view) {
    sqlite3_close(target);
    return view.error();
  }
  sqlite3_backup* backup = sqlite3_backup_init(target, "main", reader.handle(), "main");
  if (backup == nullptr) return failure(sqlite3_extended_errcode(target));
  int rc = SQLITE_OK;
  std::uint64_t log_bytes = 0;
  while (rc == SQLITE_OK && !isSet(cancelled) && log_bytes <= max_log_bytes) {
    rc = sqlite3_backup_step(backup, kPagesPerStep);
    log_bytes = reader.walBytes();
  }
  const int finished = sqlite3_backup_finish(backup);
  if (rc == SQLITE_OK) {
    sqlite3_close(target);
    return isSet(cancelled) ? cancelledError() : logTooLarge(log_bytes);
  }
  if (rc != SQLITE_DONE || finished != SQLITE_OK) return failure(rc != SQLITE_DONE ? rc : finished);
  // single file, no write-ahead log
  if (const int mode = sqlite3_exec(target, "PRAGMA journal_mode=DELETE", nullptr, nullptr, nullptr);
      mode != SQLITE_OK) {
    return failure(mode);
  }
  sqlite3_close(target);
  return {};
}

/// Sessions whose covered chunks in the copy exceed the previous watermark. Coverage ends before a session's
/// first undecodable chunk, so that the station keeps its copy of that one.
Result<std::vector<BackupResult::Covered>> coveredBy(Connection& copy,
                                                     const std::map<Uuid, std::uint64_t>& decodable_before) {
  std::vector<BackupResult::Covered> covered;
  // A session open in the copy may be closed by now, and the copy lacks its end. Its last chunk does not
  // count, so that the station keeps the session until a backup contains the end as well.
  auto rows = copy.query(
      "SELECT id, covered, safe_chunks"
      " FROM (SELECT s.id, s.safe_chunks, coalesce(p.chunks,"
      " s.chunks) - CASE s.state WHEN ? THEN 1 ELSE 0 END AS covered FROM sessions s"
      " LEFT JOIN session_progress p ON p.session = s.number) AS sums"
      " WHERE covered > safe_chunks",
      static_cast<int>(pb::SESSION_OPEN));
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return covered;
    const auto id = uuidOf(textOf(rows.bytes(0)));
    if (!id) continue;
    std::uint64_t chunks = rows.natural(1);
    if (const auto end = decodable_before.find(*id); end != decodable_before.end())
      chunks = std::min(chunks, end->second);
    if (chunks > rows.natural(2)) covered.push_back({*id, chunks});
  }
}

/// Checks that a backup may be written to this target.
Status checkTarget(const std::filesystem::path& target) {
  std::error_code ignored;
  if (!target.is_absolute()) {
    return Error{ErrorCode::kInvalidInput, "backup path '" + target.string() + "': give an absolute path"};
  }
  if (std::filesystem::exists(std::filesystem::symlink_status(target, ignored))) {
    return Error{ErrorCode::kAlreadyExists,
                 target.string() + ": is there already; a backup never overwrites a file"};
  }
  if (!std::filesystem::is_directory(target.parent_path(), ignored)) {
    return Error{ErrorCode::kInvalidInput, target.string() + ": its folder does not exist"};
  }
  return {};
}

/// Copies the database to `path` and checks the copy.
Result<BackupResult> checkedCopy(Connection& reader, const std::filesystem::path& path,
                                 const std::atomic<bool>* cancelled, std::uint64_t max_log_bytes) {
  RETURN_IF_ERROR(copy(reader, path, cancelled, max_log_bytes));
  ASSIGN_OR_RETURN(auto opened, Connection::open(path, {.mode = Connection::Mode::kReader}));
  const CancelScope may_end(opened, cancelled);
  const auto checked = checkDatabase(opened);
  if (isSet(cancelled)) return cancelledError();
  if (!checked) return checked.error();
  if (!checked->ok()) {
    return Error{ErrorCode::kCorrupt,
                 "the backup was discarded, its copy fails the check: " + checked->faults.front()};
  }
  BackupResult result;
  result.chunks_verified = checked->chunks;
  result.undecodable_chunks = checked->undecodable_chunks;
  ASSIGN_OR_RETURN(auto covered, coveredBy(opened, checked->decodable_before));
  result.covered = std::move(covered);
  return result;
}

/// Syncs a finished file and renames it. Returns its size.
Result<std::uint64_t> renameIntoPlace(const std::filesystem::path& finished,
                                      const std::filesystem::path& target) {
  RETURN_IF_ERROR(syncFile(finished));
  struct stat info {};
  if (::stat(finished.c_str(), &info) != 0) return systemError(finished, "look at");
  // not a plain rename: this must fail if the target was created meanwhile. The other call is for file
  // systems without hard links (FAT on USB sticks).
  if (::link(finished.c_str(), target.c_str()) != 0 &&
      (errno == EEXIST ||
       ::renameat2(AT_FDCWD, finished.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) != 0))
    return systemError(target, "put the backup into place");
  RETURN_IF_ERROR(syncFolder(target.parent_path()));
  return static_cast<std::uint64_t>(info.st_size);
}

/// kNoRoom unless the database's disk can hold a copy of it and still has `room_left` bytes free.
Status roomForCopy(const std::filesystem::path& database, std::uint64_t room_left) {
  std::error_code error;
  const std::uint64_t bytes = std::filesystem::file_size(database, error);
  const auto room = std::filesystem::space(database.parent_path(), error);
  if (error)
    return Error{ErrorCode::kFailed,
                 database.string() + ": cannot find out its size and room: " + error.message()};
  if (room.available >= bytes && room.available - bytes >= room_left) return {};
  return Error{
      ErrorCode::kNoRoom,
      fmt::format("the backup was not made: {} needs {} MiB for a copy for a while, and {} MiB "
                  "must stay free; {} MiB are free: make room, or use a larger disk",
                  database.parent_path().string(), bytes >> 20, room_left >> 20, room.available >> 20)};
}

/// Writes the bytes of a checked copy to another disk and reads them back from the disk, not from the page
/// cache.
Status copyToDisk(const std::filesystem::path& from, const std::filesystem::path& to,
                  const std::atomic<bool>* cancelled) {
  const OpenFile in(::open(from.c_str(), O_RDONLY | O_CLOEXEC));
  if (!in.isOpen()) return systemError(from, "open");
  const OpenFile out(::open(to.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!out.isOpen()) return systemError(to, "create the copy");
  constexpr std::size_t kPiece = 1u << 20;
  Bytes piece(kPiece), again(kPiece);
  for (;;) {
    if (isSet(cancelled)) return cancelledError();
    ASSIGN_OR_RETURN(const std::size_t count, readFully(in, from, piece.data(), kPiece));
    if (count == 0) break;
    RETURN_IF_ERROR(writeFully(out, to, ByteView(piece).first(count)));
  }
  if (::fsync(out.fd()) != 0) return systemError(to, "fsync");
  ::posix_fadvise(out.fd(), 0, 0, POSIX_FADV_DONTNEED);
  if (::lseek(in.fd(), 0, SEEK_SET) != 0 || ::lseek(out.fd(), 0, SEEK_SET) != 0)
    return systemError(to, "read back");
  for (;;) {
    if (isSet(cancelled)) return cancelledError();
    ASSIGN_OR_RETURN(const std::size_t written, readFully(in, from, piece.data(), kPiece));
    ASSIGN_OR_RETURN(const std::size_t found, readFully(out, to, again.data(), kPiece));
    if (written != found ||
        !std::equal(piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(written), again.begin()))
      return notAsWritten(to);
    if (written == 0) return {};
  }
}

}  // namespace

Result<BackupResult> backupTo(Connection& reader, const std::filesystem::path& target,
                              const std::atomic<bool>* cancelled, std::uint64_t max_log_bytes,
                              std::uint64_t room_left, LinkCopy link) {
  RETURN_IF_ERROR(checkTarget(target));
  const UnfinishedDatabase plain(plainCopyPath(reader.path()));
  RETURN_IF_ERROR(roomForCopy(reader.path(), room_left));
  const UnfinishedDatabase partial(target.string() + ".partial");
  ASSIGN_OR_RETURN(auto result, checkedCopy(reader, plain.path(), cancelled, max_log_bytes));
  // same disk: no second copy
  if ((link != nullptr ? link : ::link)(plain.path().c_str(), partial.path().c_str()) != 0)
    RETURN_IF_ERROR(copyToDisk(plain.path(), partial.path(), cancelled));
  ASSIGN_OR_RETURN(result.bytes, renameIntoPlace(partial.path(), target));
  return result;
}

Result<BackupResult> encryptedBackupTo(Connection& reader, const std::filesystem::path& target,
                                       const BackupKey& key, const std::atomic<bool>* cancelled,
                                       std::uint64_t max_log_bytes, std::uint64_t room_left) {
  RETURN_IF_ERROR(checkTarget(target));
  const UnfinishedDatabase plain(plainCopyPath(reader.path()));
  RETURN_IF_ERROR(roomForCopy(reader.path(), room_left));
  const UnfinishedDatabase partial(target.string() + ".partial");
  ASSIGN_OR_RETURN(auto result, checkedCopy(reader, plain.path(), cancelled, max_log_bytes));
  ASSIGN_OR_RETURN(const auto written, encryptFile(plain.path(), partial.path(), key, cancelled));
  // a restore must be able to read the file: verify it from the disk, not from the page cache
  const auto read_back = decryptFile(
      partial.path(), key, [](ByteView) { return Status(); }, cancelled);
  if (!read_back && read_back.error().code != ErrorCode::kCorrupt) return read_back.error();
  if (!read_back || *read_back != written)
    return notAsWritten(partial.path(), read_back ? "" : " (" + read_back.error().message + ")");
  ASSIGN_OR_RETURN(result.bytes, renameIntoPlace(partial.path(), target));
  return result;
}

std::filesystem::path plainCopyPath(const std::filesystem::path& database) {
  return database.string() + ".backup-copy";
}

Status recordBackup(Connection& writer, const BackupResult& result, const std::filesystem::path& target,
                    std::int64_t now_unix_ns) {
  SessionStore sessions(writer);
  for (const auto& [session, chunks] : result.covered) {
    RETURN_IF_ERROR(sessions.markSafe(session, chunks));
  }
  MetaStore meta(writer);
  RETURN_IF_ERROR(meta.set("backup_unix_ns", std::to_string(now_unix_ns)));
  return meta.set("backup_path", target.string());
}

}  // namespace needlelab
