/// Bad samples of a device: jumps, numbers that are none, silence, a reversed needle. DESIGN §3.7 says what
/// the force does then.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/range.h"
#include "stability/gated_run.h"
#include "stability/hostile_samples.h"
#include "stability/motion_cases.h"
#include "stability/motion_run.h"
#include "stability/round_number.h"

namespace needlelab {
namespace {

constexpr double kRate_hz = 1000, kSpeed_mps = 0.02;
constexpr double kAnyForce_N = 0.01;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// samples of a needle that goes straight in and out of the plane z = 0
class Script {
 public:
  Script() { now_.tip = {{0, 0, 0.005}, orientationAlong({0, 0, -1})}; }
  Script& rest(double seconds) {
    for (std::size_t k = ticksOf(seconds); k > 0; --k) samples_.push_back(now_);
    return *this;
  }
  Script& goTo(double depth_m, double speed_mps) {
    const double from = now_.tip.p_WT_m.z, way = -depth_m - from;
    const std::size_t ticks = ticksOf(std::abs(way) / speed_mps);
    for (std::size_t k = 1; k <= ticks; ++k) {
      now_.tip.p_WT_m.z = from + way * static_cast<double>(k) / static_cast<double>(ticks);
      samples_.push_back(now_);
    }
    return *this;
  }
  // for a while the device says something else
  template <typename Change>
  Script& with(double seconds, const Change& change) {
    for (std::size_t k = 0; k < ticksOf(seconds); ++k) {
      samples_.push_back(now_);
      change(samples_.back(), k);
    }
    return *this;
  }
  Script& acknowledge() {
    samples_.back().acknowledge = true;
    return *this;
  }
  [[nodiscard]] std::size_t ticks() const { return samples_.size(); }
  [[nodiscard]] const std::vector<DeviceSample>& samples() const { return samples_; }

