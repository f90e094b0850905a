// The policies of retention, which sessions they concern now, and the steps by which a recording is thinned
// or deleted. Each step is one transaction of the writer.
#include "db/retention_store.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "common/base/text.h"
#include "common/gesture/chunk.h"
#include "common/gesture/thinning.h"
#include "db/audit.h"
#include "db/session_rows.h"

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

constexpr std::uint32_t kMostDays = 36'500;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

Status checkPolicy(const pb::RetentionPolicy& policy) {
  const auto bad = [](const std::string& text) {
    return Error{ErrorCode::kInvalidInput, "retention policy, " + text};
  };
  if (!policy.exercise_id().empty()) {
    if (auto valid = checkName("exercise_id", policy.exercise_id()); !valid) return valid;
  }
  const auto days = [&](const char* field, std::uint32_t value) -> Status {
    if (value <= kMostDays) return {};
    return bad(std::string(field) + ": " + std::to_string(value) + ", allowed is 0 to " +
               std::to_string(kMostDays));
  };
  if (auto valid = days("thin_after_days", policy.thin_after_days()); !valid) return valid;
  if (auto valid = days("delete_after_days", policy.delete_after_days()); !valid) return valid;
  const double hz = policy.thin_rate_hz(), factor = policy.thin_coarser();
  if (policy.has_thin_after_days() && !(hz >= 0.1 && hz <= 10'000))
    return bad("thin_rate_hz: " + std::to_string(hz) + ", allowed is 0.1 to 10000");
  if (!policy.has_thin_after_days() && (hz != 0 || (factor != 0 && factor != 1)))
    return bad("thin_rate_hz and thin_coarser: only with thin_after_days");
  if (factor != 0 && !(factor >= 1 && factor <= 1000))
    return bad("thin_coarser: " + std::to_string(factor) + ", allowed is 1 to 1000");
  if (policy.has_thin_after_days() && policy.has_delete_after_days() &&
      policy.delete_after_days() <= policy.thin_after_days()) {
    return bad("delete_after_days: " + std::to_string(policy.delete_after_days()) +
               ", allowed is more than thin_after_days, " + std::to_string(policy.thin_after_days()));
  }
  return {};
}

std::string numberText(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

std::string daysText(std::uint32_t days) {
  return std::to_string(days) + (days == 1 ? " day" : " days");
}

std::string reasonOf(const pb::RetentionPolicy& policy, bool deletes) {
  const std::string what = deletes ? "deleted, " + daysText(policy.delete_after_days())
                                   : "thinned to " + numberText(policy.thin_rate_hz()) + " Hz, " +
                                         daysText(policy.thin_after_days());
  return what + " after it was closed: policy of " +
         (policy.exercise_id().empty() ? "all other exercises" : "exercise " + policy.exercise_id()) +
         ", set by " + policy.by();
}

/// The exercises that have recordings of this kind.
Result<std::vector<std::string>> exercisesWith(Connection& connection, StoredRecording::Kind kind) {
  std::vector<std::string> ids;
  auto rows = connection.query("SELECT DISTINCT exercise_id FROM sessions WHERE recording = ?",
                               static_cast<int>(kind));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return ids;
    ids.push_back(rows.text(0));
  }
}

/// Appends the closed sessions of one exercise that were closed up to `until`.
Status collect(Connection& connection, StoredRecording::Kind kind, const std::string& exercise,
               std::int64_t until, const DueRecording& model, std::vector<DueRecording>& due) {
  auto rows = connection.query(
      "SELECT s.id, s.safe_chunks >= s.chunks, coalesce(d.stored_bytes, s.stored_bytes) FROM sessions s"
      " LEFT JOIN derived_recordings d ON d.session = s.number AND d.complete = 1"
      " WHERE s.recording = ? AND s.exercise_id = ? AND s.closed_unix_ns <= ? AND s.state IN (?, ?)"
      " AND s.hash IS NOT NULL ORDER BY s.closed_unix_ns, s.number",
      static_cast<int>(kind), exercise, until, static_cast<int>(pb::SESSION_COMPLETE),
      static_cast<int>(pb::SESSION_INTERRUPTED));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return {};
    const auto id = uuidOf(textOf(rows.bytes(0)));
    if (!id) continue;
    DueRecording& one = due.emplace_back(model);
    one.session = *id;
    one.exercise_id = exercise;
    one.thinned = kind == StoredRecording::Kind::kThinned;
    one.waits_for_backup = rows.integer(1) == 0 && !model.policy.without_backup();
    one.stored_bytes = rows.natural(2);
  }
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

Status RetentionStore::setPolicy(const pb::RetentionPolicy& policy) {
  if (auto valid = checkPolicy(policy); !valid) return valid;
  const auto optional = [](bool there, auto value) { return there ? std::optional(value) : std::nullopt; };
  const bool thins = policy.has_thin_after_days();
  return connection_.run(
      "INSERT OR REPLACE INTO retention_policies (exercise_id, thin_after_days, thin_rate_hz, thin_coarser,"
      " delete_after_days, without_backup, by_whom, changed_unix_ns) VALUES (?,?,?,?,?,?,?,?)",
      policy.exercise_id(), optional(thins, policy.thin_after_days()), optional(thins, policy.thin_rate_hz()),
      policy.thin_coarser() == 0 ? 1.0 : policy.thin_coarser(),
      optional(policy.has_delete_after_days(), policy.delete_after_days()), policy.without_backup(),
      policy.by(), policy.changed_unix_ns());
}

Status RetentionStore::checkExercise(const std::string& exercise_id) {
  if (exercise_id.empty()) return {};
  constexpr std::size_t kMostNamed = 30;
  std::string names;
  std::size_t count = 0;
  auto rows = connection_.prepare(
      "SELECT id FROM exercises UNION SELECT DISTINCT exercise_id FROM sessions"
      " UNION SELECT exercise_id FROM retention_policies WHERE exercise_id <> '' ORDER BY 1");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) break;
    if (rows.text(0) == exercise_id) return {};
    if (++count <= kMostNamed) names += (names.empty() ? "" : ", ") + std::string(rows.text(0));
  }
  if (count > kMostNamed) names += " and " + std::to_string(count - kMostNamed) + " more";
  return Error{ErrorCode::kInvalidInput,
               "retention policy, exercise_id: '" + exercise_id +
                   "' is no exercise of a curriculum and no session's; there are: " +
                   (names.empty() ? "none yet, import a curriculum first" : names)};
}

