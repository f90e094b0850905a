#include "stability/closed_loop_case.h"

#include <algorithm>
#include <utility>

namespace needlelab {
namespace {

constexpr double kRestless_N = 0.05;

std::optional<double> greater(std::optional<double> a, std::optional<double> b) {
  if (!a || !b) return a ? a : b;
  return std::max(*a, *b);
}

}  // namespace

Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options) {
  auto made = source(scene, options.rate_hz);
  if (!made.ok()) return made.error();
  return runPlant(**made, plan, options);
}

CaseRow measuredRow(const PlantRun& run, TimeWindow window, const BandFilter& band) {
  CaseRow row;
  row.finite = allFinite(run);
  row.max_force_N = maxForce_N(run);
  row.max_unexplained_step_N = maxUnexplainedStep_N(run);
  row.chatter_N = chatterOf(run, kInward_W, window, band);
  row.energy_J = run.ticks.empty() ? 0 : run.ticks.back().energy_J;
  return row;
}

void worsen(CaseRow& row, const CaseRow& other) {
  row.finite = row.finite && other.finite;
  row.max_force_N = greater(row.max_force_N, other.max_force_N);
  row.max_unexplained_step_N = greater(row.max_unexplained_step_N, other.max_unexplained_step_N);
  row.chatter_N = greater(row.chatter_N, other.chatter_N);
  row.energy_J = greater(row.energy_J, other.energy_J);
}

bool growsIn(const PlantRun& run, TimeWindow window) {
  const auto ticks = ticksIn(run, window);
  const bool held = std::any_of(ticks.begin(), ticks.end(), [](const PlantTick& tick) {
    return (tick.gate_flags & (kGatePeakLimited | kGateFaulted)) != 0 ||
           (tick.report.flags & kFlagForceCapped) != 0;
  });
  return held || run.fault != Fault::kNone || grows(forceAlong(ticks, kInward_W), kRestless_N);
}

CaseTrace traceOf(const PlantRun& run, std::string label) {
  CaseTrace trace{std::move(label), {}, {}};
  for (const PlantTick& tick : run.ticks) {
    trace.time_s.push_back(tick.time_s);
    trace.force_N.push_back(-dot(tick.report.wrench_W.force_N, kInward_W));
  }
  return trace;
}

}  // namespace needlelab
