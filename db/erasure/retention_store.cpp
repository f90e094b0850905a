// The steps that thin or delete a recording. Each is one transaction of the writer.
#include "db/erasure/retention_store.h"

#include <algorithm>
#include <utility>

#include "common/gesture/chunk.h"
#include "common/gesture/thinning.h"
#include "db/audit/audit.h"
#include "db/sessions/session_rows.h"

namespace needlelab {
namespace {

Error changedConcurrently(const Uuid& session, const std::string& what) {
  return {ErrorCode::kUnavailable, "session " + uuidText(session) + ": " + what + ": it is left as it is"};
}

/// The session's row, if it is closed and retention may change it.
Result<SessionRow> closedSession(Connection& connection, const Uuid& session) {
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection, session));
  if (row.state == pb::SESSION_OPEN || !row.hash) return changedConcurrently(session, "is not closed");
  return row;
}

Result<std::int64_t> oneNumber(Statement query) {
  ASSIGN_OR_RETURN(const bool row, query.step());
  return row ? query.integer(0) : 0;
}

/// An error when the policy changed during the run, which may take hours.
Status checkPolicyUnchanged(Connection& connection, const DueRecording& due) {
  ASSIGN_OR_RETURN(const auto all, RetentionStore(connection).policies());
  const pb::RetentionPolicy* now = nullptr;
  for (const auto& policy : all) {
    if (policy.exercise_id() == due.exercise_id || (policy.exercise_id().empty() && now == nullptr))
      now = &policy;
  }
  if (now != nullptr && now->SerializeAsString() == due.policy.SerializeAsString()) return {};
  return changedConcurrently(due.session, "the policy of its exercise was changed during the run");
}

/// Checks the backup in the same transaction that gives up the original.
Status isSafe(Connection& connection, const DueRecording& due, const SessionRow& row) {
  if (due.policy.without_backup()) return {};
  ASSIGN_OR_RETURN(
      const auto safe,
      oneNumber(connection.query("SELECT safe_chunks >= chunks FROM sessions WHERE number = ?", row.number)));
  return safe == 1 ? Status() : Status(changedConcurrently(due.session, "no verified backup covers it"));
}

Status note(Connection& connection, const DueRecording& due, const char* action, const Doer& by_whom,
            std::int64_t now_unix_ns) {
  return AuditStore(connection)
      .add({0, now_unix_ns, by_whom.name, action, uuidText(due.session), due.reason});
}

}  // namespace

Status RetentionStore::beginDerived(const Uuid& session, double rate_hz, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, session));
  if (row.recording != StoredRecording::Kind::kOriginal)
    return changedConcurrently(session, "its original is gone");
  return connection_.run(
      "INSERT INTO derived_recordings (session, complete, original_hash, method,"
      " rate_hz, created_unix_ns) VALUES (?, 0, ?, ?, ?, ?)",
      row.number, ByteView(*row.hash), kThinningMethod, rate_hz, now_unix_ns);
}

Status RetentionStore::appendDerived(const Uuid& session, std::uint64_t seq, ByteView bytes) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, session));
  ASSIGN_OR_RETURN(const auto info, inspectChunk(bytes));
  RETURN_IF_ERROR(
      connection_.run("UPDATE derived_recordings"
                      " SET chunks = chunks + 1, samples = samples + ?,"
                      " stored_bytes = stored_bytes + ? WHERE session = ? AND complete = 0"
                      " AND chunks = ?",
                      info.count, static_cast<std::uint64_t>(bytes.size()), row.number, seq));
  if (connection_.changes() != 1)
    return changedConcurrently(session, "its thinned recording is not being written");
  return connection_.run("INSERT INTO derived_chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                         row.number, seq, info.count, stationCrcOf(bytes), bytes);
}

Result<DerivedSums> RetentionStore::sums(const Uuid& session) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, session));
  ASSIGN_OR_RETURN(
      const auto chunks,
      oneNumber(connection_.query("SELECT chunks FROM derived_recordings WHERE session = ?", row.number)));
  DerivedSums sums;
  SessionHash hash;
  ChunkScan scan(connection_, "thinned recording of session " + uuidText(session),
                 {StoredRecording::Kind::kThinned, row.number, static_cast<std::uint64_t>(chunks)}, 0,
                 UINT64_MAX);
  for (;;) {
    ASSIGN_OR_RETURN(const auto item, scan.next());
    if (!item) break;
    if (item->fault) return *item->fault;
    hash.update(item->bytes);
    ++sums.chunks;
    sums.samples += item->samples;
    sums.stored_bytes += item->bytes.size();
  }
  sums.hash = hash.digest();
  return sums;
}

Status RetentionStore::switchToDerived(const DueRecording& due, const DerivedSums& sums, const Bytes& crcs,
                                       const Doer& by_whom, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, due.session));
  if (row.recording != StoredRecording::Kind::kOriginal)
    return changedConcurrently(due.session, "its original is gone");
  RETURN_IF_ERROR(checkPolicyUnchanged(connection_, due));
  RETURN_IF_ERROR(isSafe(connection_, due, row));
  if (crcs.size() != 4 * row.chunks)
    return changedConcurrently(due.session, "its chunks are not those that were read");
  RETURN_IF_ERROR(connection_.run(
      "UPDATE derived_recordings SET complete = 1, hash = ? WHERE session = ?"
      " AND complete = 0 AND original_hash = ? AND chunks = ? AND samples = ?"
      " AND stored_bytes = ? AND chunks > 0",
      ByteView(sums.hash), row.number, ByteView(*row.hash), sums.chunks, sums.samples, sums.stored_bytes));
  if (connection_.changes() != 1)
    return changedConcurrently(due.session, "its thinned recording is not the one that was written");
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET recording = 2 WHERE number = ?", row.number));
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO removed_originals (session, removed_unix_ns, reason, by_whom,"
                      " leftover, crcs) VALUES (?, ?, ?, ?, 1, ?)",
                      row.number, now_unix_ns, due.reason, by_whom.name, ByteView(crcs)));
  return note(connection_, due, "retention thin", by_whom, now_unix_ns);
}

