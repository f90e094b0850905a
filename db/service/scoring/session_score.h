/// The measures and syringe events of a stored session, made in steps.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/dtw.h"
#include "common/scoring/motion/recorded_samples.h"
#include "db/service/scoring/reference_paths.h"
#include "db/service/scoring/session_samples.h"
#include "db/store/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The verdicts on the requirements in a score's rows.
struct Verdicts {
  std::uint32_t required = 0, met = 0;
  /// Nothing: there are no requirements, or the text is not a score.
  [[nodiscard]] std::optional<bool> passed() const {
    return required == 0 ? std::nullopt : std::optional(met == required);
  }
};
Verdicts verdictsOf(std::string_view measures_json);

/// A score made now, with this program's definitions.
pb::Score newScore(const Uuid& session, const std::string& measures_json);

/// Steps: first the distances to the exercise's references as of the first step, then the samples, then the
/// measures. Between steps it holds as much as samplesOf() and scoreGesture(): at most about 110 MB, so only
/// few may exist at once. Thread: one at a time.
class SessionScore {
 public:
  explicit SessionScore(const Uuid& session) : session_(session), reading_(session) {}
  SessionScore(const SessionScore&) = delete;
  SessionScore& operator=(const SessionScore&) = delete;

  /// Does some more work on this connection. True: done. One call computes only a part of the distances,
  /// however large `work` is (ReferencePaths::nearestPath). Errors: as samplesOf(); no further step is
  /// possible then.
  Result<bool> step(Connection& reader, ReferencePaths& paths, StepWork& work);
  /// Whether a step was made.
  [[nodiscard]] bool hasBegun() const { return has_begun_; }
  /// Whether the whole recording was read: later errors come from reading it again.
  [[nodiscard]] bool isRead() const { return is_read_; }

  /// Valid once done: the measures as JSON rows, by the exercise's current requirements; empty: nothing to
  /// measure. Errors: the exercise or its references cannot be read; the events are available nevertheless.
  [[nodiscard]] const Result<std::string>& json() const { return json_; }
  /// Valid once done.
  [[nodiscard]] const std::vector<pb::SyringeEvent>& events() const { return events_; }
  [[nodiscard]] const GestureScore::LatePaths& latePaths() const { return late_paths_; }

 private:
  Result<bool> compareStep(Connection& reader, ReferencePaths& paths);
  Status readExercise(Connection& reader);

  const Uuid session_;
  SessionReading reading_;
  bool has_begun_ = false, is_compared_ = false, is_read_ = false;
  ReferencePaths::UnderWay comparison_;
  std::optional<TipPath> nearest_;  // among the references
  std::optional<pb::Exercise> exercise_;
  std::optional<GestureScore> score_;  // once everything is read
  Result<std::string> json_ = std::string();
  std::vector<pb::SyringeEvent> events_;
  GestureScore::LatePaths late_paths_;
};

}  // namespace needlelab
