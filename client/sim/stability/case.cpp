#include "client/sim/stability/case.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/haptics/axial_entry.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {

std::vector<StabilityCase> allCases() {
  std::vector<StabilityCase> all;
  for (auto&& part :
       {holdCases(), motionCases(), scanCases(), loadCases(), gestureCases(), deviceCases(), lineCases()})
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

namespace {

constexpr double kRestless_N = 0.05;

// Sets `passed` and `verdict` from `measured ≤ limit`, `finite` and whether the run grows.
void judgeRow(CaseRow& row, bool growing) {
  // two encoder counts of 5 mN equal 0.01 N up to rounding
  constexpr double kRounding = 1 + 1e-9;
  row.applicable = true;
  row.passed = row.finite && !growing && row.measured && row.limit && *row.measured <= *row.limit * kRounding;
  if (row.passed)
    row.verdict = Verdict::kStable;
  else
    row.verdict = !row.finite || growing ? Verdict::kDiverges : Verdict::kChatters;
}

// An infinite margin comes from a run without stiffness; report no number.
std::optional<double> finiteOf(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace

Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source) {
  CaseOutcome outcome;
  if (hard_case.axial || model == AxialModel::kEnhancedTrackingWall) {
    Trial trial(settings, hard_case.name, model, source);
    if (hard_case.scene) trial.wall = trial.CaseEntry::scene();
    RETURN_IF_ERROR(trial.status());
    if (hard_case.scene) trial.scene = likeForLike(trial.wall, model);
    RETURN_IF_ERROR(hard_case.run(trial));
    RETURN_IF_ERROR(trial.status());
    if (trial.row().limit) trial.require(true);
    outcome = std::move(trial.outcome);
  }
  CaseEntry entry(settings.file, hard_case.name);
  outcome.row.case_name = hard_case.name;
  outcome.row.title = entry.has("title") ? entry.text("title") : hard_case.name;
  outcome.row.model = model;
  return outcome;
}

Trial::Trial(const CaseSettings& of, std::string_view name, AxialModel with, ForceSourceFactory from)
    : CaseEntry(of.file, name, of.long_form),
      settings(of),
      model(with),
      source(std::move(from)),
      plant(CaseEntry::plant()) {
  row().finite = true;
}

bool Trial::hasStop() const {
  return axialEntry(model).has_tracking_wall;
}

Status Trial::notApplicable(std::string note) {
  outcome = {};
  row().note = std::move(note);
  return {};
}

void Trial::judges(std::string quantity, double limit) {
  row().quantity = std::move(quantity);
  row().limit = limit;
}

void Trial::judge(std::string quantity, double measured, double limit, std::string note) {
  judges(std::move(quantity), limit);
  row().measured = measured;
  row().note = std::move(note);
  judgeRow(row(), growing);
}

void Trial::require(bool holds, std::string_view what) {
  if (!row().applicable) judgeRow(row(), growing);
  if (holds) return;
  if (row().verdict == Verdict::kStable) row().verdict = Verdict::kChatters;
  row().passed = false;
  if (!what.empty()) row().note.append(row().note.empty() ? "" : "; ").append("not so: ").append(what);
}

Result<PlantRun> Trial::loop(const HandPlan& plan) {
  RETURN_IF_ERROR(status());
  return runScene(source, scene, plan, plant);
}

void Trial::add(const PlantRun& run, TimeWindow window, double measured, bool run_grows) {
  worsen(row(), measuredRow(run, window));
  growing = growing || run_grows;
  // NaN counts as the worst value
  if (row().measured && !std::isnan(measured) && !(measured > *row().measured)) return;
  row().measured = measured;
  outcome.trace = traceOf(run, window);
}

Status Trial::onPath(const CaseMeasure& measure, const PathChange& change) {
  const TimedPlan timed = path("path", change);
  const TimeWindow of = window(timed);
  ASSIGN_OR_RETURN(const auto run, loop(timed.plan));
  add(run, of, measure(run, of));
  return {};
}

Result<MotionRun> Trial::move(const std::vector<TipSample>& samples, double rate_hz) {
  RETURN_IF_ERROR(status());
  ASSIGN_OR_RETURN(auto run, runMotion(source, scene, samples, rate_hz));
  worsen(row(), rowOf(observed(run)));
  return run;
}

Result<std::vector<GatedTick>> Trial::gated(const std::vector<DeviceSample>& samples, bool in_row) {
  RETURN_IF_ERROR(status());
  ASSIGN_OR_RETURN(auto made, source(scene, kMotionRate_hz));
  GatedSource behind(std::move(made), scene.limb, settings.control.gate);
  std::vector<GatedTick> ticks;
  ticks.reserve(samples.size());
  CaseRow sent;
  sent.finite = true;
  sent.max_force_N = 0;
  for (const DeviceSample& sample : samples) {
    const Wrench& out = ticks.emplace_back(behind.next(sample)).out_W;
    sent.finite = sent.finite && isFinite(out.force_N) && isFinite(out.torque_Nm);
    sent.max_force_N = std::max(*sent.max_force_N, norm(out.force_N));
  }
  if (in_row) worsen(row(), sent);
  return ticks;
}

Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options) {
  ASSIGN_OR_RETURN(auto made, source(scene, options.rate_hz));
  return runPlant(*made, plan, options);
}

Result<MotionRun> runMotion(const ForceSourceFactory& make_source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  MotionRun run{source->axialStiffness_N_per_m(), {}};
  run.ticks.reserve(samples.size());
  for (const TipSample& tip : samples) {
    MotionTick& tick = run.ticks.emplace_back();
    tick.tip = tip;
    source->step(tip, tick.report);
    tick.slant = source->slant();
  }
  return run;
}

PassivityRecord observed(const MotionRun& run) {
  PassivityObserver observer(run.axial_stiffness_N_per_m);
  for (const MotionTick& tick : run.ticks) observer.add(tick.tip, tick.report, tick.slant);
  return observer.record();
}

CaseRow measuredRow(const PlantRun& run, TimeWindow window) {
  CaseRow row;
  row.finite = allFinite(run);
  row.max_force_N = maxForce_N(run);
  row.max_unexplained_step_N = maxUnexplainedStep_N(run);
  row.chatter_N = chatterOf(run, kInward_W, window);
  row.second_energy_J = greatestInASecond_J(ticksIn(run, window), run.rate_hz);
  row.energy_J = run.ticks.empty() ? 0 : run.ticks.back().energy_J;
  row.coupled_margin = finiteOf(run.margins.coupled);
  row.passive_margin = finiteOf(run.margins.passive);
  row.grip_energy_J = run.grip_energy_J;
  return row;
}

CaseRow rowOf(const PassivityRecord& record) {
  CaseRow row;
  row.finite = record.finite;
  row.max_force_N = record.max_force_N;
  row.max_unexplained_step_N = record.worst_step_N;
  row.energy_J = judgedEnergy_J(record);
  return row;
}

void worsen(CaseRow& row, const CaseRow& other) {
  row.finite = row.finite && other.finite;
  for (std::optional<double> CaseRow::*number :
       {&CaseRow::max_force_N, &CaseRow::max_unexplained_step_N, &CaseRow::chatter_N, &CaseRow::energy_J,
        &CaseRow::grip_energy_J, &CaseRow::controlled_energy_J, &CaseRow::distortion_N,
        &CaseRow::second_energy_J, &CaseRow::hold_swing_N})
    if (other.*number) row.*number = std::max((row.*number).value_or(*(other.*number)), *(other.*number));
  for (std::optional<double> CaseRow::*margin : {&CaseRow::coupled_margin, &CaseRow::passive_margin})
    if (other.*margin) row.*margin = std::min((row.*margin).value_or(*(other.*margin)), *(other.*margin));
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

double peakToPeakIn(const PlantRun& run, TimeWindow window) {
  return peakToPeak(forceAlong(ticksIn(run, window), kInward_W));
}

CaseTrace traceOf(const PlantRun& run, TimeWindow window) {
  CaseTrace trace{{}, {}, window.from_s, window.to_s};
  for (const PlantTick& tick : ticksIn(run, window)) {
    trace.time_s.push_back(tick.time_s);
    trace.force_N.push_back(-dot(tick.report.wrench_W.force_N, kInward_W));
  }
  return trace;
}

}  // namespace needlelab
