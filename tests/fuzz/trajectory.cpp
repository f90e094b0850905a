// Fuzzes text written by people: recorded trajectories (CSV), HOST:PORT and lists of it.
#include <array>

#include "client/device/recording/recording_device.h"
#include "common/wire/endpoint.h"
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

void address(ByteView data) {
  if (const auto all = parseEndpoints(textOf(data)); all.ok()) {
    require(!all->empty() && all->size() <= kMaxEndpoints, "a list has servers");
    const auto again = parseEndpoints(endpointsText(*all));
    require(again.ok() && endpointsText(*again) == endpointsText(*all), "a list comes back");
  }
  const auto parsed = parseEndpoint(textOf(data));
  if (!parsed.ok()) return;
  if (kPlanted) {
    // The planted fault: a fixed-size buffer for a text.
    std::array<char, 16> host{};
    std::memcpy(host.data(), parsed->host.data(), parsed->host.size());
    require(host.data()[0] != '\n', "hosts");
  }
  require(!parsed->host.empty(), "an address has a host");
  const auto again = parseEndpoint(endpointText(*parsed));
  require(again.ok() && again->host == parsed->host && again->port == parsed->port, "an address comes back");
}

}  // namespace needlelab::fuzz
