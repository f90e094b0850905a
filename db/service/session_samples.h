/// A stored session as its measures and events are worked out from.
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

/// Longer gestures are stored and replayed, but not scored: 30 minutes at 1 kHz, some 400 MB while they are
/// scored.
inline constexpr std::uint64_t kMaxScoredSamples = 1'800'000;

struct SessionSamples {
  pb::SessionInfo info;
  pb::Profile profile;  ///< that it ran with
  Pose X_WL;            ///< where the profile's frame stood
  std::vector<GestureSample> samples;
};

/// Reads and decodes all of it. kInvalidInput: the profile text is not valid, or the gesture is longer than
/// kMaxScoredSamples; kCorrupt: a chunk fails its check; kNotFound; kInvalidInput as well when retention
/// has removed the original. A session without samples has no profile
/// here.
Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session);

/// Its aspirations and injections (scoring/syringe_events.h).
std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session);

}  // namespace needlelab
