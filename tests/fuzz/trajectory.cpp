// Fuzzes text written by people: recorded trajectories (CSV).
#include <array>

#include "client/device/recording/recording_device.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {

void trajectory(ByteView data) {
  const auto file = scratchFolder() / "fuzz.csv";
  writeFile(file, data);
  const auto track = readPoseTrack(file);
  if (!track.ok()) return;
  require(!track->t_s.empty() && track->t_s.size() == track->X_WH.size(), "columns have one length");
  require(track->plunger.empty() || track->plunger.size() == track->t_s.size(), "the plunger's too");
  if (kPlanted) {
    // The planted fault: a time in tenths of a second is used as an unchecked index.
    static std::array<int, 64> seen{};
    for (const double t_s : track->t_s) surely(seen.data()[static_cast<int>(t_s * 10)]) = 1;
  }
  if (track->t_s.back() - track->t_s.front() > 10) return;  // resampling it would only take long
  const auto poses = resamplePoses(*track, 1000);
  require(poses.size() == tickCount(*track, 1000), "a pose for each tick");
  (void)resamplePlunger(*track, 1000);
}

}  // namespace needlelab::fuzz
