/// A stored session's samples and profile, as input for measures and events.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/haptics/geometry.h"
#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/motion/motion_cost.h"
#include "common/scoring/motion/recorded_samples.h"
#include "db/store/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Longer gestures are stored and replayed but not scored: 30 minutes at 1 kHz, about 70 MB during scoring
/// (at most 26 MB of decoded samples, plus the smoothed motion at 100 Hz). At other rates the limits of
/// common/scoring/motion/motion_cost.h may apply first; within them it is at most about 110 MB.
inline constexpr std::uint64_t kMaxScoredSamples = 1'800'000;
/// Chunks are read and decoded one by one, in a long session half a dozen times each. A station's chunks have
/// 1,000 samples each, except those cut short by a power cut or the end. A session with more chunks than
/// this, plus one per 500 samples, is not scored.
inline constexpr std::uint64_t kScoredChunksBesides = 1'000;

struct SessionSamples {
  pb::SessionInfo info;
  pb::Profile profile;  ///< of the session
  Pose X_WL;            ///< pose of the profile's frame
  /// Decoded chunk by chunk on samplesOf()'s connection, which must outlive them. If a chunk cannot be read a
  /// second time (failing disk, recording being removed), `samples.fault()` is set: check it before using
  /// anything made from them.
  RecordedSamples samples;
};

/// X_WL, the pose of the profile's frame in the session.
Pose storedPlacement(const pb::SessionDescription& session);

/// Reads and checks the whole session once, and holds part of it. kInvalidInput: the profile text is invalid,
/// the gesture is longer than kMaxScoredSamples or in more chunks than kScoredChunksBesides allows, its
/// motion exceeds the limits of common/scoring/motion/motion_cost.h, or retention has removed the original;
/// kCorrupt: a chunk fails its check; kNotFound. A session without samples has no profile here.
Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session);

/// samplesOf() in steps, each with its own connection. Thread: one at a time.
class SessionReading {
 public:
  explicit SessionReading(const Uuid& session) : session_(session) {}
  SessionReading(const SessionReading&) = delete;
  SessionReading& operator=(const SessionReading&) = delete;

  /// Reads and checks some more. True: finished. Errors: as samplesOf(); no further step is possible then.
  Result<bool> step(Connection& reader, StepWork& work);
  /// From now on the samples are decoded on this connection.
  void readBy(Connection& reader) { *reader_ = &reader; }
  /// Valid once everything is read. Decoded on the connection of readBy() or of the last step.
  [[nodiscard]] SessionSamples& samples() { return all_; }

 private:
  Status begin(Connection& reader);

  const Uuid session_;
  const std::shared_ptr<Connection*> reader_ = std::make_shared<Connection*>(nullptr);  // used by samples
  SessionSamples all_{{}, {}, {}, RecordedSamples(std::span<const GestureSample>())};
  bool has_begun_ = false;
  std::uint64_t chunks_ = 0;             // read so far
  std::optional<MotionCheck> motion_{};  // once all chunks are read
};

/// The error of samplesOf() for a session whose original was removed.
Error originalRemoved(const Uuid& session, const pb::SessionInfo& info);

/// Whether this error of samplesOf() is permanent until the recording is removed, so that reading it again is
/// pointless.
bool isLasting(const Error& error);

/// The session's aspirations and injections (common/scoring/measures/syringe_events.h).
std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session);

/// samplesOf() and eventsOf() in steps, each with its own connection. Between steps it holds as much as
/// SessionReading. Thread: one at a time.
class SessionEvents {
 public:
  explicit SessionEvents(const Uuid& session) : reading_(session) {}

  /// Does some more work. True: done. Errors: as samplesOf(), and those of reading the samples again.
  Result<bool> step(Connection& reader, StepWork& work);
  /// To be called once done.
  std::vector<pb::SyringeEvent> take() { return events_ ? events_->take() : std::vector<pb::SyringeEvent>(); }

 private:
  SessionReading reading_;
  bool is_read_ = false;
  std::size_t next_ = 0;                          // sample
  std::unique_ptr<SyringeEventsInSteps> events_;  // null: no events
};

/// The remark on a session that is stored and replayed but never scored; human-readable. Its number is in
/// `meta`, so that the session is not read again just to fail again. A remark can be written by anyone;
/// `meta` only by this program. Nothing: no such remark. Errors: the database's.
Result<std::optional<std::string>> whyNeverScored(Connection& reader, const Uuid& session);
/// Adds that remark; `why` is samplesOf()'s message. Call on the writer's thread.
Status noteNeverScored(Connection& writer, const Uuid& session, const std::string& why);

}  // namespace needlelab
