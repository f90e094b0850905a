/// Closed-loop cases of stiffness, release, reversal and late ticks.

#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/loop/stiffness_theory.h"
#include "client/sim/stability/scan_nudge.h"

namespace needlelab {
namespace {

// A nudge at each rate and delay, and at the plant's own rate with other hands, from nearly free to stiff.
Status stiffnessScan(Trial& t) {
  struct Point {
    double hand_N_per_m = 0, hand_Ns_per_m = 0;
    double rate_hz = 0, delay_ticks = 0;
    double share = 0;  // of the theoretical limit
  };
  const NudgeOptions options = nudgeOptionsOf(t);
  const auto shares = t.numbers("shares"), delays = t.numbers("delays_ticks");
  const auto stiffnesses = t.numbers("hands.stiffness_n_per_m"),
             dampings = t.numbers("hands.damping_ns_per_m");
  PlantOptions& plant = t.plant;
  HandOptions& hand = plant.device.hand;
  std::vector<Point> points;
  for (const double rate : t.numbers("rates_hz"))
    for (const double delay : delays)
      for (const double share : shares)
        points.push_back({hand.stiffness_N_per_m, hand.damping_Ns_per_m, rate, delay, share});
  for (std::size_t i = 0; i < std::min(stiffnesses.size(), dampings.size()); ++i)
    for (const double delay : delays)
      points.push_back({stiffnesses[i], dampings[i], plant.rate_hz, delay, shares.back()});
  RETURN_IF_ERROR(t.status());

  ASSIGN_OR_RETURN(const auto scanned, ScannedModel::prepare(t.wall, t.model, plant, options));
  t.judges(fmt::format("nudges of {} that do not die out", points.size()), 0);
  int swinging = 0;
  for (const Point& at : points) {
    plant.rate_hz = at.rate_hz;
    plant.device.delay_ticks = static_cast<std::uint32_t>(at.delay_ticks);
    hand.stiffness_N_per_m = at.hand_N_per_m;
    hand.damping_Ns_per_m = at.hand_Ns_per_m;
    const double damping = plant.device.limits.damping_Ns_per_m + at.hand_Ns_per_m;
    const double stiffness =
        std::min(at.share * passiveStiffnessLimit(damping, 1 / at.rate_hz, at.delay_ticks),
                 kMaxProfileStiffness_N_per_m);
    ASSIGN_OR_RETURN(const auto run, nudge(t.source, scanned.with(stiffness), stiffness, plant, options));
    if (!run.outcome.stable) {
      ++swinging;
      t.row().note =
          fmt::format("swings on at K {:.0f} N/m, {:g} Hz, {} ticks late, hand {:g} N/m", stiffness,
                      plant.rate_hz, static_cast<unsigned>(plant.device.delay_ticks), hand.stiffness_N_per_m);
    }
    t.add(run.run, run.watch, swinging, !run.outcome.finite || run.outcome.fault != Fault::kNone);
  }
  return {};
}

// The tissue itself can exert any force between full cutting and full attraction.
Status overLimitBounded(Trial& t) {
  const TimedPlan path = t.path();
  const double share = t.number("limit_share", 0);
  ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
  const LayerSpec& layer = t.wall.layers.front();
  t.judges("force peak-to-peak [N]", share * (layer.cutting_force_N + layer.attracted_force_N));
  // includes insertion and withdrawal; the run is expected to swing, only the bound counts
  const TimeWindow whole{0, path.plan.duration_s() + 1};
  t.add(run, whole, peakToPeakIn(run, whole), heldIn(run, whole));
  if (t.model == AxialModel::kFem) t.row().note = "as soft as its Young's modulus: far below the limit";
  return {};
}

// Each seed draws different ticks.
Status lateAndMissingTicks(Trial& t) {
  t.judges("force peak-to-peak in the hold [N]", t.number("limit", 0));
  const std::uint64_t seeds = t.whole("seeds", 1);
  for (std::uint64_t i = 0; i < seeds; ++i, ++t.plant.seed) RETURN_IF_ERROR(t.onPath(peakToPeakIn));
  return {};
}

Status frictionReversal(Trial& t) {
  const TimedPlan path = t.path();
  const TimeWindow after_out = t.window(path, "after_out"), after_in = t.window(path, "after_in");
  t.judges("force peak-to-peak after a reversal [N]", t.number("limit", 0));
  ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
  for (const TimeWindow& after : {after_out, after_in}) t.add(run, after, peakToPeakIn(run, after));
  return {};
}

TimeWindow fromOn(const PlantRun& run, double from_s) {
  return {from_s, run.ticks.back().time_s + 1};
}

// How far the needle came back after `from_s`, relative to its position then.
double retreat_m(const PlantRun& run, double from_s) {
  const auto ticks = ticksIn(run, fromOn(run, from_s));
  double most = 0;
  for (const PlantTick& tick : ticks) most = std::max(most, tick.p_W_m.z - ticks.front().p_W_m.z);
  return most;
}

// Amplitude of the needle's motion in the last half second.
double swingAtTheEnd_m(const PlantRun& run) {
  const double end_s = run.ticks.back().time_s + 1e-9;
  std::vector<double> z_m;
  for (const PlantTick& tick : ticksIn(run, {end_s - 0.5, end_s})) z_m.push_back(tick.p_W_m.z);
  return peakToPeak(z_m);
}

// A needle that is thrown back fast enough to end the stop must stop again.
void judgeNewStops(Trial& t, int stops) {
  if (!t.hasStop() || stops == 0) return;
  t.row().note +=
      fmt::format("{}{}{}", t.row().note.empty() ? "" : "; ", stops, stops > 1 ? " new stops" : " new stop");
  t.require(false);
}

// The hand releases the needle in the path's window.
TimedPlan pathWithRelease(Trial& t) {
  TimedPlan path = t.path();
  t.plant.device.hand.release_s = t.window(path).from_s;
  return path;
}

Status freeHandRelease(Trial& t) {
  const TimedPlan path = pathWithRelease(t);
  const TimeWindow free = t.window(path);
  t.judges("retreat after the hand let go [m]", t.number("limit_m", 0));
  ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
  t.add(run, free, retreat_m(run, free.from_s));
  judgeNewStops(t, stopsIn(ticksIn(run, fromOn(run, free.from_s)), Phase::kStopped));
  return {};
}

// Without dry friction, only damping absorbs the energy f_rej²/2K that the stopped wall still holds: the
// needle swings by f_rej/K to both sides of the force-free position, where the wall pulls it back. So it
// retreats by at most 2·f_rej/K. A loop that is not passive makes the swing grow, until the wall that the
// needle drags ahead absorbs what the loop gives: f_rej/K + Δ_att. Two encoder steps are added to both.
Status freeHandNoFriction(Trial& t) {
  const TimedPlan path = pathWithRelease(t);
  const TimeWindow free = t.window(path);
  t.judges("retreat after the hand let go, of what spring and loop allow", 1);
  std::string note;
  int stops = 0;
  for (const double damping : t.numbers("dampings_ns_per_m")) {
    t.plant.device.limits.damping_Ns_per_m = damping;
    ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
    const double reach_m = t.wall.layers.front().rejection_force_N / t.wall.tracking_wall.stiffness_N_per_m;
    const double attracted_m =
        t.wall.layers.front().attracted_force_N / t.wall.tracking_wall.stiffness_N_per_m;
    const double allowed_m =
        reach_m + (run.margins.passive >= 1 ? reach_m : attracted_m) + 2 * t.plant.device.encoder_step_m;
    t.add(run, free, retreat_m(run, free.from_s) / allowed_m);
    stops = std::max(stops, stopsIn(ticksIn(run, fromOn(run, free.from_s)), Phase::kStopped));
    note +=
        fmt::format("{}device of {:g} N·s/m ({:.2g} of what is passive): swings by {:.2g} mm in the end",
                    note.empty() ? "" : "; ", damping, 1 / run.margins.passive, 1e3 * swingAtTheEnd_m(run));
  }
  t.row().note = note;
  judgeNewStops(t, stops);
  return {};
}

// Back and forth about the skin: minimum-jerk halves, close to a sine.
HandPlan flutterPlan(double amplitude_m, double frequency_hz, std::uint64_t cycles) {
  HandPlan plan(upright(-amplitude_m));
  plan.hold(0.3);
  for (std::uint64_t i = 0; i < cycles; ++i)
    plan.moveIn(upright(amplitude_m), 0.5 / frequency_hz, Motion::kMinJerk)
        .moveIn(upright(-amplitude_m), 0.5 / frequency_hz, Motion::kMinJerk);
  return plan.hold(0.3);
}

// The largest energy given to the hand between two entries.
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

Status skinFlutter(Trial& t) {
  const double amplitude_m = t.number("amplitude_m", 1e-6, 0.01);
  const double frequency_hz = t.number("frequency_hz", 0.1, 30);
  const std::uint64_t cycles = t.whole("cycles", 1);
  t.judges("energy given to the hand per entry [J]", t.number("limit_j", 0));
  const HandPlan plan = flutterPlan(amplitude_m, frequency_hz, cycles);
  ASSIGN_OR_RETURN(const auto run, t.loop(plan));
  // the force changes with every entry, so only the gate and the cap indicate growth
  const TimeWindow whole{0, plan.duration_s()};
  const EntryWork work = workPerEntry(run);
  t.add(run, whole, work.worst_J, heldIn(run, whole));
  t.row().note = fmt::format("{} entries in {} cycles", work.entries, cycles);
  // a needle that hardly ever enters proves nothing
  t.require(2 * static_cast<std::uint64_t>(work.entries) >= cycles);
  return {};
}

}  // namespace

std::vector<StabilityCase> scanCases() {
  return {
      {"stiffness_scan", stiffnessScan},
      {"over_limit_bounded", overLimitBounded},
      {"free_hand_release", freeHandRelease},
      {"free_hand_no_friction", freeHandNoFriction},
      {"skin_flutter", skinFlutter},
      {"friction_reversal", frictionReversal},
      {"late_and_missing_ticks", lateAndMissingTicks},
  };
}

}  // namespace needlelab
