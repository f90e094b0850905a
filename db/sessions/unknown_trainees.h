/// Determines whose session a station delivers, and keeps sessions whose trainee was unknown on arrival
/// waiting for a manager.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/people/people.h"
#include "db/store/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// SQL: the numbers of the sessions that wait for a manager.
inline constexpr std::string_view kWaitingSessions =
    "(SELECT session FROM unknown_trainees WHERE by_whom IS NULL)";

/// The trainee of a new session.
struct SessionTrainee {
  std::string ref;              ///< sessions.trainee
  bool erased = false;          ///< of an erased person: nothing is kept
  bool waits = false;           ///< for a manager
  bool code_unchecked = false;  ///< reason: the account's code was not entered; else the name was unknown
  bool begin_unsure = false;    ///< reason: the station's clock was wrong
  bool not_assigned = false;    ///< reason: by assignment only, and not assigned to this trainee
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class UnknownTraineeStore {
 public:
  explicit UnknownTraineeStore(Connection& connection) : connection_(connection) {}

  /// Looks up the description's trainee: "@" and a UUID, or a name as typed. A name without an account gets
  /// its own row, under which its sessions wait. A session also waits there if it began before a person of
  /// this name was erased (wasErased()), even if another account has the name now. Without a trainee, or with
  /// kGuestName, the session belongs to no one.
  Result<SessionTrainee> traineeOf(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Whether the session cannot have begun when its station claims: more than 5 minutes after it arrived;
  /// before the last time that the station knows; or, if the station knows none, more than 5 minutes before
  /// the station's newest closed session. A description without clock information is trusted.
  Result<bool> isBeginUnsure(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Whether the exercise is by assignment only and not currently assigned to the trainee.
  Result<bool> lacksAssignment(std::string_view trainee, std::string_view exercise_id);
  /// Whether the trainee that a station gives may be that of the stored session `number`: a manager may have
  /// assigned the session, and someone may have got the name meanwhile.
  Result<bool> isOf(std::int64_t number, std::string_view trainee);
  /// Makes a new session wait.
  Status flag(const Uuid& session, const SessionTrainee& trainee);
  /// For a new session of an erased person: closes and marks it, so that it stays empty.
  Status leaveEmpty(const Uuid& session, std::int64_t now_unix_ns);
  /// Assigns a flagged session to `trainee`, a person's ref or kGuestName; from now on it counts as that
  /// person's, even if it was theirs already. A session can be assigned again. For exams the attempts of both
  /// people are recounted (AttemptStore::countExam). `started_unix_ns`: the start time, for a session with
  /// begin_unsure; nothing: as the station says. `was`: the trainee that the manager saw (a name or ref);
  /// nothing: not compared. Returns the previous trainee. kNotFound: session, person; kConflict: no longer
  /// `was`'s; kInvalidInput: still open, erased, or never flagged.
  Result<std::string> assign(const Uuid& session, const std::string& trainee,
                             const std::optional<std::string>& was, const std::string& by,
                             std::int64_t now_unix_ns,
                             std::optional<std::int64_t> started_unix_ns = std::nullopt);

 private:
  Result<std::string> typedName(std::string_view name, std::int64_t now_unix_ns);
  Result<SessionTrainee> traineeOfUuid(const pb::SessionDescription& description, std::int64_t now_unix_ns);
  /// Waits if the account's code was required and not checked.
  Result<SessionTrainee> ofAccount(const Person& person, const pb::SessionDescription& description);
  Connection& connection_;
};

}  // namespace needlelab
