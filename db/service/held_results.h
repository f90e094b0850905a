/// Results of an exam, which a trainee does not see before the date that its course says. Private to this
/// folder.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/service/handlers.h"
#include "needlelab/teaching.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// When the results at this exercise are shown to trainees, if that is later than now; else 0.
Result<std::int64_t> heldUntil(Connection& reader, const std::string& exercise_id, std::int64_t now_unix_ns);
/// Whether those of the session are shown later than now: its station, which shows scores, does not get it.
Result<bool> isHeld(Connection& reader, const Uuid& session, std::int64_t now_unix_ns);
/// SQL: the numbers of the sessions whose results are held back now.
std::string heldSessions(std::int64_t now_unix_ns);

/// What of an exam's results one request leaves out: to trainees, and to stations, which show them; staff and
/// researchers see all of them. Within one view. Thread: as the request.
class HeldResults {
 public:
  explicit HeldResults(const handlers::Context& context)
      : context_(context),
        is_for_trainee_(context.who.role == pb::TRAINEE || context.who.role == pb::STATION) {}

  /// As heldUntil(); 0 to all others, too. Reads the exercise once.
  Result<std::int64_t> until(const std::string& exercise_id);
  /// Leaves verdict and score out, and says until when.
  Status leaveOutOf(pb::Attempt& attempt);
  Status leaveOutOf(pb::SessionInfo& session);

 private:
  const handlers::Context& context_;
  const bool is_for_trainee_;
  std::map<std::string, std::int64_t> until_;  ///< by exercise
};

/// kDenied, with the date, where `session` was left without its results.
Status requireShown(const pb::SessionInfo& session);

}  // namespace needlelab
