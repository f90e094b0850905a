#include "db/backup/foreign_database.h"

#include <fmt/core.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "db/backup/check.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// How much SQLite has read of a foreign schema.
struct SchemaRead {
  sqlite3* handle;
  std::uint64_t rows = 0, bytes = 0;
  bool exceeds_limit = false;
};

/// Called by SQLite for each row of a statement, including those it runs to read the schema.
int countRow(unsigned /*what*/, void* self, void* statement, void* /*unused*/) {
  auto& read = *static_cast<SchemaRead*>(self);
  auto* const row = static_cast<sqlite3_stmt*>(statement);
  ++read.rows;
  for (int i = 0; i < sqlite3_column_count(row); ++i) {
    const int type = sqlite3_column_type(row, i);
    if (type == SQLITE_TEXT || type == SQLITE_BLOB)
      read.bytes += static_cast<std::uint64_t>(sqlite3_column_bytes(row, i));
  }
  read.exceeds_limit |=
      read.rows > ForeignSchemaBounds::kMostRows || read.bytes > ForeignSchemaBounds::kMostBytes;
  if (read.exceeds_limit) sqlite3_interrupt(read.handle);
  return 0;
}

/// Begins the view for all reads and checks whose database it is.
Status checkContents(Connection& opened, const fs::path& path) {
  RETURN_IF_ERROR(opened.run("BEGIN"));
  // reads the first page, which then stays in memory unchanged even if someone writes to the file
  ASSIGN_OR_RETURN(const auto id, opened.prepare("PRAGMA application_id").first([](const Statement& row) {
    return row.integer(0);
  }));
  if (id != kApplicationId)
    return Error{ErrorCode::kCorrupt, path.string() + ": this is not a needlelab database"};
  // otherwise the file's header decides how many of its pages stay in memory
  RETURN_IF_ERROR(opened.script("PRAGMA cache_size=-2000"));
  ASSIGN_OR_RETURN(const auto faults, schemaFaults(opened));
  if (!faults.empty()) return Error{ErrorCode::kCorrupt, path.string() + ": " + faults.front()};
  return {};
}

}  // namespace

Status requireUnused(const fs::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0)
    return Error{ErrorCode::kNotFound, path.string() + ": there is no database here"};
  if (!S_ISREG(info.st_mode))
    return Error{ErrorCode::kInvalidInput,
                 path.string() + ": is a link or no regular file: give the database's own name"};
  for (const char* suffix : {"-wal", "-journal"}) {
    const fs::path log = path.string() + suffix;
    if (::lstat(log.c_str(), &info) == 0 && (!S_ISREG(info.st_mode) || info.st_size > 0))
      return Error{ErrorCode::kUnavailable,
                   path.string() + ": there is a log beside it (" + log.string() +
                       "): it is a database in use, or somebody put the log there; no file of others "
                       "is read with its log"};
  }
  return {};
}

Result<Connection> openForeign(const fs::path& path, const std::atomic<bool>* cancelled,
                               std::chrono::nanoseconds max_time, TimeSource& time) {
  RETURN_IF_ERROR(requireUnused(path));
  const std::int64_t until_ns = time.nowNs() + max_time.count();
  // SQLite refuses links anywhere in the path, but the folder may be reached through one
  std::error_code error;
  const fs::path folder = fs::canonical(path.has_parent_path() ? path.parent_path() : ".", error);
  if (error) return Error{ErrorCode::kFailed, path.string() + ": cannot find its folder: " + error.message()};
  ASSIGN_OR_RETURN(auto opened,
                   Connection::open(folder / path.filename(), {.mode = Connection::Mode::kForeign,
                                                               .busy_timeout_ms = 0,
                                                               .copy_of = path,
                                                               .time = &time,
                                                               .until_ns = until_ns,
                                                               .cancelled = cancelled}));
  sqlite3* const handle = opened.handle();
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, ForeignSchemaBounds::kMaxTextBytes);
  sqlite3_limit(handle, SQLITE_LIMIT_COLUMN, ForeignSchemaBounds::kMaxColumns);
  SchemaRead read{handle};
  sqlite3_trace_v2(handle, SQLITE_TRACE_ROW, &countRow, &read);
  const Status checked = checkContents(opened, path);
  sqlite3_trace_v2(handle, 0, nullptr, nullptr);
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, kMaxForeignTextBytes);
  if (checked) return opened;
  // for over-long texts SQLite itself reports the error
  if (!read.exceeds_limit && checked.error().code != ErrorCode::kInvalidInput) return checked.error();
  return Error{
      ErrorCode::kCorrupt,
      path.string() +
          ": its schema is much larger than needlelab's, and was not read to its end: it was put in"};
}