 private:
  static std::size_t ticksOf(double seconds) { return static_cast<std::size_t>(seconds * kRate_hz + 0.5); }
  DeviceSample now_;
  std::vector<DeviceSample> samples_;
};

CaseRow gatedRow(const std::vector<GatedTick>& ticks) {
  CaseRow row;
  row.finite = true;
  row.max_force_N = 0;
  for (const GatedTick& tick : ticks) {
    row.finite = row.finite && isFinite(tick.out_W.force_N) && isFinite(tick.out_W.torque_Nm);
    row.max_force_N = std::max(*row.max_force_N, norm(tick.out_W.force_N));
  }
  return row;
}

struct GateEntry {
  SceneSpec scene;
  double depth_m = 0, limit = 0;
};
Result<GateEntry> gateEntry(const CaseSettings& settings, std::string_view name, AxialModel model) {
  CaseEntry entry(settings.file, name, settings.long_form);
  GateEntry out{entry.scene(model), entry.number("depth_m", 0.0005, 0.05), entry.number("limit", 0)};
  if (!entry.status().ok()) return entry.status().error();
  return out;
}

// A short disturbance is bridged, a long one ends in FAULT until the tip is out and a person has seen it;
// then the force comes back.
struct Disturbance {
  std::function<void(DeviceSample&, std::size_t)> change;
  double short_s = 0.003, long_s = 0.2;
  std::size_t held_ticks = 5, slack_ticks = 0;
  Fault fault = Fault::kSampleNotFinite;
};

struct Outcome {
  CaseRow row;
  double violation_N = 0;
};

Result<Outcome> disturbed(const GateEntry& entry, const ForceSourceFactory& source, const Disturbance& by,
                          Gate gate) {
  Script script;
  script.rest(0.3).goTo(entry.depth_m, kSpeed_mps).rest(0.02);
  const std::size_t glitch = script.ticks();
  script.with(by.short_s, by.change);
  const std::size_t after_glitch = script.ticks();
  script.rest(0.02);
  FaultTimeline timeline;
  timeline.from = script.ticks();
  timeline.held_ticks = by.held_ticks;
  timeline.slack_ticks = by.slack_ticks;
  timeline.fault = by.fault;
  // acknowledged inside: the tip must have been outside as well
  script.with(by.long_s, by.change).rest(0.05).acknowledge().rest(0.05).goTo(-0.005, kSpeed_mps);
  script.rest(0.3).goTo(entry.depth_m, kSpeed_mps).rest(0.01);
  const std::size_t again = script.ticks() - 1;
  script.goTo(-0.005, kSpeed_mps);

  const auto ticks = runGated(source, entry.scene, script.samples(), kRate_hz, gate == Gate::kPresent);
  if (!ticks.ok()) return ticks.error();
  for (timeline.restart = timeline.from + 1;
       timeline.restart < ticks->size() &&
       !((*ticks)[timeline.restart].sample.fresh && (*ticks)[timeline.restart].depth_m <= 0 &&
         isFinite((*ticks)[timeline.restart].sample.tip.p_WT_m));)
    ++timeline.restart;

  Outcome outcome{gatedRow(*ticks), violationOf(*ticks, timeline)};
  const Vec3 held = (*ticks)[glitch - 1].out_W.force_N;
  for (std::size_t k = glitch; k < after_glitch; ++k)
    outcome.violation_N = std::max(outcome.violation_N, norm((*ticks)[k].out_W.force_N - held));
  for (std::size_t k = glitch; k < timeline.from; ++k)
    if ((*ticks)[k].fault != Fault::kNone) outcome.violation_N = std::numeric_limits<double>::infinity();
  // an engine that never comes back would keep to any timeline
  if (norm((*ticks)[again].out_W.force_N) < 0.5 * norm(held) || !(norm(held) > kAnyForce_N))
    outcome.violation_N = std::numeric_limits<double>::infinity();
  return outcome;
}

void worsenRow(CaseRow& row, const CaseRow& one) {
  row.finite = row.finite && one.finite;
  row.max_force_N = std::max(row.max_force_N.value_or(0), one.max_force_N.value_or(0));
}

constexpr const char* kDeparture = "greatest departure from what is allowed [N, N·m]";
constexpr const char* kQuantity = "greatest departure from the timeline of §3.7 [N]";

Result<CaseOutcome> disturbances(const CaseSettings& settings, std::string_view name, AxialModel model,
                                 const ForceSourceFactory& source, Gate gate,
                                 const std::vector<Disturbance>& all) {
  const auto entry = gateEntry(settings, name, model);
  if (!entry.ok()) return entry.error();
  CaseOutcome outcome;
  outcome.row.finite = true;
  double violation = 0;
  for (const Disturbance& one : all) {
    const auto ran = disturbed(*entry, source, one, gate);
    if (!ran.ok()) return ran.error();
    worsenRow(outcome.row, ran->row);
    violation = std::max(violation, ran->violation_N);
  }
  judgeMotion(outcome.row, kQuantity, violation, entry->limit);
  return outcome;
}

}  // namespace

Result<CaseOutcome> startsInside(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "starts_inside", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const double rate = entry.number("rate_hz", 50, 40'000), limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  const auto run = runMotion(source, scene, samplesOf(path.plan, rate), rate);
  if (!run.ok()) return run.error();
  CaseOutcome outcome{rowOf(observed(*run)), {forceTrace(*run, std::string(axialModelName(model)))}};
  bool outside = false;
  double before = 0, after = 0;
  for (const MotionTick& tick : run->ticks) {
    outside = outside || tick.report.depth_m <= 0;
    double& seen = outside ? after : before;
    seen = std::max(seen, norm(tick.report.wrench_W.force_N));
  }
  judgeMotion(outcome.row, "greatest force before the tip was outside [N]", before, limit);
  // no force at all would be no answer either
  if (!(after > kAnyForce_N)) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = "no force after the tip was outside";
  }
  return outcome;
}

Result<CaseOutcome> teleport(const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source,
                             Gate gate) {
  Disturbance aside, deeper;
  aside.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x += 0.05; };
  deeper.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z -= 0.05; };
  aside.fault = deeper.fault = Fault::kTipTooFast;
  return disturbances(settings, "teleport", model, source, gate, {aside, deeper});
}

Result<CaseOutcome> notANumber(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source, Gate gate) {
  std::vector<Disturbance> all(4);
  all[0].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z = kNaN; };
  all[1].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x = HUGE_VAL; };
  all[2].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT.w = kNaN; };
  all[3].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT = {0, 0, 0, 0}; };
  all[3].fault = Fault::kOrientationInvalid;
  return disturbances(settings, "not_a_number", model, source, gate, all);
}

