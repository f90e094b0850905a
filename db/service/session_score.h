/// The measures and syringe events of a stored session, made in steps.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/scoring/dtw.h"
#include "common/scoring/measures.h"
#include "common/scoring/step_work.h"
#include "db/connection.h"
#include "db/service/reference_paths.h"
#include "db/service/session_samples.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// First the distances from the exercise's references, as they are at the first step, then the samples, then
/// the measures. Between its steps it holds what samplesOf() and scoreGesture() hold: some 110 MB at most, so
/// few may be under way at once. Thread: one at a time.
class SessionScore {
 public:
  explicit SessionScore(const Uuid& session) : session_(session), reading_(session) {}
  SessionScore(const SessionScore&) = delete;
  SessionScore& operator=(const SessionScore&) = delete;

  /// Does some more by this connection. True: it is done. Of distances one call computes a part, however much
  /// work there is left (ReferencePaths::nearestPath). Errors: as samplesOf(); it is over then.
  Result<bool> step(Connection& reader, ReferencePaths& paths, StepWork& work);
  /// Whether a step has been done.
  [[nodiscard]] bool hasBegun() const { return has_begun_; }
  /// Whether the whole recording has been read: an error of a step after that is one of reading it again.
  [[nodiscard]] bool isRead() const { return is_read_; }

  /// Once it is done: the measures as JSON rows by the exercise's requirements of now; empty: nothing to
  /// measure. Errors: the exercise or its references cannot be read; there are events all the same.
  [[nodiscard]] const Result<std::string>& json() const { return json_; }
  /// Once it is done.
  [[nodiscard]] const std::vector<pb::SyringeEvent>& events() const { return events_; }

 private:
  Result<bool> compareStep(Connection& reader, ReferencePaths& paths);
  Status readExercise(Connection& reader);

  const Uuid session_;
  SessionReading reading_;
  bool has_begun_ = false, is_compared_ = false, is_read_ = false;
  ReferencePaths::UnderWay comparison_;
  std::optional<TipPath> nearest_;  // of the references
  std::optional<pb::Exercise> exercise_;
  std::optional<GestureScore> score_;  // once all is read
  Result<std::string> json_ = std::string();
  std::vector<pb::SyringeEvent> events_;
};

}  // namespace needlelab