namespace {

/// A session of one of the two databases.
struct ComparedSession {
  Uuid id{};
  std::int64_t number = 0;
  std::uint64_t chunks = 0, safe_chunks = 0;
  bool open = false;
  bool original = false;  ///< its chunks are stored as received
};

constexpr const char* kComparedColumns =
    "SELECT s.id, s.number, coalesce(p.chunks, s.chunks), s.safe_chunks, s.state, s.recording"
    " FROM sessions s LEFT JOIN session_progress p ON p.session = s.number";

Result<ComparedSession> comparedOf(const Statement& row) {
  const auto id = uuidOf(textOf(row.bytes(0)));
  if (!id) return Error{ErrorCode::kCorrupt, "a session's id has not 16 bytes"};
  return ComparedSession{*id,
                         row.integer(1),
                         row.natural(2),
                         row.natural(3),
                         row.integer(4) == static_cast<int>(pb::SESSION_OPEN),
                         row.integer(5) == static_cast<int>(StoredRecording::Kind::kOriginal)};
}

Result<std::string> oneTextOf(Connection& connection, std::string_view sql) {
  ASSIGN_OR_RETURN(auto text, connection.prepare(sql).first(firstText));
  return std::move(text).value_or("");
}

/// Distinguishes a database from its copies: for PostgreSQL by the server's start time and the database in
/// it.
Result<std::string> databaseId(Connection& connection) {
  if (connection.sqlite() != nullptr) return connection.path().string();
  return oneTextOf(connection,
                   "SELECT pg_postmaster_start_time()::text || ' ' || oid::text FROM pg_database"
                   " WHERE datname = current_database()");
}

Status requireCopyOf(Connection& live, Connection& restored) {
  const auto refused = [](std::string why) { return Error{ErrorCode::kInvalidInput, std::move(why)}; };
  ASSIGN_OR_RETURN(const auto of_live, databaseId(live));
  ASSIGN_OR_RETURN(const auto of_restored, databaseId(restored));
  if (of_live == of_restored)
    return refused(
        "this is the lab's own database: restore the backup into a database elsewhere, and name that");
  if (restored.sqlite() == nullptr) {
    ASSIGN_OR_RETURN(const auto recovering,
                     oneTextOf(restored, "SELECT CASE WHEN pg_is_in_recovery() THEN 'yes' ELSE 'no' END"));
    if (recovering != "no")
      return refused(
          "this is a standby, or a backup that is still being restored: it proves nothing about a "
          "backup. Restore the backup without standby.signal and wait for the end");
  }
  RETURN_IF_ERROR(requireNewestSchema(restored));
  ASSIGN_OR_RETURN(const auto lab, MetaStore(live).get(kLabKey));
  ASSIGN_OR_RETURN(const auto of_lab, MetaStore(restored).get(kLabKey));
  if (lab == of_lab) return {};
  return refused(
      fmt::format("the restored database belongs to the lab '{}', this one is '{}': check the address",
                  of_lab.value_or(""), lab.value_or("")));
}

/// kCorrupt: the first `most` chunks of the two differ.
Status compareChunks(Connection& live, Connection& restored, const ComparedSession& in_live,
                     const ComparedSession& in_restored, std::uint64_t most) {
  constexpr std::string_view kCrcs = "SELECT seq, crc FROM chunks WHERE session = ? AND seq < ? ORDER BY seq";
  auto here = live.query(kCrcs, in_live.number, most);
  auto there = restored.query(kCrcs, in_restored.number, most);
  for (std::uint64_t seq = 0; seq < most; ++seq) {
    ASSIGN_OR_RETURN(const bool is_here, here.step());
    ASSIGN_OR_RETURN(const bool is_there, there.step());
    if (!is_here || !is_there || here.natural(0) != seq || there.natural(0) != seq ||
        here.integer(1) != there.integer(1))
      return Error{ErrorCode::kCorrupt,
                   fmt::format("session {}: chunk {} of the restored database is not the lab's: this is not "
                               "a backup of it, and nothing becomes Safe",
                               uuidText(in_live.id), seq)};
  }
  return {};
}

/// Number of chunks of the live session that the restored one covers.
Result<std::uint64_t> coveredOf(Connection& live, Connection& restored, const ComparedSession& in_live,
                                const ComparedSession& in_restored, std::uint64_t decodable) {
  const std::uint64_t whole = in_restored.chunks - (in_restored.open && in_restored.chunks > 0 ? 1 : 0);
  const std::uint64_t most = std::min({whole, in_live.chunks, decodable});
  if (most <= in_live.safe_chunks) return std::uint64_t{0};
  if (!in_live.original || !in_restored.original) return std::uint64_t{0};
  RETURN_IF_ERROR(compareChunks(live, restored, in_live, in_restored, most));
  return most;
}

Result<std::int64_t> latestTimeIn(Connection& restored) {
  ASSIGN_OR_RETURN(std::int64_t latest, SeenTimeStore(restored).latest());
  auto line = restored.prepare("SELECT unix_ns FROM audit ORDER BY id DESC LIMIT 1");
  ASSIGN_OR_RETURN(const bool there, line.step());
  if (there) latest = std::max(latest, line.integer(0));
  return latest;
}

}  // namespace

