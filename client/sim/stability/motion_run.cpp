#include "client/sim/stability/motion_run.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/stability/passivity_check.h"
#include "client/sim/stability/passivity_file.h"

namespace needlelab {

Result<MotionRun> runMotion(const ForceSourceFactory& make_source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz) {
  auto source = make_source(scene, rate_hz);
  if (!source.ok()) return source.error();
  MotionRun run{rate_hz, (*source)->axialStiffness_N_per_m(), {}};
  run.ticks.reserve(samples.size());
  for (const TipSample& tip : samples) {
    MotionTick& tick = run.ticks.emplace_back();
    tick.tip = tip;
    (*source)->step(tip, tick.report);
    tick.slant = (*source)->slant();
  }
  return run;
}

std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz) {
  const auto ticks = static_cast<std::size_t>(std::floor(plan.duration_s() * rate_hz + 0.5)) + 1;
  std::vector<TipSample> samples;
  samples.reserve(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    const Pose pose = plan.at(static_cast<double>(k) / rate_hz).X_WT;
    samples.push_back({pose.p, pose.q});
  }
  return samples;
}

Result<PassivityGesture> motionOf(const CaseSettings& settings, std::string_view case_name,
                                  std::string_view field) {
  const auto& cases = settings.file.json().at("cases");
  const std::string name(case_name), key(field);
  const std::string where = settings.file.source() + ": cases." + name + "." + key;
  const auto found = cases.find(name);
  if (found == cases.end() || !found->is_object() || !found->contains(key))
    return Error{ErrorCode::kInvalidInput, where + ": missing"};
  PassivityGesture gesture;
  if (Status status = readMotion((*found)[key], where, gesture); !status.ok()) return status.error();
  return gesture;
}

PassivityRecord observed(const MotionRun& run, bool with_slant) {
  PassivityObserver observer(run.axial_stiffness_N_per_m);
  for (const MotionTick& tick : run.ticks) observer.add(tick.tip, tick.report, with_slant ? tick.slant : 1.0);
  return observer.record();
}

CaseRow rowOf(const PassivityRecord& record) {
  CaseRow row;
  row.finite = record.finite;
  row.max_force_N = record.max_force_N;
  row.max_unexplained_step_N = record.worst_step_N;
  row.energy_J = judgedEnergy_J(record);
  return row;
}

CaseRow rowOf(const std::vector<GatedTick>& ticks) {
  CaseRow row;
  row.finite = true;
  row.max_force_N = 0;
  for (const GatedTick& tick : ticks) {
    row.finite = row.finite && isFinite(tick.out_W.force_N) && isFinite(tick.out_W.torque_Nm);
    row.max_force_N = std::max(*row.max_force_N, norm(tick.out_W.force_N));
  }
  return row;
}

void judgeMotion(CaseRow& row, std::string quantity, double measured, double limit) {
  row.quantity = std::move(quantity);
  row.measured = measured;
  row.limit = limit;
  judge(row, false);
}

CaseTrace forceTrace(const MotionRun& run, std::string label) {
  CaseTrace trace{std::move(label), {}, {}};
  for (std::size_t k = 0; k < run.ticks.size(); ++k) {
    trace.time_s.push_back(static_cast<double>(k) / run.rate_hz);
    trace.force_N.push_back(norm(run.ticks[k].report.wrench_W.force_N));
  }
  return trace;
}

}  // namespace needlelab
