#include "db/check.h"

#include "db/session_row.h"
#include "db/session_store.h"
#include "db/transaction.h"

namespace needlelab {
namespace {

/// Runs a pragma whose rows are faults, except a single "ok".
Status collect(Connection& connection, std::string_view pragma, std::string_view prefix,
               std::vector<std::string>& faults) {
  auto rows = connection.prepare(pragma);
  for (;;) {
    const auto row = rows.step();
    if (!row) {
      // too damaged to be examined any further: that is a finding, too
      if (row.error().code != ErrorCode::kCorrupt) return row.error();
      faults.push_back(row.error().message);
      return {};
    }
    if (!*row || faults.size() >= kMaxFaults) return {};
    if (const std::string text = rows.text(0); text != "ok") faults.push_back(std::string(prefix) + text);
  }
}

Result<std::vector<Uuid>> allSessions(Connection& connection, DatabaseCheck& check) {
  std::vector<Uuid> ids;
  auto rows = connection.prepare(
      "SELECT s.id, coalesce(p.stored_bytes, s.stored_bytes) FROM sessions s"
      " LEFT JOIN session_progress p ON p.session = s.number ORDER BY s.number");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return ids;
    if (const auto id = uuidOf(textOf(rows.bytes(0)))) ids.push_back(*id);
    check.bytes += rows.natural(1);
  }
}

}  // namespace

Result<DatabaseCheck> checkDatabase(Connection& connection) {
  DatabaseCheck check;
  auto view = Transaction::begin(connection, Transaction::Kind::kRead);
  if (!view) return view.error();
  if (auto done = collect(connection, "PRAGMA integrity_check", "integrity: ", check.faults); !done)
    return done.error();
  if (auto done =
          collect(connection, "PRAGMA foreign_key_check", "foreign key broken in table ", check.faults);
      !done) {
    return done.error();
  }
  const auto ids = allSessions(connection, check);
  if (!ids) {
    if (ids.error().code != ErrorCode::kCorrupt) return ids.error();
    check.faults.push_back(ids.error().message);
    return check;
  }
  for (const Uuid& id : *ids) {
    if (check.faults.size() >= kMaxFaults) break;
    const auto session = SessionStore(connection).verify(id);
    if (!session) {
      if (session.error().code != ErrorCode::kCorrupt) return session.error();
      check.faults.push_back(session.error().message);
      continue;
    }
    ++check.sessions;
    check.chunks += session->chunks;
    for (const std::string& fault : session->faults) {
      if (check.faults.size() < kMaxFaults) check.faults.push_back(fault);
    }
  }
  return check;
}

}  // namespace needlelab
