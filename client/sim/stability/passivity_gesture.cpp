#include "client/sim/stability/passivity_gesture.h"

#include <cmath>

#include "client/device/hand_tremor.h"

namespace needlelab {
namespace {

double onGrid(double value, double step) {
  return step > 0 ? std::floor(value / step + 0.5) * step : value;
}

}  // namespace

Pose poseOf(const PassivityStroke& stroke) {
  return {{stroke.x_m, stroke.y_m, -stroke.depth_m}, orientationAlong({stroke.tilt_x, stroke.tilt_y, -1})};
}

HandPlan planOf(const PassivityGesture& gesture) {
  HandPlan plan(poseOf(gesture.start));
  for (const PassivityStroke& stroke : gesture.strokes) {
    const Pose to = poseOf(stroke);
    if (to == plan.end().X_WT)
      plan.hold(stroke.seconds);
    else
      plan.moveIn(to, stroke.seconds, Motion::kMinJerk);
  }
  return plan;
}

std::vector<TipSample> samplesOf(const PassivityGesture& gesture) {
  const HandPlan plan = planOf(gesture);
  HandTremor tremor(gesture.tremor_m, gesture.tremor_seed, 1 / gesture.rate_hz);
  const auto ticks = static_cast<std::size_t>(std::floor(plan.duration_s() * gesture.rate_hz + 0.5)) + 1;
  std::vector<TipSample> samples;
  samples.reserve(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    const Pose aim = plan.at(static_cast<double>(k) / gesture.rate_hz).X_WT;
    const Vec3 p = aim.p + tremor.next();
    const double step = gesture.encoder_step_m;
    samples.push_back({{onGrid(p.x, step), onGrid(p.y, step), onGrid(p.z, step)}, aim.q});
  }
  return samples;
}

}  // namespace needlelab