Result<RestoredBackup> compareRestored(Connection& live, Connection& restored,
                                       const std::atomic<bool>* cancelled) {
  const CancelScope live_may_end(live, cancelled), restored_may_end(restored, cancelled);
  RETURN_IF_ERROR(requireCopyOf(live, restored));
  const auto isCancelled = [&] { return cancelled != nullptr && *cancelled; };
  const Error given_up{ErrorCode::kUnavailable, "the comparison was given up: the server ends"};
  const auto checked = checkDatabase(restored);
  if (isCancelled()) return given_up;
  if (!checked) return checked.error();
  if (!checked->ok())
    return Error{
        ErrorCode::kCorrupt,
        "the restored database fails the check, so its backup is worth nothing: " + checked->faults.front()};
  RestoredBackup backup;
  backup.result.chunks_verified = checked->chunks;
  backup.result.undecodable_chunks = checked->undecodable_chunks;
  ASSIGN_OR_RETURN(backup.made_unix_ns, latestTimeIn(restored));
  // one view of each, so that retention cannot remove chunks between two statements
  ASSIGN_OR_RETURN(const auto live_view, Transaction::view(live));
  ASSIGN_OR_RETURN(const auto restored_view, Transaction::view(restored));
  ASSIGN_OR_RETURN(const auto sessions,
                   restored.prepare(std::string(kComparedColumns) + " ORDER BY s.number").all(comparedOf));
  for (const ComparedSession& session : sessions) {
    if (isCancelled()) return given_up;
    ASSIGN_OR_RETURN(const auto in_live,
                     live.query(std::string(kComparedColumns) + " WHERE s.id = ?", ByteView(session.id))
                         .first(comparedOf));
    if (!in_live) continue;  // erased since
    const auto end = checked->decodable_before.find(session.id);
    ASSIGN_OR_RETURN(const std::uint64_t chunks,
                     coveredOf(live, restored, *in_live, session,
                               end != checked->decodable_before.end() ? end->second : UINT64_MAX));
    if (chunks > 0) backup.result.covered.push_back({session.id, chunks});
  }
  return backup;
}

Status recordRestored(Connection& writer, const RestoredBackup& backup, std::int64_t now_unix_ns) {
  SessionStore sessions(writer);
  for (const auto& [session, chunks] : backup.result.covered)
    RETURN_IF_ERROR(sessions.markSafe(session, chunks));
  MetaStore meta(writer);
  const std::int64_t made =
      backup.made_unix_ns > 0 ? std::min(backup.made_unix_ns, now_unix_ns) : now_unix_ns;
  ASSIGN_OR_RETURN(const auto known, meta.get("backup_unix_ns"));
  if (known && std::strtoll(known->c_str(), nullptr, 10) >= made) return {};
  return meta.set("backup_unix_ns", std::to_string(made));
}

}  // namespace needlelab
