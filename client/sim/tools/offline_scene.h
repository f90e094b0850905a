/// A profile and a trajectory, ready for the engine; input of `run` and `score`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/recording_device.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "needlelab/profile.pb.h"

namespace CLI {
class App;
}

namespace needlelab {

/// As on the command line.
struct OfflineOptions {
  std::filesystem::path profile;
  std::filesystem::path trajectory;  ///< empty = no track
  std::size_t lines_above = 0;       ///< of the trajectory: lines above its header
  std::optional<double> rate_hz;     ///< nothing: 1000 Hz, or that of a recording
  std::string model;                 ///< instead of the profile's `axial_model`; empty = the profile's
  std::string placement;             ///< the limb in W, see parsePoseOption; empty = at W's origin
  std::string tool;                  ///< the tip in the handle's frame; empty = the rows are the tip itself
};

struct OfflineScene {
  pb::Profile profile;
  Pose X_WL, X_HT;
  double rate_hz = 0;
  SceneModel model;
  PoseTrack track;  ///< at the ticks, by its times; of the handle where there is a tool
  /// The tip at row `i`.
  [[nodiscard]] TipSample tip(std::size_t i) const;
};

/// A trajectory's poses at the ticks, as a device that plays it has them (resamplePoses). Errors: those of
/// readPoseTrack.
Result<PoseTrack> readTrackAt(const std::filesystem::path& path, double rate_hz, std::size_t lines_above = 0);
/// Errors: kInvalidInput naming file, field, value and range.
Result<OfflineScene> loadOffline(const OfflineOptions& options);

/// The names of all axial models, e.g. "ENHANCED_TRACKING_WALL".
std::vector<std::string> axialModelNames();

/// `options` must outlive the parsing.
void addOfflineOptions(CLI::App& app, OfflineOptions& options);

/// Prints the profile's warnings on stderr, one per line.
void printWarnings(const OfflineScene& scene);

/// FNV-1a, 64 bits, of a text: as every double is written so that it reads back the same, equal hashes mean
/// equal bits.
std::uint64_t fnv1a(std::string_view text);

}  // namespace needlelab
