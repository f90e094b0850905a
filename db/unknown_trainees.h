/// Whose a session is that a station brings, and sessions that wait for a manager: whose trainee nobody knew
/// when they came.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/people.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// SQL: the numbers of the sessions that wait for a manager.
inline constexpr std::string_view kWaitingSessions =
    "(SELECT session FROM unknown_trainees WHERE by_whom IS NULL)";

/// Whose a new session is.
struct SessionTrainee {
  std::string ref;              ///< sessions.trainee
  bool erased = false;          ///< an erased person's: nothing of it is kept
  bool waits = false;           ///< for a manager
  bool code_unchecked = false;  ///< why: nobody gave the account's code; else nobody had the name
  bool begin_unsure = false;    ///< why: the station's clock was wrong
  bool not_assigned = false;    ///< why: the exercise is assigned only, and not to this trainee
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class UnknownTraineeStore {
 public:
  explicit UnknownTraineeStore(Connection& connection) : connection_(connection) {}

  /// By the description's trainee: "@" and a UUID, or a name as it was typed. A name that no account has gets
  /// a row of its own, under which its sessions wait. It waits there, too, where it began before a
  /// person of this name was erased (ErasureStore::wasErased), also if another account has the name now.
  /// Without trainee, or with kGuestName, it is no person's.
  Result<SessionTrainee> traineeOf(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Whether the session cannot have begun when its station says: more than 5 minutes after it came; or
  /// before the last time that the station knows; or, where the station knows none, more than 5 minutes
  /// before the newest closed session of the station.
  /// A description that does not say its clock is believed.
  Result<bool> isBeginUnsure(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Whether the exercise is for those alone to whom it is assigned, and is not assigned to the trainee now.
  Result<bool> lacksAssignment(std::string_view trainee, std::string_view exercise_id);
  /// Whether the trainee that a station gives may be the one of the stored session `number`: a manager may
  /// have assigned it, and a name may have been given to somebody meanwhile.
  Result<bool> isOf(std::int64_t number, std::string_view trainee);
  /// Makes a new session wait.
  Status flag(const Uuid& session, const SessionTrainee& trainee);
  /// For a new session of an erased person: closes and marks it, so that it stays empty.
  Status leaveEmpty(const Uuid& session, std::int64_t now_unix_ns);
  /// Gives a flagged session to `trainee`, a person's ref or kGuestName; it counts as that person's from now
  /// on, also if it was that person's already. A session that was assigned before may be assigned again. Of
  /// an exam the attempts of both are counted again (AttemptStore::countExam). `started_unix_ns`: when it
  /// began, of one with begin_unsure; nothing: as the station says. `was`: whose it is now, as the manager
  /// saw it (a name or ref); nothing: not compared. Returns whose it was. kNotFound: session, person;
  /// kConflict: not `was`'s any more; kInvalidInput: still open, erased, or it was never flagged.
  Result<std::string> assign(const Uuid& session, const std::string& trainee,
                             const std::optional<std::string>& was, const std::string& by,
                             std::int64_t now_unix_ns,
                             std::optional<std::int64_t> started_unix_ns = std::nullopt);

 private:
  Result<std::string> typedName(std::string_view name, std::int64_t now_unix_ns);
  Result<SessionTrainee> traineeOfUuid(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Waits where the account's code was wanted and not checked.
  Result<SessionTrainee> ofAccount(const Person& person, const pb::SessionDescription& description);
  Connection& connection_;
};

}  // namespace needlelab
