/// A recorded hand as a smooth path that can be sampled at any rate.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

inline constexpr int kReplayFactor = 16;  ///< the reference's rate relative to the station's

/// A hand's path at kReplayFactor times the station's rate, and the ball of tissue that it enters.
struct RecordedHand {
  std::string name;
  std::vector<Vec3> path_m;
  SphereLimb limb;
  Quat needle;  ///< toward the farthest point
};

/// The hand-moved Virtuose recordings of `data`/virtuose, ordered by name; missing recordings are omitted.
/// Positions are means over 10 ms, because receive times jitter and half of the rows repeat. Errors: those of
/// readPoseTrack.
Result<std::vector<RecordedHand>> recordedHands(const std::filesystem::path& data);

/// Error of the station's loop, with its force held between ticks and its encoder steps, relative to the same
/// scene at kReplayFactor times the rate without them, while the needle is in tissue. Errors: those of
/// `compile`.
Result<ForceError> replayError(SceneSpec scene, const RecordedHand& hand);

}  // namespace needlelab
