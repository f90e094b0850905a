#include "db/backup/check.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/teaching/attempt_sums.h"

namespace needlelab {
namespace {

/// Runs a pragma; each row is a fault, except a single "ok".
Status collect(Connection& connection, std::string_view pragma, std::string_view prefix,
               std::vector<std::string>& faults) {
  auto rows = connection.prepare(pragma);
  for (;;) {
    const auto row = rows.step();
    if (!row) {
      // the database is too damaged for this check, which is itself a finding
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
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return ids;
    if (const auto id = uuidOf(textOf(rows.bytes(0)))) ids.push_back(*id);
    check.bytes += rows.natural(1);
  }
}

}  // namespace

Result<DatabaseCheck> checkDatabase(Connection& connection) {
  DatabaseCheck check;
  ASSIGN_OR_RETURN(auto view, Transaction::begin(connection, Transaction::Kind::kRead));
  // PostgreSQL enforces its constraints itself; its pages are checked with its own tools (pg_amcheck)
  if (connection.sqlite() != nullptr) {
    RETURN_IF_ERROR(collect(connection, "PRAGMA integrity_check", "integrity: ", check.faults));
    RETURN_IF_ERROR(
        collect(connection, "PRAGMA foreign_key_check", "foreign key broken in table ", check.faults));
  }
  auto foreign = schemaFaults(connection);
  if (!foreign && foreign.error().code != ErrorCode::kCorrupt) return foreign.error();
  if (!foreign) check.faults.push_back(foreign.error().message);
  if (foreign) std::move(foreign->begin(), foreign->end(), std::back_inserter(check.faults));
  if (foreign) {
    const auto sums = AttemptSums(connection).faults(kMaxFaults);
    if (!sums && sums.error().code != ErrorCode::kCorrupt) return sums.error();
    if (!sums) check.faults.push_back(sums.error().message);
    if (sums)
      for (const SumFault& fault : *sums) check.sums.push_back(fault.text);
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
    for (const ChunkFault& fault : session->undecodable) {
      if (check.undecodable.size() < kMaxFaults) check.undecodable.push_back(fault.text);
    }
    check.undecodable_chunks += session->undecodable_chunks;
    if (!session->undecodable.empty()) check.decodable_before[id] = session->undecodable.front().seq;
  }
  return check;
}

}  // namespace needlelab
