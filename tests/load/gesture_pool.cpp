#include "tests/load/gesture_pool.h"

#include <algorithm>

#include "client/device/hand_tremor.h"
#include "client/device/simulated_device.h"
#include "client/sim/tools/closed_loop.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "db/schema.h"

namespace needlelab::test {
namespace {

constexpr double kRate_hz = 1000;
constexpr std::string_view kProfile = "shoulder-adult.json";

Result<pb::Profile> sampleProfile() {
  for (const EmbeddedFile& file : embeddedSamples())
    if (file.name == kProfile) return parseProfile(file.text, file.name);
  return Error{ErrorCode::kNotFound, "the program holds no profile " + std::string(kProfile)};
}

// straight in at the top of the limb, as deep and as fast as this hand likes
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

}  // namespace

Result<GesturePool> makeGesturePool(std::uint64_t seed, std::size_t count) {
  auto profile = sampleProfile();
  if (!profile.ok()) return profile.error();
  auto scene = sceneSpecOf(*profile);
  if (!scene.ok()) return scene.error();
  auto model = compile(*scene, kRate_hz);
  if (!model.ok()) return model.error();

  GesturePool pool{profile->id(), profileJson(*profile), {}};
  HandRandom random(seed);
  for (std::size_t i = 0; i < count; ++i) {
    SimulatedDeviceOptions options;
    const HandPlan plan = planOf(*scene, random, options.hand);
    SimulatedDevice device(options, plan);
    auto ticks = runClosedLoop(*model, device, {}, static_cast<std::uint64_t>(plan.duration_s() * kRate_hz));
    if (!ticks.ok()) return ticks.error();
    PoolGesture& gesture = pool.gestures.emplace_back();
    gesture.reserve(ticks->size());
    for (const ChainTick& tick : *ticks) gesture.push_back(sampleOf(tick, 0, 0, 0));
  }
  return pool;
}

}  // namespace needlelab::test
