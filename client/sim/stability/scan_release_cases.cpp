/// What a needle does when the hand does not hold it, or hardly: let go in tissue, trembling at the skin.
#include <algorithm>
#include <string>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/scan_cases.h"

namespace needlelab {
namespace {

// how far the needle came back after `from_s`, against where it was then
double retreat_m(const PlantRun& run, double from_s) {
  const auto ticks = ticksIn(run, {from_s, run.ticks.back().time_s + 1});
  if (ticks.empty()) return 0;
  double most = 0;
  for (const PlantTick& tick : ticks) most = std::max(most, tick.p_W_m.z - ticks.front().p_W_m.z);
  return most;
}

int stopsAfter(const PlantRun& run, double from_s) {
  int stops = 0;
  Phase before = Phase::kStopped;
  for (const PlantTick& tick : ticksIn(run, {from_s, run.ticks.back().time_s + 1})) {
    stops += tick.report.phase == Phase::kStopped && before != Phase::kStopped;
    before = tick.report.phase;
  }
  return stops;
}

// there and back about the skin: minimum-jerk halves, near enough to a sine
HandPlan flutterPlan(double amplitude_m, double frequency_hz, std::uint64_t cycles) {
  const Quat down = orientationAlong(kInward_W);
  const auto at = [&](double depth_m) { return Pose{kInward_W * depth_m, down}; };
  HandPlan plan(at(-amplitude_m));
  plan.hold(0.3);
  for (std::uint64_t i = 0; i < cycles; ++i)
    plan.moveIn(at(amplitude_m), 0.5 / frequency_hz, Motion::kMinJerk)
        .moveIn(at(-amplitude_m), 0.5 / frequency_hz, Motion::kMinJerk);
  return plan.hold(0.3);
}

// the greatest energy that the hand was given from one entry to the next
struct EntryWork {
  int entries = 0;
  double worst_J = 0;
};
EntryWork workPerEntry(const PlantRun& run) {
  EntryWork work;
  double since_J = 0;
  for (const PlantTick& tick : run.ticks) {
    if ((tick.report.flags & kFlagEntry) == 0 || !tick.stepped) continue;
    if (work.entries > 0) work.worst_J = std::max(work.worst_J, tick.energy_J - since_J);
    since_J = tick.energy_J;
    ++work.entries;
  }
  if (work.entries > 0) work.worst_J = std::max(work.worst_J, run.ticks.back().energy_J - since_J);
  return work;
}

}  // namespace

Result<CaseOutcome> freeHandRelease(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "free_hand_release", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow free = entry.window(path);
  CaseTally tally("retreat after the hand let go [m]", entry.number("limit_m", 0), entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  plant.device.hand.let_go_s = free.from_s;
  const auto run = runScene(source, scene, path.plan, plant);
  if (!run.ok()) return run.error();
  tally.add(*run, free, retreat_m(*run, free.from_s), std::string(axialModelName(model)));
  CaseOutcome outcome = tally.finish();

  // a needle that is thrown back so fast that the stop ends stops anew
  if (const int stops = stopsAfter(*run, free.from_s); stops > 0) {
    outcome.row.note = std::to_string(stops) + (stops > 1 ? " new stops" : " new stop");
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  return outcome;
}

Result<CaseOutcome> skinFlutter(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "skin_flutter", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const double amplitude_m = entry.number("amplitude_m", 1e-6, 0.01);
  const double frequency_hz = entry.number("frequency_hz", 0.1, 30);
  const std::uint64_t cycles = entry.whole("cycles", 1);
  CaseTally tally("energy given to the hand per entry [J]", entry.number("limit_j", 0),
                  entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  const HandPlan plan = flutterPlan(amplitude_m, frequency_hz, cycles);
  const TimeWindow whole{0, plan.duration_s()};
  const auto run = runScene(source, scene, plan, plant);
  if (!run.ok()) return run.error();
  // forces come and go with every entry: only the gate and the cap tell that it grows
  const EntryWork work = workPerEntry(*run);
  tally.add(*run, whole, work.worst_J, std::string(axialModelName(model)), heldIn(*run, whole));
  CaseOutcome outcome = tally.finish();

  // a needle that hardly ever enters shows nothing
  outcome.row.note = std::to_string(work.entries) + " entries in " + std::to_string(cycles) + " cycles";
  if (2 * static_cast<std::uint64_t>(work.entries) < cycles) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  return outcome;
}

}  // namespace needlelab
