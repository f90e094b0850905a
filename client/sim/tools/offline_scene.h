/// A profile and a trajectory, ready for the engine: input of `run` and `score`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/recording/needle_direction.h"
#include "common/base/result.h"
#include "common/gesture/pose_track.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"
#include "needlelab/profile.pb.h"

namespace CLI {
class App;
}

namespace needlelab {

/// As given on the command line.
struct OfflineOptions {
  std::filesystem::path profile;
  std::filesystem::path trajectory;  ///< empty = no track
  TrackReading reading;              ///< of the trajectory
  std::optional<double> rate_hz;     ///< empty: 1000 Hz, or the recording's rate
  std::string model;                 ///< replaces the profile's `axial_model`; empty = the profile's
  std::string placement;             ///< the limb's pose in W, see parsePoseOption; empty = at W's origin
  std::string tool;                  ///< the tip in the handle's frame; empty = the rows are the tip itself
};

struct OfflineScene {
  pb::Profile profile;
  Pose X_WL, X_HT;
  double rate_hz = 0;
  SceneModel model;
  PoseTrack track;  ///< at each tick, by its times; of the handle if there is a tool
  /// The tip in row `i`.
  [[nodiscard]] TipSample tip(std::size_t i) const;
};

/// A trajectory's poses at the ticks, as for a device that plays it (resamplePoses). Errors: those of
/// readPoseTrack.
Result<PoseTrack> readTrackAt(const std::filesystem::path& path, double rate_hz,
                              const TrackReading& reading = {});
/// Errors: kInvalidInput naming file, field, value and range.
Result<OfflineScene> loadOffline(const OfflineOptions& options);

/// `options` must outlive the parsing.
void addOfflineOptions(CLI::App& app, OfflineOptions& options);

/// Prints the profile's warnings on stderr, one per line.
void printWarnings(const OfflineScene& scene);

/// FNV-1a, 64 bits, of a text. Doubles are written so that they read back exactly, so equal hashes mean equal
/// bits.
std::uint64_t fnv1a(std::string_view text);

/// Prints needleDirectionWarning on standard error.
void warnOfDirection(const char* command, const Limb& limb, std::size_t rows,
                     const std::function<TipSample(std::size_t)>& tip,
                     QuaternionOrder order = QuaternionOrder::kUnsure);
/// Says on standard error that the tip never meets the skin, if that is so.
void warnOfNoContact(const Limb& limb, std::size_t rows, const std::function<TipSample(std::size_t)>& tip);
TipSample tipOf(const GestureSample& sample);

}  // namespace needlelab
