#include "client/sim/accuracy/recorded_run.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

void runStraight(const SceneModel& model, const StraightGesture& gesture, AxialRun& run) {
  // half a turn about x: the tip frame's z axis points to −z of W
  constexpr Quat kDown{1, 0, 0, 0};
  SimState state{};
  StepReport report;
  run.force_N.resize(gesture.depth_m.size());
  run.flags.resize(gesture.depth_m.size());
  for (std::size_t i = 0; i < gesture.depth_m.size(); ++i) {
    step(model, {{0, 0, -gesture.depth_m[i]}, kDown}, state, report);
    run.force_N[i] = report.wrench_W.force_N.z;
    run.flags[i] = report.flags;
  }
}

Result<AxialRun> runStraight(const SceneSpec& scene, const StraightGesture& gesture) {
  const auto model = compile(scene, gesture.rate_hz);
  if (!model.ok()) return model.error();
  AxialRun run;
  runStraight(*model, gesture, run);
  return run;
}

StraightGesture constantSpeed(double from_m, double to_m, double speed_mps, double rate_hz) {
  StraightGesture gesture{rate_hz, {}};
  const double step_m = speed_mps / rate_hz;
  const auto ticks = static_cast<std::size_t>(std::ceil((to_m - from_m) / step_m)) + 1;
  for (std::size_t i = 0; i < ticks; ++i) gesture.depth_m.push_back(from_m + static_cast<double>(i) * step_m);
  return gesture;
}

double forceAtTick(const AxialRun& run, double tick) {
  if (run.force_N.empty()) return 0;
  const double held = std::clamp(tick, 0.0, static_cast<double>(run.force_N.size() - 1));
  const auto before = static_cast<std::size_t>(held);
  const std::size_t after = std::min(before + 1, run.force_N.size() - 1);
  return std::lerp(run.force_N[before], run.force_N[after], held - static_cast<double>(before));
}

SceneSpec fittedSceneBase() {
  SceneSpec scene;
  scene.needle_length_m = 1;
  scene.max_force_N = 50;
  scene.tracking_wall.stop_speed_mps = 0.001;
  return scene;
}

}  // namespace needlelab
