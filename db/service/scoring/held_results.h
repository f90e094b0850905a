/// Results and recordings of an exam, hidden from trainees until the date set by its course. Private to
/// db/service.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/service/context/context.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// When trainees may see the results of this exercise, if that is in the future; else 0.
Result<std::int64_t> heldUntil(Connection& reader, const std::string& exercise_id, std::int64_t now_unix_ns);
/// Whether the session's results are still held back; its station, which shows scores, then does not receive
/// them.
Result<bool> isHeld(Connection& reader, const Uuid& session, std::int64_t now_unix_ns);
/// SQL: the numbers of the sessions whose results are currently held back.
std::string withheldSessions(std::int64_t now_unix_ns);

/// Removes held-back exam results from one request's replies to trainees and stations; staff and researchers
/// see everything. Use within one view. Thread: as the request.
class WithheldResults {
 public:
  explicit WithheldResults(const handlers::Context& context)
      : context_(context),
        is_for_trainee_(context.who.role == pb::TRAINEE || context.who.role == pb::STATION) {}

  /// As heldUntil(), or 0 if the requester may see everything. Reads each exercise once.
  Result<std::int64_t> until(const std::string& exercise_id);
  /// Removes verdict and score, and adds the date.
  Status leaveOutOf(pb::Attempt& attempt);
  Status leaveOutOf(pb::SessionInfo& session);

 private:
  const handlers::Context& context_;
  const bool is_for_trainee_;
  std::map<std::string, std::int64_t> until_;  ///< by exercise
};

/// kDenied, with the date, if the results were removed from `session`: its samples are not shown either.
Status requireShown(const pb::SessionInfo& session);

}  // namespace needlelab
