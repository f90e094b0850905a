// Erasures that a start makes up for, before anybody is served: those that a restored database does not know.
#include <fmt/core.h>

#include <cstdint>
#include <exception>
#include <filesystem>
#include <set>
#include <string>

#include "db/audit.h"
#include "db/erasure.h"
#include "db/person_name.h"
#include "db/service/erasures.h"

namespace needlelab {
namespace {

/// Repeats the erasures of DIR/erasures that this database, a restored backup, does not know: a transaction
/// each, with a line of the audit log. Leaves the last administrator, whom toRepeat() goes on naming; the
/// database knows all others from then on. Returns how many.
Result<std::size_t> repeatErasures(Connection& writer, std::int64_t now_unix_ns,
                                   const ErasureStore::FreeRoom& free_room) {
  ErasureStore store(writer, free_room);
  const auto repeat = store.toRepeat(writer.path().parent_path());
  // the server's log and `check` report a missing key or a broken list
  if (!repeat && repeat.error().code == ErrorCode::kCorrupt) return std::size_t{0};
  if (!repeat) return repeat.error();
  std::size_t count = 0;
  std::set<std::string> stay;
  for (const ErasureToRepeat& one : *repeat) {
    if (!one.restored) continue;
    (void)writer.emptyLog(0);  // a start before this one may have been killed, and its log has the room
    RETURN_IF_ERROR(checkRoomToErase(writer, one.name));
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
    // nobody is served yet, so that one long transaction holds up nothing, and nobody reads what is left
    const auto done = store.eraseRows(one.name, one.line, kServerName, "repeated after a restore",
                                      now_unix_ns, one.line.with_waiting);
    // the last administrator, or a name that an erasure before this one took: they stay as they are
    if (!done && (done.error().code == ErrorCode::kDenied || done.error().code == ErrorCode::kNotFound)) {
      if (done.error().code == ErrorCode::kDenied) stay.insert(one.line.pseudonym);
      continue;
    }
    if (!done) return done.error();
    const pb::Erasure& erased = done->erasure;
    RETURN_IF_ERROR(
        AuditStore(writer).add({0, now_unix_ns, kServerName, "person erase", one.line.pseudonym,
                                fmt::format("repeated after a restore: {} sessions, {} recordings, {} scores",
                                            erased.sessions(), erased.recordings(), erased.scores())}));
    RETURN_IF_ERROR(transaction.commit());
    ++count;
  }
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(store.rememberList(writer.path().parent_path(), stay, now_unix_ns));
  RETURN_IF_ERROR(transaction.commit());
  return count;
}

}  // namespace

Result<std::size_t> eraseBeforeServing(Connection& writer, std::int64_t now_unix_ns,
                                       const ErasureStore::FreeRoom& free_room) {
  // each erasure is a transaction, which what is thrown undoes
  try {
    return repeatErasures(writer, now_unix_ns, free_room);
  } catch (const std::exception& thrown) {
    return Error{ErrorCode::kFailed,
                 fmt::format("{}: people are in this database who were erased, and are erased anew before "
                             "anybody is served, which failed inside ({}): most likely there is not enough "
                             "memory. Nothing of that erasure is stored; give the machine, or this "
                             "program's unit, more memory, then start again",
                             writer.path().parent_path().string(), thrown.what())};
  }
}

}  // namespace needlelab
