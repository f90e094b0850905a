#include "client/effect_cost/tick_run.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/device/hand/hand_plan.h"

namespace needlelab {
namespace {

constexpr double kMove_s = 1.0, kHold_s = 0.4;
constexpr double kAside_m = 2e-4, kTremor_m = 3e-5, kTremor_hz = 9.7;

struct Site {
  Vec3 p_surface_m, inward;
  double room_m = 1;  ///< depth of the shape
};

Site siteOn(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb))
    return {plane->point_m, -outwardNormal(limb, plane->point_m)};
  Vec3 middle;
  double radius = 0;
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    middle = sphere->center_m;
    radius = sphere->radius_m;
  } else {
    const auto& capsule = std::get<CapsuleLimb>(limb);
    middle = (capsule.a_m + capsule.b_m) * 0.5;
    radius = capsule.radius_m;
  }
  const Vec3 out = outwardNormal(limb, middle);
  return {middle + out * radius, -out, 0.8 * radius};
}

// depth through all layer tops, as far as needle and shape allow
double depthOf(const SceneSpec& scene, double room_m) {
  constexpr double kIntoLast_m = 0.01;
  double depth_m = 0;
  for (const LayerSpec& layer : scene.layers) depth_m += layer.thickness_m;
  const LayerSpec& last = scene.layers.back();
  depth_m += std::min(last.thickness_m, kIntoLast_m) - last.thickness_m;
  return std::min({depth_m, 0.9 * scene.needle_length_m, room_m});
}

// share of the way at `t` seconds: in, hold, out
double shareAt(double t) {
  if (t < kMove_s) return shareOfWay(Motion::kMinJerk, t / kMove_s);
  if (t < kMove_s + kHold_s) return 1;
  return 1 - shareOfWay(Motion::kMinJerk, (t - kMove_s - kHold_s) / kMove_s);
}

}  // namespace

std::vector<TipSample> measuringGesture(const SceneSpec& scene, double rate_hz) {
  const Site site = siteOn(scene.limb);
  const double depth_m = depthOf(scene, site.room_m);
  const Quat q = orientationAlong(site.inward);
  const Vec3 aside = rotate(q, Vec3{1, 0, 0});
  const auto ticks = static_cast<std::size_t>((2 * kMove_s + kHold_s) * rate_hz);

  std::vector<TipSample> gesture;
  gesture.reserve(ticks + 1);
  gesture.push_back({site.p_surface_m - site.inward * 1e-3, q});
  for (std::size_t k = 0; k < ticks; ++k) {
    const double t = static_cast<double>(k) / rate_hz, share = shareAt(t);
    const double wave = std::sin(2 * std::numbers::pi * kTremor_hz * t);
    // never closer to the surface than the tremor's width
    const double in_m = 2 * kTremor_m + share * (depth_m - 3 * kTremor_m) + kTremor_m * wave;
    gesture.push_back(
        {site.p_surface_m + site.inward * in_m + aside * (share * (kAside_m + kTremor_m * wave)), q});
  }
  return gesture;
}

TickRun::TickRun(const SceneModel& model, const std::vector<TipSample>& gesture)
    : model_(model), gesture_(gesture), state_(std::make_unique<SimState>()) {}

}  // namespace needlelab
