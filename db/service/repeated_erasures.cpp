// Erasures that a start makes up for, before anybody is served: those that a restored database does not know,
// and what an earlier version left.
#include <fmt/core.h>

#include <cstdint>
#include <exception>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "db/audit.h"
#include "db/erasure.h"
#include "db/free_parts.h"
#include "db/people.h"
#include "db/schema.h"
#include "db/service/erasures.h"
#include "db/session_words.h"

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

/// Numbers and descriptions of the sessions that were erased and have their profile.
Result<std::vector<std::pair<std::int64_t, std::string>>> keepingProfiles(Connection& writer) {
  // with a connection of its own: a page that cannot be read must not stop the writer, and `check` says it
  std::optional<Connection> opened;
  if (writer.sqlite() != nullptr) {
    ASSIGN_OR_RETURN(opened, Connection::open(writer.path(), {.mode = Connection::Mode::kReader}));
  }
  return (opened ? *opened : writer)
      .query("SELECT number, description FROM sessions WHERE erased = 1 AND profile_json <> ?",
             kErasedProfile)
      .all([](const Statement& row) {
        return std::pair{row.integer(0), std::string(textOf(row.bytes(1)))};
      });
}

/// Takes the profile and what the station wrote in words of its own out of sessions that an earlier version
/// erased: it left them. Once for a database (`erased_profiles_cleared` in `meta`), with a line of the audit
/// log if there are such sessions.
Status clearOlderErasures(Connection& writer, std::int64_t now_unix_ns) {
  constexpr std::string_view kCleared = "erased_profiles_cleared";
  ASSIGN_OR_RETURN(const auto cleared, MetaStore(writer).get(kCleared));
  if (cleared) return {};
  const auto sessions = keepingProfiles(writer);
  if (!sessions) return {};
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  for (const auto& [number, stored] : *sessions) {
    pb::SessionDescription description;
    const bool is_read = description.ParseFromString(stored);  // if not, `check` says it
    clearStationWords(description);
    RETURN_IF_ERROR(writer.run("UPDATE sessions SET description = ?, profile_json = ? WHERE number = ?",
                               viewOf(is_read ? description.SerializeAsString() : stored), kErasedProfile,
                               number));
  }
  if (!sessions->empty()) {
    RETURN_IF_ERROR(MetaStore(writer).set(kFreePartsKey, "1"));
    RETURN_IF_ERROR(AuditStore(writer).add(
        {0, now_unix_ns, kServerName, "person erase", "",
         fmt::format("completed: {} sessions that an earlier version erased had kept their profiles",
                     sessions->size())}));
  }
  RETURN_IF_ERROR(MetaStore(writer).set(kCleared, "1"));
  return transaction.commit();
}

}  // namespace

Result<std::size_t> eraseBeforeServing(Connection& writer, std::int64_t now_unix_ns,
                                       const ErasureStore::FreeRoom& free_room) {
  // each part is a transaction, which what is thrown undoes
  try {
    RETURN_IF_ERROR(clearOlderErasures(writer, now_unix_ns));
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