Status RetentionStore::removePolicy(const std::string& exercise_id) {
  if (auto done = connection_.run("DELETE FROM retention_policies WHERE exercise_id = ?", exercise_id); !done)
    return done;
  if (connection_.changes() != 0) return {};
  return Error{ErrorCode::kNotFound, exercise_id.empty()
                                         ? "no default policy is set: all is kept already"
                                         : "exercise '" + exercise_id + "' has no policy of its own"};
}

Result<std::vector<pb::RetentionPolicy>> RetentionStore::policies() {
  std::vector<pb::RetentionPolicy> policies;
  auto rows = connection_.prepare(
      "SELECT exercise_id, thin_after_days, thin_rate_hz, thin_coarser, delete_after_days, without_backup, "
      "by_whom,"
      " changed_unix_ns FROM retention_policies ORDER BY exercise_id");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return policies;
    auto& policy = policies.emplace_back();
    policy.set_exercise_id(rows.text(0));
    if (!rows.isNull(1)) {
      policy.set_thin_after_days(static_cast<std::uint32_t>(rows.natural(1)));
      policy.set_thin_rate_hz(rows.real(2));
    }
    policy.set_thin_coarser(rows.real(3));
    if (!rows.isNull(4)) policy.set_delete_after_days(static_cast<std::uint32_t>(rows.natural(4)));
    policy.set_without_backup(rows.integer(5) != 0);
    policy.set_by(rows.text(6));
    policy.set_changed_unix_ns(rows.integer(7));
  }
}

Result<std::vector<DueRecording>> RetentionStore::due(std::int64_t now_unix_ns) {
  const auto all = policies();
  if (!all) return all.error();
  std::map<std::string, pb::RetentionPolicy> of;
  for (const auto& policy : *all) of[policy.exercise_id()] = policy;

  std::vector<DueRecording> due;
  for (const auto kind : {StoredRecording::Kind::kOriginal, StoredRecording::Kind::kThinned}) {
    const auto exercises = exercisesWith(connection_, kind);
    if (!exercises) return exercises.error();
    for (const std::string& exercise : *exercises) {
      auto found = of.find(exercise);
      if (found == of.end()) found = of.find("");
      if (found == of.end()) continue;
      DueRecording model;
      model.policy = found->second;
      const std::size_t first = due.size();
      if (model.policy.has_delete_after_days()) {
        model.deletes = true;
        model.reason = reasonOf(model.policy, true);
        const std::int64_t until = now_unix_ns - model.policy.delete_after_days() * kDay_ns;
        if (auto done = collect(connection_, kind, exercise, until, model, due); !done) return done.error();
      }
      // a recording is thinned once; its original cannot be thinned anew
      if (!model.policy.has_thin_after_days() || kind != StoredRecording::Kind::kOriginal) continue;
      const std::size_t deleted = due.size() - first;
      model.deletes = false;
      model.reason = reasonOf(model.policy, false);
      const std::int64_t until = now_unix_ns - model.policy.thin_after_days() * kDay_ns;
      if (auto done = collect(connection_, kind, exercise, until, model, due); !done) return done.error();
      // the oldest ones come in both lists: they are deleted, not thinned
      due.erase(due.begin() + static_cast<std::ptrdiff_t>(first + deleted),
                due.begin() + static_cast<std::ptrdiff_t>(first + 2 * deleted));
    }
  }
  return due;
}

}  // namespace needlelab
