/// Whether the needle of a gesture enters the skin as needles do: otherwise its quaternions are probably in
/// another order or frame. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/gesture/pose_track.h"
#include "common/haptics/engine.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// kUnsure: of files that other programs wrote.
enum class QuaternionOrder : std::uint8_t { kSure, kUnsure };

/// The needle points along z of its frame. `tip`: returns row i, in the limb's frame W. Returns a warning for
/// people about the first entry where it points out of the skin or, if kUnsure, where it is within 1° of
/// straight in, and read as w, x, y, z tilted by 5° to 85°: a turn about the needle's own axis looks the
/// same.
std::optional<std::string> needleDirectionWarning(const Limb& limb, std::size_t rows,
                                                  const std::function<TipSample(std::size_t)>& tip,
                                                  QuaternionOrder order);
/// Prints it on standard error, for a track that a station plays. `X_HT`: the tip in the handle's frame.
void warnOfDirection(const std::string& path, const Limb& limb, const PoseTrack& track, const Pose& X_HT);

}  // namespace needlelab
