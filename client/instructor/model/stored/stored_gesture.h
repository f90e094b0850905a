/// A stored session in memory, for replay, comparison, re-run and report.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/live/session_scene.h"
#include "client/view/model/gesture_plots.h"
#include "client/view/model/gesture_trace.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/profile/planned_line.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// The loader omits samples beyond this number (50 min at 1 kHz, 600 MB) and notes it.
inline constexpr std::size_t kMaxLoadedSamples = 3'000'000;

/// Immutable after loading. Times are Moment's: s since the session's tick 0.
struct StoredGesture {
  std::string id;             ///< as text
  std::string exercise_name;  ///< current name of the exercise; empty if the server no longer has it
  pb::SessionInfo info;
  SessionScene scene;
  /// The exercise's current plan, in W; a note says so unless the score confirms it. Empty without a scene,
  /// if its pose is unknown, for another patient than the session's, and if the score has no plan.
  std::optional<PlannedLine> plan_W;
  double rate_hz = 1000;  ///< rate of the loop, not of a thinned recording's samples
  bool thinned = false;
  double ticks_per_sample = 1;  ///< above 1 in a thinned recording
  std::vector<GestureSample> samples;
  GestureTrace trace;  ///< trace of the whole gesture
  std::vector<pb::SyringeEvent> events;
  std::vector<pb::Annotation> annotations;    ///< by time
  std::vector<PlotRequirement> requirements;  ///< of the newest score, as they were then; empty if not scored
  std::vector<std::string>
      notes;  ///< damage, thinning, missing parts, a score with another plan: for the reader

  /// Returns `plan_W` for drawing; nullopt without one.
  [[nodiscard]] std::optional<PlanView> planView() const;
  [[nodiscard]] double first_s() const { return trace.firstTime_s(); }
  [[nodiscard]] double last_s() const { return trace.lastTime_s(); }
  [[nodiscard]] double timeOfTick(std::uint64_t tick) const { return static_cast<double>(tick) / rate_hz; }
  /// Returns the index of the last sample at or before that time; 0 if all are later. `samples` must not be
  /// empty.
  [[nodiscard]] std::size_t sampleAt(double time_s) const;
  /// Returns a heading: "tina, Knee: suprapatellar recess, 2026-11-21 00:42".
  [[nodiscard]] std::string title() const;
};

/// A blocking request to the server: LabConnection::call on a worker's thread, BlockingClient::call in a
/// terminal.
using LabCall = std::function<Result<pb::Reply>(const pb::Request&)>;

/// A worker's progress, read by the view.
struct LoadProgress {
  std::atomic<std::uint64_t> chunks_read{0}, chunks{0};
  std::atomic<bool> stop{false};
};

/// Returns the current exercise with this id; nullopt if it does not exist or is not readable. Errors: from
/// the call.
Result<std::optional<pb::Exercise>> findExercise(const LabCall& call, const std::string& exercise_id);

/// Reads the stored part of a session in pieces, and its exercise's name and plan; of an open session, the
/// part stored so far. Omits damaged chunks and an unavailable plan, with a note. Errors: from the call;
/// kNotFound if retention deleted the recording; kFailed after a stop.
Result<std::shared_ptr<const StoredGesture>> loadGesture(const LabCall& call, const std::string& session_id,
                                                         const ScenePreparer& prepare = {},
                                                         LoadProgress* progress = nullptr);

/// Returns all remarks of a session, by time. Errors: from the call.
Result<std::vector<pb::Annotation>> readRemarks(const LabCall& call, const std::string& session_id);

/// Builds a gesture from samples in memory, for tests and re-runs. `exercise`: for its plan; may be null.
std::shared_ptr<const StoredGesture> gestureOf(pb::SessionInfo info, std::vector<GestureSample> samples,
                                               const ScenePreparer& prepare = {},
                                               const pb::Exercise* exercise = nullptr);

}  // namespace needlelab
