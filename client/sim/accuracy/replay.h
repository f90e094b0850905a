/// A recorded hand as a smooth path, to be read at any rate.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

inline constexpr int kReplayFactor = 16;  ///< the reference's rate over the station's

/// A hand's path at kReplayFactor times the station's rate, and the ball of tissue that it goes into.
struct RecordedHand {
  std::string name;
  std::vector<Vec3> path_m;
  SphereLimb limb;
  Quat needle;  ///< along the way to the farthest point
};

/// The hand-moved Virtuose of `data`/virtuose, in the order of their names; recordings that are not there
/// are left out. Positions are means over 10 ms, because receive times jitter and half of the rows repeat.
/// Errors: those of readPoseTrack.
Result<std::vector<RecordedHand>> recordedHands(const std::filesystem::path& data);

/// The force of the station's loop, held from tick to tick, with the encoder's steps, against the same scene
/// at kReplayFactor times its rate without them; while the needle is in the tissue. Errors: those of
/// `compile`.
Result<ForceError> replayError(SceneSpec scene, const RecordedHand& hand);

}  // namespace needlelab
