#include "client/sim/stability/closed_loop_case.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace needlelab {
namespace {

constexpr double kRestless_N = 0.05;

void raise(std::optional<double>& worst, std::optional<double> other) {
  if (other) worst = worst ? std::max(*worst, *other) : *other;
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
  raise(row.max_force_N, other.max_force_N);
  raise(row.max_unexplained_step_N, other.max_unexplained_step_N);
  raise(row.chatter_N, other.chatter_N);
  raise(row.energy_J, other.energy_J);
}

bool heldIn(const PlantRun& run, TimeWindow window) {
  const auto ticks = ticksIn(run, window);
  return run.fault != Fault::kNone || std::any_of(ticks.begin(), ticks.end(), [](const PlantTick& tick) {
           return (tick.gate_flags & (kGatePeakLimited | kGateFaulted)) != 0 ||
                  (tick.report.flags & kFlagForceCapped) != 0;
         });
}

bool growsIn(const PlantRun& run, TimeWindow window) {
  return heldIn(run, window) || grows(forceAlong(ticksIn(run, window), kInward_W), kRestless_N);
}

CaseTrace traceOf(const PlantRun& run, std::string label) {
  CaseTrace trace;
  trace.label = std::move(label);
  for (const PlantTick& tick : run.ticks) {
    trace.time_s.push_back(tick.time_s);
    trace.force_N.push_back(-dot(tick.report.wrench_W.force_N, kInward_W));
  }
  return trace;
}

CaseTally::CaseTally(std::string quantity, double limit, const BandFilter& band) : band_(band) {
  outcome_.row.quantity = std::move(quantity);
  outcome_.row.limit = limit;
  outcome_.row.finite = true;
}

void CaseTally::add(const PlantRun& run, TimeWindow window, double measured, const std::string& label,
                    bool growing) {
  const CaseRow row = measuredRow(run, window, band_);
  CaseRow& worst = outcome_.row;
  worsen(worst, row);
  growing_ = growing_ || growing;
  // a measure that is no number is the worst of all
  if (worst.measured && !std::isnan(measured) && !(measured > *worst.measured)) return;
  worst.measured = measured;
  outcome_.traces = {traceOf(run, label)};
  outcome_.traces.front().from_s = window.from_s;
  outcome_.traces.front().to_s = window.to_s;
}

CaseOutcome CaseTally::finish() {
  judge(outcome_.row, growing_);
  return std::move(outcome_);
}

}  // namespace needlelab
