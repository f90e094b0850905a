/// A stored session's samples and profile, as input for measures and events.
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "db/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Longer gestures are stored and replayed, but not scored: 30 minutes at 1 kHz, some 400 MB during scoring.
inline constexpr std::uint64_t kMaxScoredSamples = 1'800'000;

struct SessionSamples {
  pb::SessionInfo info;
  pb::Profile profile;  ///< of the session
  Pose X_WL;            ///< pose of the profile's frame
  std::vector<GestureSample> samples;
};

/// Reads and decodes the whole session. kInvalidInput: the profile text is not valid, the gesture is longer
/// than kMaxScoredSamples, or retention has removed the original; kCorrupt: a chunk fails its check;
/// kNotFound. A session without samples has no profile here.
Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session);

/// The session's aspirations and injections (scoring/syringe_events.h).
std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session);

}  // namespace needlelab
