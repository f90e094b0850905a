/// A stored session's samples and profile, as input for measures and events.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/haptics/geometry.h"
#include "common/scoring/motion_cost.h"
#include "common/scoring/recorded_samples.h"
#include "common/scoring/step_work.h"
#include "common/scoring/syringe_events.h"
#include "db/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Longer gestures are stored and replayed, but not scored: 30 minutes at 1 kHz, some 70 MB during scoring
/// (26 MB of decoded samples at most, and the smoothed motion at 100 Hz). At other rates the bounds of
/// common/scoring/motion_cost.h may come first; with them it is some 110 MB at most.
inline constexpr std::uint64_t kMaxScoredSamples = 1'800'000;
/// A chunk is read and decoded by itself, in a long session half a dozen times. A station's chunks have 1,000
/// samples each, but for those that a power cut or the end left shorter; a session in more chunks than these,
/// and one for each 500 samples, is not scored.
inline constexpr std::uint64_t kScoredChunksBesides = 1'000;

struct SessionSamples {
  pb::SessionInfo info;
  pb::Profile profile;  ///< of the session
  Pose X_WL;            ///< pose of the profile's frame
  /// Decoded a chunk at a time by the connection of samplesOf(), which must outlive them. A chunk that cannot
  /// be read a second time (a failing disk, a recording that is being removed) is `samples.fault()`: look at
  /// it before anything that was made from them is used.
  RecordedSamples samples;
};

/// Reads and checks the whole session once, and holds a part of it. kInvalidInput: the profile text is not
/// valid, the gesture is longer than kMaxScoredSamples, in more chunks than kScoredChunksBesides allows, or
/// its motion beyond the bounds of common/scoring/motion_cost.h, or retention has removed the original;
/// kCorrupt: a chunk fails its check; kNotFound. A session without samples has no profile here.
Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session);

/// samplesOf() in steps, each with a connection of its own. Thread: one at a time.
class SessionReading {
 public:
  explicit SessionReading(const Uuid& session) : session_(session) {}
  SessionReading(const SessionReading&) = delete;
  SessionReading& operator=(const SessionReading&) = delete;

  /// Reads and checks some more. True: all. Errors: as samplesOf(); it is over then.
  Result<bool> step(Connection& reader, StepWork& work);
  /// From now on the samples are decoded by this connection.
  void readBy(Connection& reader) { *reader_ = &reader; }
  /// Once all is read. They are decoded by the connection of readBy() or of the last step.
  [[nodiscard]] SessionSamples& samples() { return all_; }

 private:
  Status begin(Connection& reader);

  const Uuid session_;
  const std::shared_ptr<Connection*> reader_ = std::make_shared<Connection*>(nullptr);  // the samples have it
  SessionSamples all_{{}, {}, {}, RecordedSamples(std::span<const GestureSample>())};
  bool has_begun_ = false;
  std::uint64_t chunks_ = 0;             // that are read
  std::optional<MotionCheck> motion_{};  // once all chunks are
};

/// The error of samplesOf() for a session whose original was removed.
Error originalRemoved(const Uuid& session, const pb::SessionInfo& info);

/// Whether this error of samplesOf() comes again each time, until the recording is removed: so it need not be
/// read again only to find the same.
bool isLasting(const Error& error);

/// The session's aspirations and injections (scoring/syringe_events.h).
std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session);

/// samplesOf() and eventsOf() in steps, each with a connection of its own. Between them it holds what
/// SessionReading holds. Thread: one at a time.
class SessionEvents {
 public:
  explicit SessionEvents(const Uuid& session) : reading_(session) {}

  /// Does some more. True: done. Errors: as samplesOf(), and those of reading the samples once more.
  Result<bool> step(Connection& reader, StepWork& work);
  /// Once it is done.
  std::vector<pb::SyringeEvent> take() { return events_ ? events_->take() : std::vector<pb::SyringeEvent>(); }

 private:
  SessionReading reading_;
  bool is_read_ = false;
  std::size_t next_ = 0;                          // sample
  std::unique_ptr<SyringeEventsInSteps> events_;  // null: there are none
};

/// The remark on a session that is stored and replayed but never scored, for people. `meta` has its number,
/// so that nothing reads all of the session again only to find the same: a remark can be written by anybody;
/// what stands in `meta` only this program writes. Nothing: there is no such
/// remark. Errors: the database's.
Result<std::optional<std::string>> whyNeverScored(Connection& reader, const Uuid& session);
/// Adds that remark: `why` is what samplesOf() said. On the writer's thread.
Status noteNeverScored(Connection& writer, const Uuid& session, const std::string& why);

}  // namespace needlelab