Result<CaseOutcome> frozenDevice(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source, Gate gate) {
  // silence: held until the watchdog notices, then as for any fault
  CaseEntry numbers(settings.file, "frozen_device", settings.long_form);
  Disturbance silence;
  silence.change = [](DeviceSample& sample, std::size_t) { sample.fresh = false; };
  silence.fault = Fault::kDeviceSilent;
  silence.short_s = 0.015;
  silence.held_ticks = 6;
  silence.slack_ticks =
      static_cast<std::size_t>(numbers.number("watchdog_s", 0.01, 2) * kRate_hz) - silence.held_ticks;
  const double rest_s = numbers.number("rest_s", 0.5, 60), rejection_limit = numbers.number("rest_limit", 0);
  if (!numbers.status().ok()) return numbers.status().error();
  auto outcome = disturbances(settings, "frozen_device", model, source, gate, {silence});
  if (!outcome.ok()) return outcome;

  // the same place again and again: a hand at rest
  const auto entry = gateEntry(settings, "frozen_device", model);
  if (!entry.ok()) return entry.error();
  Script script;
  script.rest(0.3).goTo(entry->depth_m, kSpeed_mps).rest(rest_s);
  const auto ticks = runGated(source, entry->scene, script.samples(), kRate_hz, gate == Gate::kPresent);
  if (!ticks.ok()) return ticks.error();
  const double rejection = entry->scene.layers.front().rejection_force_N;
  const double left = std::max(0.0, norm(ticks->back().out_W.force_N) - rejection);
  CaseRow& row = outcome->row;
  if (row.passed) judgeMotion(row, "force after a rest, beyond f_rej [N]", left, rejection_limit);
  row.note = "at rest the force ends " + numberText(roundedTo(left, 3)) + " N above f_rej";
  return outcome;
}

Result<CaseOutcome> flippedAxis(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source, Gate gate) {
  CaseEntry numbers(settings.file, "flipped_axis", settings.long_form);
  const SceneSpec scene = numbers.scene(model);
  const double limit = numbers.number("limit", 0);
  // with FEM each random scene is a mesh of its own
  const std::uint64_t fuzzed =
      numbers.whole(model == AxialModel::kFem ? "fuzzed_ticks_fem" : "fuzzed_ticks", 1000);
  if (!numbers.status().ok()) return numbers.status().error();

  // the same insertion, the needle upright, or reversed for a while or all the time
  const auto flipped = [&](bool at_entry, auto change) {
    Script script;
    script.rest(0.3);
    if (at_entry)
      script.with(0.05, change);
    else
      script.goTo(0.015, kSpeed_mps).rest(0.1).with(0.05, change).rest(0.3);
    return script.goTo(0.02, kSpeed_mps).goTo(-0.005, kSpeed_mps).samples();
  };
  const auto upright = [](DeviceSample&, std::size_t) {};
  const auto reversed = [](DeviceSample& s, std::size_t) { s.tip.q_WT = Quat{1, 0, 0, 0} * s.tip.q_WT; };
  const auto nearly = [](DeviceSample& s, std::size_t) {
    s.tip.q_WT = normalized(Quat{1, 0, 0, 0.1}) * s.tip.q_WT;
  };
  const auto negative = [](DeviceSample& s, std::size_t) {
    s.tip.q_WT = {-s.tip.q_WT.x, -s.tip.q_WT.y, -s.tip.q_WT.z, -s.tip.q_WT.w};
  };

  CaseOutcome outcome;
  outcome.row.finite = true;
  double violation = 0;
  const bool with_gate = gate == Gate::kPresent;
  const auto plain = runGated(source, scene, flipped(false, upright), kRate_hz, with_gate);
  if (!plain.ok()) return plain.error();
  const std::vector<std::vector<DeviceSample>> scripts = {flipped(false, reversed), flipped(false, nearly),
                                                          flipped(false, negative)};
  for (const auto& samples : scripts) {
    const auto ticks = runGated(source, scene, samples, kRate_hz, with_gate);
    if (!ticks.ok()) return ticks.error();
    worsenRow(outcome.row, gatedRow(*ticks));
    for (std::size_t k = 1; k < ticks->size(); ++k) {
      // the trajectory was fixed at entry: what the handle shows later changes no force; torque comes slowly
      violation = std::max(violation, norm((*ticks)[k].out_W.force_N - (*plain)[k].out_W.force_N));
      const double step = norm((*ticks)[k].out_W.torque_Nm - (*ticks)[k - 1].out_W.torque_Nm);
      violation = std::max(violation, step - 0.1);  // N·m per ms, §3.7
    }
  }
  const auto fuzz = fuzzSource(source, model, fuzzed, with_gate);
  if (!fuzz.ok()) return fuzz.error();
  outcome.row.finite = outcome.row.finite && fuzz->finite;
  outcome.row.max_force_N = std::max(*outcome.row.max_force_N, fuzz->max_force_N);
  violation = std::max({violation, fuzz->excess_force_N, fuzz->excess_rendered_N});
  if (fuzz->direction_error > 1e-12) violation = std::max(violation, fuzz->direction_error);
  judgeMotion(outcome.row, kDeparture, violation, limit);
  outcome.row.note = std::to_string(fuzz->ticks) + " fuzzed ticks, |u| within " +
                     numberText(fuzz->direction_error) + " of 1";
  return outcome;
}

}  // namespace needlelab
