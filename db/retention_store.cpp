// The steps by which a recording is thinned or deleted. Each is one transaction of the writer.
#include "db/retention_store.h"

#include "common/gesture/chunk.h"
#include "common/gesture/thinning.h"
#include "db/audit_store.h"
#include "db/session_row.h"

namespace needlelab {
namespace {

Error changedMeanwhile(const Uuid& session, const std::string& what) {
  return {ErrorCode::kUnavailable, "session " + uuidText(session) + ": " + what + ": it is left as it is"};
}

/// The session's row, when it is closed and may be touched.
Result<SessionRow> closedSession(Connection& connection, const Uuid& session) {
  const auto found = findSession(connection, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  if ((*found)->state == pb::SESSION_OPEN || !(*found)->hash)
    return changedMeanwhile(session, "is not closed");
  return **found;
}

Result<std::int64_t> oneNumber(Statement query) {
  const auto row = query.step();
  if (!row) return row.error();
  return *row ? query.integer(0) : 0;
}

/// What an administrator changed during a run of hours holds from then on.
Status isWanted(Connection& connection, const DueRecording& due) {
  const auto all = RetentionStore(connection).policies();
  if (!all) return all.error();
  const pb::RetentionPolicy* now = nullptr;
  for (const auto& policy : *all) {
    if (policy.exercise_id() == due.exercise_id || (policy.exercise_id().empty() && now == nullptr))
      now = &policy;
  }
  if (now != nullptr && now->SerializeAsString() == due.policy.SerializeAsString()) return {};
  return changedMeanwhile(due.session, "the policy of its exercise was changed during the run");
}

/// Asked in the very transaction that gives the original up.
Status isSafe(Connection& connection, const DueRecording& due, const SessionRow& row) {
  if (due.policy.without_backup()) return {};
  const auto safe =
      oneNumber(connection.query("SELECT safe_chunks >= chunks FROM sessions WHERE number = ?", row.number));
  if (!safe) return safe.error();
  return *safe == 1 ? Status() : Status(changedMeanwhile(due.session, "no verified backup covers it"));
}

Status note(Connection& connection, const DueRecording& due, const char* action, const std::string& by_whom,
            std::int64_t now_unix_ns) {
  return AuditStore(connection).add({0, now_unix_ns, by_whom, action, uuidText(due.session), due.reason});
}

}  // namespace

Status RetentionStore::beginDerived(const Uuid& session, double rate_hz, std::int64_t now_unix_ns) {
  const auto row = closedSession(connection_, session);
  if (!row) return row.error();
  if (row->recording != StoredRecording::Kind::kOriginal)
    return changedMeanwhile(session, "its original is gone");
  return connection_.run(
      "INSERT INTO derived_recordings (session, complete, original_hash, method, rate_hz, created_unix_ns)"
      " VALUES (?, 0, ?, ?, ?, ?)",
      row->number, ByteView(*row->hash), kThinningMethod, rate_hz, now_unix_ns);
}

Status RetentionStore::appendDerived(const Uuid& session, std::uint64_t seq, ByteView bytes) {
  const auto row = closedSession(connection_, session);
  if (!row) return row.error();
  const auto info = inspectChunk(bytes);
  if (!info) return info.error();
  if (auto done = connection_.run("UPDATE derived_recordings SET chunks = chunks + 1, samples = samples + ?, "
                                  "stored_bytes = stored_bytes + ?"
                                  " WHERE session = ? AND complete = 0 AND chunks = ?",
                                  info->count, static_cast<std::uint64_t>(bytes.size()), row->number, seq);
      !done)
    return done;
  if (connection_.changes() != 1)
    return changedMeanwhile(session, "its thinned recording is not being written");
  return connection_.run("INSERT INTO derived_chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                         row->number, seq, info->count, stationCrcOf(bytes), bytes);
}

Result<DerivedSums> RetentionStore::sums(const Uuid& session) {
  const auto row = closedSession(connection_, session);
  if (!row) return row.error();
  const auto chunks =
      oneNumber(connection_.query("SELECT chunks FROM derived_recordings WHERE session = ?", row->number));
  if (!chunks) return chunks.error();
  DerivedSums sums;
  SessionHash hash;
  ChunkScan scan(connection_, "thinned recording of session " + uuidText(session),
                 {StoredRecording::Kind::kThinned, row->number, static_cast<std::uint64_t>(*chunks)}, 0,
                 UINT64_MAX);
  for (;;) {
    const auto item = scan.next();
    if (!item) return item.error();
    if (!*item) break;
    if ((*item)->fault) return *(*item)->fault;
    hash.update((*item)->bytes);
    ++sums.chunks;
    sums.samples += (*item)->samples;
    sums.stored_bytes += (*item)->bytes.size();
  }
  sums.hash = hash.digest();
  return sums;
}

Status RetentionStore::switchToDerived(const DueRecording& due, const DerivedSums& sums, const Bytes& crcs,
                                       const std::string& by_whom, std::int64_t now_unix_ns) {
  const auto row = closedSession(connection_, due.session);
  if (!row) return row.error();
  if (row->recording != StoredRecording::Kind::kOriginal)
    return changedMeanwhile(due.session, "its original is gone");
  if (auto wanted = isWanted(connection_, due); !wanted) return wanted;
  if (auto safe = isSafe(connection_, due, *row); !safe) return safe;
  if (crcs.size() != 4 * row->chunks)
    return changedMeanwhile(due.session, "its chunks are not those that were read");
  if (auto done = connection_.run(
          "UPDATE derived_recordings SET complete = 1, hash = ? WHERE session = ? AND complete = 0 AND"
          " original_hash = ? AND chunks = ? AND samples = ? AND stored_bytes = ? AND chunks > 0",
          ByteView(sums.hash), row->number, ByteView(*row->hash), sums.chunks, sums.samples,
          sums.stored_bytes);
      !done)
    return done;
  if (connection_.changes() != 1)
    return changedMeanwhile(due.session, "its thinned recording is not the one that was written");
  if (auto done = connection_.run("UPDATE sessions SET recording = 2 WHERE number = ?", row->number); !done)
    return done;
  if (auto done = connection_.run(
          "INSERT INTO removed_originals (session, removed_unix_ns, reason, by_whom, leftover,"
          " crcs) VALUES (?, ?, ?, ?, 1, ?)",
          row->number, now_unix_ns, due.reason, by_whom, ByteView(crcs));
      !done)
    return done;
  return note(connection_, due, "retention thin", by_whom, now_unix_ns);
}

Status RetentionStore::markDeleted(const DueRecording& due, const Bytes& crcs, const std::string& by_whom,
                                   std::int64_t now_unix_ns) {
  const auto row = closedSession(connection_, due.session);
  if (!row) return row.error();
  if (row->recording == StoredRecording::Kind::kDeleted)
    return changedMeanwhile(due.session, "it is deleted already");
  if (auto wanted = isWanted(connection_, due); !wanted) return wanted;
  if (auto safe = isSafe(connection_, due, *row); !safe) return safe;
  if (row->recording == StoredRecording::Kind::kOriginal) {
    if (crcs.size() != 4 * row->chunks)
      return changedMeanwhile(due.session, "its chunks are not those that were read");
    if (auto done = connection_.run(
            "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns, reason,"
            " by_whom, leftover, crcs) VALUES (?, ?, ?, ?, ?, 1, ?)",
            row->number, now_unix_ns, now_unix_ns, due.reason, by_whom, ByteView(crcs));
        !done)
      return done;
  } else if (auto done =
                 connection_.run("UPDATE removed_originals SET deleted_unix_ns = ?, reason = ?, by_whom = ?,"
                                 " leftover = 1 WHERE session = ?",
                                 now_unix_ns, due.reason, by_whom, row->number);
             !done) {
    return done;
  }
  if (auto done =
          connection_.run("UPDATE derived_recordings SET complete = 0 WHERE session = ?", row->number);
      !done)
    return done;
  if (auto done = connection_.run("UPDATE sessions SET recording = 3 WHERE number = ?", row->number); !done)
    return done;
  return note(connection_, due, "retention delete", by_whom, now_unix_ns);
}

Result<std::vector<Uuid>> RetentionStore::leftovers() {
  std::vector<Uuid> sessions;
  auto rows = connection_.prepare(
      "SELECT s.id FROM sessions s JOIN (SELECT session FROM removed_originals WHERE leftover = 1"
      " UNION SELECT session FROM derived_recordings WHERE complete = 0) l ON l.session = s.number ORDER BY "
      "s.number");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return sessions;
    if (const auto id = uuidOf(textOf(rows.bytes(0)))) sessions.push_back(*id);
  }
}

Status RetentionStore::checkLeftovers(const Uuid& session) {
  const auto row = closedSession(connection_, session);
  if (!row) return row.error();
  const std::string name = "session " + uuidText(session) + ", what is left of a recording that was removed";
  for (const auto kind : {StoredRecording::Kind::kOriginal, StoredRecording::Kind::kThinned}) {
    if (kind == row->recording) continue;
    StoredRecording left{kind, row->number, 0};
    // rows go from the last on: those that are left begin with the first
    const auto count = oneNumber(connection_.query(
        "SELECT coalesce(max(seq) + 1, 0) FROM " + std::string(left.table()) + " WHERE session = ?",
        row->number));
    if (!count) return count.error();
    left.chunks = static_cast<std::uint64_t>(*count);
    ChunkScan scan(connection_, name, left, 0, UINT64_MAX);
    for (;;) {
      const auto item = scan.next();
      if (!item) return item.error();
      if (!*item) break;
      if ((*item)->fault) return *(*item)->fault;
    }
  }
  return {};
}

Result<bool> RetentionStore::removeSome(const Uuid& session, std::uint32_t rows) {
  const auto row = closedSession(connection_, session);
  if (!row) return row.error();
  // the last ones: where they began and where they end shows in what is left
  const auto remove = [&](const std::string& table) {
    return connection_.run("DELETE FROM " + table + " WHERE session = ?1 AND seq IN (SELECT seq FROM " +
                               table + " WHERE session = ?1 ORDER BY seq DESC LIMIT ?2)",
                           row->number, rows);
  };
  if (row->recording != StoredRecording::Kind::kOriginal) {
    if (auto done = remove("chunks"); !done) return done.error();
    if (connection_.changes() != 0) return true;
  }
  if (row->recording != StoredRecording::Kind::kThinned) {
    if (auto done = remove("derived_chunks"); !done) return done.error();
    if (connection_.changes() != 0) return true;
    if (auto done =
            connection_.run("DELETE FROM derived_recordings WHERE session = ? AND complete = 0", row->number);
        !done)
      return done.error();
  }
  if (auto done = connection_.run("UPDATE removed_originals SET leftover = 0 WHERE session = ?", row->number);
      !done)
    return done.error();
  return false;
}

Result<RetentionStore::Space> RetentionStore::space() {
  Space space;
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
