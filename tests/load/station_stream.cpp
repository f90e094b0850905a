#include "tests/load/station_stream.h"

#include <algorithm>

namespace needlelab::test {
namespace {

// in steps of the stored resolution, so that the displacement itself is stored exactly
constexpr double kPlacementStep_m = 1e-4;
constexpr std::size_t kPlacementsPerRow = 64;

std::uint64_t mixed(std::uint64_t seed, std::uint64_t value) {
  return HandRandom(seed ^ (value + 1) * 0x9e3779b97f4a7c15u).next();
}

}  // namespace

StationStream::StationStream(const GesturePool& pool, std::uint64_t seed, std::size_t station)
    : pool_(pool),
      random_(mixed(seed, station)),
      noise_seed_(random_.next()),
      clock_ns_(static_cast<std::int64_t>(station + 1) * kStationClock_ns +
                static_cast<std::int64_t>(random_.next() % 1'000'000'000)),
      placement_m_{kPlacementStep_m * static_cast<double>(station % kPlacementsPerRow),
                   kPlacementStep_m * static_cast<double>(station / kPlacementsPerRow),
                   kPlacementStep_m * static_cast<double>(random_.next() % 100)} {}

std::size_t StationStream::partOf(std::uint64_t tick) {
  while (parts_.empty() || parts_.back().end_tick <= tick) {
    const std::uint64_t from = parts_.empty() ? 0 : parts_.back().end_tick;
    const PoolGesture& gesture = pool_.gestures[random_.next() % pool_.gestures.size()];
    // the first one is begun somewhere in its middle: else all stations would do the same at the same time
    const std::size_t skip = from == 0 ? random_.next() % gesture.size() : 0;
    parts_.push_back({&gesture, from + gesture.size() - skip, skip});
  }
  const auto found = std::upper_bound(parts_.begin(), parts_.end(), tick,
                                      [](std::uint64_t t, const Part& part) { return t < part.end_tick; });
  return static_cast<std::size_t>(found - parts_.begin());
}

void StationStream::fill(std::uint64_t first_tick, std::span<GestureSample> out) {
  std::size_t at = out.empty() ? 0 : partOf(first_tick);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::uint64_t tick = first_tick + i;
    if (at >= parts_.size() || parts_[at].end_tick <= tick) at = partOf(tick);
    const Part& part = parts_[at];
    GestureSample& s = out[i];
    s = (*part.gesture)[part.gesture->size() - (part.end_tick - tick)];
    s.tick = tick;
    s.time_ns = timeOf(tick);
    s.p_WT_m[0] += placement_m_.x;
    s.p_WT_m[1] += placement_m_.y;
    s.p_WT_m[2] += placement_m_.z;
    s.wall_W_m[0] += placement_m_.x;
    s.wall_W_m[1] += placement_m_.y;
    s.wall_W_m[2] += placement_m_.z;
    // what device and engine take differs from tick to tick, as on a real machine
    const std::uint64_t noise = mixed(noise_seed_, tick);
    s.device_ns = static_cast<std::int32_t>(8'000 + noise % 4'000);
    s.engine_ns = static_cast<std::int32_t>(30 + (noise >> 32) % 400);
  }
}

}  // namespace needlelab::test
