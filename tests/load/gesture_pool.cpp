#include "tests/load/gesture_pool.h"

#include <algorithm>

#include "client/device/hand/hand.h"
#include "client/device/hand/simulated_device.h"
#include "client/sim/tools/closed_loop.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "db/store/schema.h"

namespace needlelab::test {
namespace {

constexpr double kRate_hz = 1000;
constexpr std::string_view kProfile = "shoulder-adult.json";

Result<pb::Profile> sampleProfile() {
  for (const EmbeddedFile& file : embeddedSamples())
    if (file.name == kProfile) return parseProfile(file.text, file.name);
  return Error{ErrorCode::kNotFound, "the program holds no profile " + std::string(kProfile)};
}

// straight in at the top of the limb, at this hand's depth and speed
HandPlan planOf(const SceneSpec& scene, HandRandom& random, HandOptions& hand) {
  const auto between = [&](double low, double high) { return low + (high - low) * random.uniform(); };
  const auto& sphere = std::get<SphereLimb>(scene.limb);
  const Vec3 normal = outwardNormal(scene.limb, sphere.center_m);
  hand.seed = random.next();
  hand.tremor_m = between(20e-6, 80e-6);
  hand.correction_per_s = 2;
  PlanStyle style;
  style.insertion_speed_mps = between(0.008, 0.03);
  style.hold_s = between(0.8, 2.5);
  style.rest_s = between(0.2, 0.6);
  style.aspirate = random.uniform() < 0.5;
  return insertionPlan(sphere.center_m + normal * sphere.radius_m, -normal, between(0.012, 0.032), style);
}

// a multiple of the stored resolution, so that the displacement itself is stored exactly
constexpr double kPlacementStep_m = 1e-4;
constexpr std::size_t kPlacementsPerRow = 64;

std::uint64_t mixed(std::uint64_t seed, std::uint64_t value) {
  return HandRandom(seed ^ (value + 1) * 0x9e3779b97f4a7c15u).next();
}

}  // namespace

Result<GesturePool> makeGesturePool(std::uint64_t seed, std::size_t count) {
  ASSIGN_OR_RETURN(auto profile, sampleProfile());
  ASSIGN_OR_RETURN(auto scene, sceneSpecOf(profile));
  ASSIGN_OR_RETURN(auto model, compile(scene, kRate_hz));

  GesturePool pool{profile.id(), profileJson(profile), {}};
  HandRandom random(seed);
  for (std::size_t i = 0; i < count; ++i) {
    SimulatedDeviceOptions options;
    const HandPlan plan = planOf(scene, random, options.hand);
    SimulatedDevice device(options, plan);
    auto ticks = runClosedLoop(model, device, {}, static_cast<std::uint64_t>(plan.duration_s() * kRate_hz));
    if (!ticks.ok()) return ticks.error();
    PoolGesture& gesture = pool.gestures.emplace_back();
    gesture.reserve(ticks->size());
    for (const ChainTick& tick : *ticks) gesture.push_back(sampleOf(tick, 0, 0, 0));
  }
  return pool;
}

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
    // starts somewhere within the first gesture, so that the stations are out of phase
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
    // the device's and engine's times vary from tick to tick, as on a real machine
    const std::uint64_t noise = mixed(noise_seed_, tick);
    s.device_ns = static_cast<std::int32_t>(8'000 + noise % 4'000);
    s.engine_ns = static_cast<std::int32_t>(30 + (noise >> 32) % 400);
  }
}

}  // namespace needlelab::test