Status RetentionStore::markDeleted(const DueRecording& due, const Bytes& crcs, const Doer& by_whom,
                                   std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, due.session));
  if (row.recording == StoredRecording::Kind::kDeleted)
    return changedConcurrently(due.session, "it is deleted already");
  RETURN_IF_ERROR(checkPolicyUnchanged(connection_, due));
  RETURN_IF_ERROR(isSafe(connection_, due, row));
  if (row.recording == StoredRecording::Kind::kOriginal) {
    if (crcs.size() != 4 * row.chunks)
      return changedConcurrently(due.session, "its chunks are not those that were read");
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns,"
                        " reason, by_whom, leftover, crcs) VALUES (?, ?, ?, ?, ?, 1, ?)",
                        row.number, now_unix_ns, now_unix_ns, due.reason, by_whom.name, ByteView(crcs)));
  } else if (auto done = connection_.run(
                 "UPDATE removed_originals"
                 " SET deleted_unix_ns = ?, reason = ?, by_whom = ?, leftover = 1 WHERE session = ?",
                 now_unix_ns, due.reason, by_whom.name, row.number);
             !done) {
    return done;
  }
  RETURN_IF_ERROR(
      connection_.run("UPDATE derived_recordings SET complete = 0 WHERE session = ?", row.number));
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET recording = 3 WHERE number = ?", row.number));
  return note(connection_, due, "retention delete", by_whom, now_unix_ns);
}

Result<std::vector<Uuid>> RetentionStore::leftovers() {
  std::vector<Uuid> sessions;
  auto rows = connection_.prepare(
      "SELECT s.id FROM sessions s JOIN (SELECT session FROM removed_originals"
      " WHERE leftover = 1 UNION SELECT session FROM derived_recordings"
      " WHERE complete = 0) l ON l.session = s.number ORDER BY s.number");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return sessions;
    if (const auto id = uuidOf(textOf(rows.bytes(0)))) sessions.push_back(*id);
  }
}

Result<RetentionStore::RemovableRows> RetentionStore::checkSome(const Uuid& session, std::uint32_t rows) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, session));
  const std::string name = "session " + uuidText(session) + ", what is left of a recording that was removed";
  RemovableRows looked;
  // in the same order as removeSome()
  for (const auto kind : {StoredRecording::Kind::kOriginal, StoredRecording::Kind::kThinned}) {
    if (kind == row.recording) continue;
    StoredRecording left{kind, row.number, 0};
    // rows are removed last to first, so the remaining ones begin with the first
    ASSIGN_OR_RETURN(const auto count,
                     oneNumber(connection_.query("SELECT coalesce(max(seq) + 1, 0) FROM " +
                                                     std::string(left.table()) + " WHERE session = ?",
                                                 row.number)));
    if (count == 0) continue;
    if (looked.rows > 0) {
      looked.more = true;
      break;
    }
    left.chunks = static_cast<std::uint64_t>(count);
    looked.rows = static_cast<std::uint32_t>(std::min<std::uint64_t>(left.chunks, rows));
    looked.more = looked.rows < left.chunks;
    ChunkScan scan(connection_, name, left, left.chunks - looked.rows, UINT64_MAX);
    for (;;) {
      ASSIGN_OR_RETURN(const auto item, scan.next());
      if (!item) break;
      if (item->damaged()) return *item->fault;
    }
  }
  return looked;
}

Result<bool> RetentionStore::removeSome(const Uuid& session, std::uint32_t rows) {
  ASSIGN_OR_RETURN(const auto row, closedSession(connection_, session));
  // remove the last ones, so that the remaining rows still show where they begin
  const auto remove = [&](const std::string& table) {
    return connection_.run("DELETE FROM " + table + " WHERE session = ?1 AND seq IN (SELECT seq FROM " +
                               table + " WHERE session = ?1 ORDER BY seq DESC LIMIT ?2)",
                           row.number, rows);
  };
  if (row.recording != StoredRecording::Kind::kOriginal) {
    RETURN_IF_ERROR(remove("chunks"));
    if (connection_.changes() != 0) return true;
  }
  if (row.recording != StoredRecording::Kind::kThinned) {
    RETURN_IF_ERROR(remove("derived_chunks"));
    if (connection_.changes() != 0) return true;
    RETURN_IF_ERROR(
        connection_.run("DELETE FROM derived_recordings WHERE session = ? AND complete = 0", row.number));
  }
  RETURN_IF_ERROR(connection_.run("UPDATE removed_originals SET leftover = 0 WHERE session = ?", row.number));
  return false;
}

Result<RetentionStore::Space> RetentionStore::space() {
  Space space;
  if (connection_.sqlite() == nullptr) {
    ASSIGN_OR_RETURN(const auto bytes,
                     oneNumber(connection_.prepare("SELECT pg_database_size(current_database())")));
    space.database_bytes = static_cast<std::uint64_t>(bytes);
    return space;
  }
  const auto page = oneNumber(connection_.prepare("PRAGMA page_size"));
  const auto pages = oneNumber(connection_.prepare("PRAGMA page_count"));
  const auto free = oneNumber(connection_.prepare("PRAGMA freelist_count"));
  for (const auto* number : {&page, &pages, &free}) {
    if (!*number) return number->error();
  }
  space.database_bytes = static_cast<std::uint64_t>(*page * *pages);
  space.free_bytes = static_cast<std::uint64_t>(*page * *free);
  return space;
}

}  // namespace needlelab
