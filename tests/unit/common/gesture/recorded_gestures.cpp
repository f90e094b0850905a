#include "tests/unit/common/gesture/recorded_gestures.h"

#include <cmath>
#include <limits>

#include "common/base/text/csv.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

std::vector<TipSample> resampled(const CsvTable& table) {
  const auto column = [&](const char* name) -> const std::vector<double>& {
    return table.columns[static_cast<std::size_t>(table.find(name))];
  };
  const std::vector<double>& t = column("t_s");
  const std::vector<double>* pose[] = {&column("px_m"), &column("py_m"), &column("pz_m"), &column("qx"),
                                       &column("qy"),   &column("qz"),   &column("qw")};
  std::vector<TipSample> ticks;
  std::size_t row = 0;
  for (int tick = 0; tick * 1e-3 <= t.back() - t.front(); ++tick) {
    const double now = t.front() + tick * 1e-3;
    while (row + 2 < t.size() && t[row + 1] <= now) ++row;
    const double span = t[row + 1] - t[row];
    const double part = span > 0 ? (now - t[row]) / span : 0;
    // a quaternion and its negative are the same orientation: if neighbours have opposite signs, one is
    // negated
    double along = 0;
    for (int k = 3; k < 7; ++k) along += (*pose[k])[row] * (*pose[k])[row + 1];
    double value[7], square = 0;
    for (int k = 0; k < 7; ++k) {
      const double from = (*pose[k])[row], to = (k >= 3 && along < 0 ? -1 : 1) * (*pose[k])[row + 1];
      value[k] = from + part * (to - from);
      if (k >= 3) square += value[k] * value[k];
    }
    const double scale = 1 / std::sqrt(square);
    ticks.push_back({{value[0], value[1], value[2]},
                     {value[3] * scale, value[4] * scale, value[5] * scale, value[6] * scale}});
  }
  return ticks;
}

RecordedGesture gestureOf(const std::string& name, const std::vector<TipSample>& ticks) {
  // the sphere is around the point farthest from the start
  Vec3 far = ticks.front().p_WT_m;
  for (const TipSample& tick : ticks)
    if (norm(tick.p_WT_m - ticks.front().p_WT_m) > norm(far - ticks.front().p_WT_m)) far = tick.p_WT_m;
  SceneSpec scene = allEffects();
  scene.limb = SphereLimb{far, 0.6 * norm(far - ticks.front().p_WT_m)};
  const SceneModel model = compile(scene, 1000).value();

  RecordedGesture gesture{name, {}, 0};
  SimState state;
  ForceGate gate(DeviceLimits{}, 1000);
  StepReport report;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const bool good = gate.admit(ticks[i], true, 0);
    if (good) step(model, ticks[i], state, report);
    const Wrench wrench = gate.guard(report.wrench_W).wrench();
    GestureSample s;
    s.tick = i;
    s.time_ns = 5'000'000'000 + static_cast<std::int64_t>(i) * 1'000'000;
    const auto put = [](double(&to)[3], Vec3 from) {
      to[0] = from.x;
      to[1] = from.y;
      to[2] = from.z;
    };
    put(s.p_WT_m, ticks[i].p_WT_m);
    put(s.force_W_N, wrench.force_N);
    put(s.torque_W_Nm, wrench.torque_Nm);
    put(s.wall_W_m, report.p_wall_W_m);
    const Quat& q = ticks[i].q_WT;
    s.q_WT[0] = q.x;
    s.q_WT[1] = q.y;
    s.q_WT[2] = q.z;
    s.q_WT[3] = q.w;
    s.speed_mps = report.speed_mps;
    s.insertion_m = report.insertion_m;
    s.lateral_error_m = report.lateral_error_m;
    s.layer = static_cast<std::int8_t>(report.layer);
    s.phase = static_cast<std::uint8_t>(report.phase);
    s.flags = report.flags | gate.flags();
    s.fault = static_cast<std::uint8_t>(gate.fault());
    gesture.share_in_tissue += s.layer >= 0 ? 1.0 / static_cast<double>(ticks.size()) : 0;
    gesture.samples.push_back(s);
  }
  return gesture;
}

}  // namespace

std::vector<RecordedGesture> recordedGestures(const Recordings& recordings) {
  std::vector<RecordedGesture> gestures;
  for (const std::string name : kPoseRecordings) {
    const auto table = readCsv(recordings.folder / "virtuose" / (name + ".csv"),
                               {"t_s", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"});
    if (table.ok()) gestures.push_back(gestureOf(name, resampled(*table)));
  }
  return gestures;
}

}  // namespace needlelab::test
