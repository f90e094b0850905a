/// Sessions whose trainee the server did not know when they came, or whose trainee's code nobody gave, until
/// a manager assigns them to the right person (migrations/0001_first.sql).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

/// SQL: the numbers of the sessions that wait for a manager.
inline constexpr std::string_view kWaitingSessions =
    "(SELECT session FROM unknown_trainees WHERE by_whom IS NULL)";

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class UnknownTraineeStore {
 public:
  explicit UnknownTraineeStore(Connection& connection) : connection_(connection) {}

  /// Flags a new session if nobody has its trainee's name; or if the trainee has a code, or the lab requires
  /// codes, and not `code_checked`; or if it `may_be_erased` (ErasureStore::Owner). Sessions without a name
  /// or of kGuestName are nobody's.
  Status flag(const Uuid& session, bool code_checked, bool may_be_erased);
  /// Gives a flagged session to `trainee`, a person or kGuestName; it counts as that person's from now on,
  /// also if it had that person's name already. A session that was assigned before may be assigned again.
  /// `was`: whose it is now, as the manager saw it; nothing: whoever's. Returns whose it was. kNotFound:
  /// session, person; kConflict: not `was`'s any more; kInvalidInput: still open, erased, it was never
  /// flagged, or both it and the account came before the erasure of a person with that name.
  Result<std::string> assign(const Uuid& session, const std::string& trainee,
                             const std::optional<std::string>& was, const std::string& by,
                             std::int64_t now_unix_ns);

 private:
  Connection& connection_;
};

}  // namespace needlelab
