/// creep_then_stop and stop_once: what a stop does to the force and to the hand.
#include <algorithm>
#include <cmath>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/hold_cases.h"

namespace needlelab {
namespace {

// how often the phase becomes STOPPED
int stopsIn(std::span<const PlantTick> ticks) {
  int stops = 0;
  Phase before = Phase::kFree;
  for (const PlantTick& tick : ticks) {
    if (tick.report.phase == Phase::kStopped && before != Phase::kStopped) ++stops;
    before = tick.report.phase;
  }
  return stops;
}

}  // namespace

Result<CaseOutcome> creepThenStop(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  if (!hasStop(model)) return CaseOutcome{};
  CaseEntry entry(settings.file, "creep_then_stop", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  CaseTally tally("distance from f_rej [N]", entry.number("limit", 0), entry.chatterFilter());
  for (const double speed_mps : entry.numbers("creep_m_s")) {
    // the path's creep is written for 1 m/s
    const TimedPlan path = entry.path("path", {0, speed_mps, "creep"});
    const TimeWindow window = entry.window(path);
    if (!entry.status().ok()) return entry.status().error();
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    double worst = 0;
    for (const double force : forceAlong(ticksIn(*run, window), kInward_W))
      worst = std::max(worst, std::abs(-force - scene.layers.front().rejection_force_N));
    tally.add(*run, window, worst, "creeping");
  }
  return tally.finish();
}

Result<CaseOutcome> stopOnce(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  if (!hasStop(model)) return CaseOutcome{};
  CaseEntry entry(settings.file, "stop_once", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const double limit = entry.number("limit", 0);
  CaseTally tally("stops in one hold", limit, entry.chatterFilter());
  bool stopped_at_all = true;
  for (const double stiffness : entry.numbers("hand_stiffness_n_per_m")) {
    plant.device.hand.stiffness_N_per_m = stiffness;
    // a softer hand aims further, so that all of them are as deep when the stop begins
    const TimedPlan path =
        entry.path("path", {scene.layers.front().cutting_force_N / std::max(1.0, stiffness), 1});
    const TimeWindow window = entry.window(path);
    if (!entry.status().ok()) return entry.status().error();
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    const int stops = stopsIn(ticksIn(*run, window));
    stopped_at_all = stopped_at_all && stops > 0;
    tally.add(*run, window, stops, "hand of " + std::to_string(static_cast<int>(stiffness)) + " N/m");
  }
  CaseOutcome outcome = tally.finish();
  if (!stopped_at_all) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = "one of the hands was never seen to stop";
  }
  return outcome;
}

}  // namespace needlelab
