/// A stored session in memory, for replay, comparison, re-run and report.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/instructor/model/session_scene.h"
#include "client/view/model/gesture_trace.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Samples beyond this many (50 min at 1 kHz, 600 MB) are left out and noted.
inline constexpr std::size_t kMostLoadedSamples = 3'000'000;

/// Immutable once loaded. Times are Moment's: s since the session's tick 0.
struct StoredGesture {
  std::string id;  ///< as text
  pb::SessionInfo info;
  SessionScene scene;
  double rate_hz = 1000;  ///< of the loop, not of a thinned recording's samples
  bool thinned = false;
  std::vector<GestureSample> samples;
  GestureTrace trace;  ///< of all of it
  std::vector<pb::SyringeEvent> events;
  std::vector<pb::Annotation> annotations;  ///< by time
  std::vector<std::string> notes;           ///< damage, thinning, missing parts: for the reader

  [[nodiscard]] double first_s() const { return trace.firstTime_s(); }
  [[nodiscard]] double last_s() const { return trace.lastTime_s(); }
  [[nodiscard]] double timeOfTick(std::uint64_t tick) const { return static_cast<double>(tick) / rate_hz; }
  /// Index of the sample at or nearest before that time; 0 when there is none before. `samples` not empty.
  [[nodiscard]] std::size_t sampleAt(double time_s) const;
  /// "tina, knee-recess, 2026-11-21 00:42": for headings.
  [[nodiscard]] std::string title() const;
};

/// Asks the server and waits: LabConnection::call on a worker's thread, BlockingClient::call in a terminal.
using LabCall = std::function<Result<pb::Reply>(const pb::Request&)>;

/// Seen by the view while a worker loads.
struct LoadProgress {
  std::atomic<std::uint64_t> chunks_read{0}, chunks{0};
  std::atomic<bool> stop{false};
};

/// Reads a session as far as it is stored, in pieces. An open one is read as far as it has come. Damaged
/// chunks are left out and noted. Errors: those of the call; kNotFound where retention deleted the recording;
/// kFailed when it was stopped.
Result<std::shared_ptr<const StoredGesture>> loadGesture(const LabCall& call, const std::string& session_id,
                                                         const ScenePreparer& prepare = {},
                                                         LoadProgress* progress = nullptr);

/// All remarks of a session, by time. Errors: those of the call.
Result<std::vector<pb::Annotation>> readRemarks(const LabCall& call, const std::string& session_id);

/// The same from samples at hand: tests, re-runs.
std::shared_ptr<const StoredGesture> gestureOf(pb::SessionInfo info, std::vector<GestureSample> samples,
                                               const ScenePreparer& prepare = {});

}  // namespace needlelab
