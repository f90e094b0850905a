/// The closed-loop cases of stiffness, release, reversal and late ticks. Private to this folder.

#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/scan_nudge.h"

namespace needlelab {

static Result<CaseOutcome> stiffnessScan(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> overLimitBounded(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> freeHandRelease(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> freeHandNoFriction(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> skinFlutter(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> frictionReversal(const CaseSettings&, AxialModel, const ForceSourceFactory&);
static Result<CaseOutcome> lateAndMissingTicks(const CaseSettings&, AxialModel, const ForceSourceFactory&);

std::vector<StabilityCase> scanCases() {
  return {
      {"stiffness_scan", "a nudge dies out up to 0.9 of the theory's stiffness, at every rate and delay",
       true, false, stiffnessScan},
      {"over_limit_bounded", "a wall far too stiff for a soft hand stays within its own forces", true, false,
       overLimitBounded},
      {"free_hand_release", "a needle that the hand lets go is not thrown out", true, false, freeHandRelease},
      {"free_hand_no_friction", "the same without dry friction: it swings about the wall, and no further",
       true, false, freeHandNoFriction},
      {"skin_flutter", "trembling through the skin gives the hand no energy", true, false, skinFlutter},
      {"friction_reversal", "shaft friction turns round without chatter", true, false, frictionReversal},
      {"late_and_missing_ticks", "ticks that come late or not at all do not shake the hold", true, false,
       lateAndMissingTicks},
  };
}

namespace {

double peakToPeakIn(const PlantRun& run, TimeWindow window) {
  return peakToPeak(forceAlong(ticksIn(run, window), kInward_W));
}

}  // namespace

// the tissue itself can produce any force between full cutting and full attraction
Result<CaseOutcome> overLimitBounded(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "over_limit_bounded", settings.long_form);
  const SceneSpec wall = entry.scene(), scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const BandFilter band = entry.chatterFilter();
  const double share = entry.number("limit_share", 0);
  if (!entry.status().ok()) return entry.status().error();

  const LayerSpec& layer = wall.layers.front();
  CaseTally tally("force peak-to-peak [N]", share * (layer.cutting_force_N + layer.attracted_force_N), band);
  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
  // includes the insertion and withdrawal; the run is expected to swing, only the bound counts
  const TimeWindow whole{0, path.plan.duration_s() + 1};
  tally.add(run, whole, peakToPeakIn(run, whole), std::string(axialModelName(model)), heldIn(run, whole));
  CaseOutcome outcome = tally.finish();
  if (model == AxialModel::kFem) outcome.row.note = "as soft as its Young's modulus: far below the limit";
  return outcome;
}

// every seed draws other ticks
Result<CaseOutcome> lateAndMissingTicks(const CaseSettings& settings, AxialModel model,
                                        const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "late_and_missing_ticks", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  const std::uint64_t seeds = entry.whole("seeds", 1), first = plant.seed;
  CaseTally tally("force peak-to-peak in the hold [N]", entry.number("limit", 0), entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  for (std::uint64_t i = 0; i < seeds; ++i) {
    plant.seed = first + i;
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    tally.add(run, window, peakToPeakIn(run, window), std::string(axialModelName(model)));
  }
  return tally.finish();
}

Result<CaseOutcome> frictionReversal(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "friction_reversal", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow after_out = entry.window(path, "after_out"), after_in = entry.window(path, "after_in");
  CaseTally tally("force peak-to-peak after a reversal [N]", entry.number("limit", 0), entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
  for (const TimeWindow& after : {after_out, after_in})
    tally.add(run, after, peakToPeakIn(run, after), std::string(axialModelName(model)));
  return tally.finish();
}

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

namespace {

// the needle's way to and fro in the last half second
double swingAtTheEnd_m(const PlantRun& run) {
  const double end_s = run.ticks.back().time_s + 1e-9;
  std::vector<double> z_m;
  for (const PlantTick& tick : ticksIn(run, {end_s - 0.5, end_s})) z_m.push_back(tick.p_W_m.z);
  return peakToPeak(z_m);
}

// a needle thrown back fast enough to end the stop stops again
void judgeNewStops(CaseRow& row, int stops) {
  if (stops == 0) return;
  row.note +=
      fmt::format("{}{}{}", row.note.empty() ? "" : "; ", stops, stops > 1 ? " new stops" : " new stop");
  if (row.passed) row.verdict = Verdict::kChatters;
  row.passed = false;
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
  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
  tally.add(run, free, retreat_m(run, free.from_s), std::string(axialModelName(model)));
  CaseOutcome outcome = tally.finish();
  judgeNewStops(outcome.row, hasStop(model) ? stopsAfter(run, free.from_s) : 0);
  return outcome;
}

// Without dry friction nothing but the damping takes the energy f_rej²/2K that the stopped wall still holds:
// the needle swings by f_rej/K to both sides of the place without force, where the wall pulls it back. So it
// retreats by 2·f_rej/K at most. A loop that is not passive makes the swing grow, until the wall that the
// needle drags ahead takes what the loop gives: f_rej/K + Δ_att. Two steps of the encoder come to both.
Result<CaseOutcome> freeHandNoFriction(const CaseSettings& settings, AxialModel model,
                                       const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "free_hand_no_friction", settings.long_form);
  const SceneSpec wall = entry.scene(), scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow free = entry.window(path);
  const std::vector<double> dampings = entry.numbers("dampings_ns_per_m");
  const BandFilter band = entry.chatterFilter();
  if (!entry.status().ok()) return entry.status().error();

  const double reach_m = wall.layers.front().rejection_force_N / wall.tracking_wall.stiffness_N_per_m;
  const double attracted_m = wall.layers.front().attracted_force_N / wall.tracking_wall.stiffness_N_per_m;
  CaseTally tally("retreat after the hand let go, of what spring and loop allow", 1, band);
  plant.device.hand.let_go_s = free.from_s;
  std::string note;
  int stops = 0;
  for (const double damping : dampings) {
    plant.device.limits.damping_Ns_per_m = damping;
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    const double allowed_m =
        reach_m + (run.margins.passive >= 1 ? reach_m : attracted_m) + 2 * plant.device.encoder_step_m;
    tally.add(run, free, retreat_m(run, free.from_s) / allowed_m, std::string(axialModelName(model)));
    stops = std::max(stops, stopsAfter(run, free.from_s));
    note +=
        fmt::format("{}device of {:g} N·s/m ({:.2g} of what is passive): swings by {:.2g} mm in the end",
                    note.empty() ? "" : "; ", damping, 1 / run.margins.passive, 1e3 * swingAtTheEnd_m(run));
  }
  CaseOutcome outcome = tally.finish();
  outcome.row.note = note;
  judgeNewStops(outcome.row, hasStop(model) ? stops : 0);
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
  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, plan, plant));
  // the force changes with every entry: only the gate and the cap indicate growth
  const EntryWork work = workPerEntry(run);
  tally.add(run, whole, work.worst_J, std::string(axialModelName(model)), heldIn(run, whole));
  CaseOutcome outcome = tally.finish();

  // a needle that hardly ever enters shows nothing
  outcome.row.note = fmt::format("{} entries in {} cycles", work.entries, cycles);
  if (2 * static_cast<std::uint64_t>(work.entries) < cycles) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  return outcome;
}

namespace {

struct Point {
  double hand_N_per_m = 0, hand_Ns_per_m = 0;
  double rate_hz = 0, delay_ticks = 0;
  double share = 0;  // of the theory's limit
};

std::string pointText(double stiffness_N_per_m, const PlantOptions& plant) {
  return fmt::format("K {:.0f} N/m, {:g} Hz, {} ticks late, hand {:g} N/m", stiffness_N_per_m, plant.rate_hz,
                     static_cast<unsigned>(plant.device.delay_ticks), plant.device.hand.stiffness_N_per_m);
}

}  // namespace

Result<CaseOutcome> stiffnessScan(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "stiffness_scan", settings.long_form);
  const SceneSpec scene = entry.scene();
  PlantOptions plant = entry.plant();
  const NudgeOptions options = nudgeOptionsOf(entry);
  const auto rates = entry.numbers("rates_hz"), delays = entry.numbers("delays_ticks"),
             shares = entry.numbers("shares");
  // other hands, from nearly free to stiff, at the plant's own rate
  const auto stiffnesses = entry.numbers("hands.stiffness_n_per_m"),
             dampings = entry.numbers("hands.damping_ns_per_m");
  const BandFilter band = entry.chatterFilter();
  if (!entry.status().ok()) return entry.status().error();

  std::vector<Point> points;
  const HandOptions own = plant.device.hand;
  for (const double rate : rates)
    for (const double delay : delays)
      for (const double share : shares)
        points.push_back({own.stiffness_N_per_m, own.damping_Ns_per_m, rate, delay, share});
  for (std::size_t i = 0; i < std::min(stiffnesses.size(), dampings.size()); ++i)
    for (const double delay : delays)
      points.push_back({stiffnesses[i], dampings[i], plant.rate_hz, delay, shares.back()});

  ASSIGN_OR_RETURN(const auto scanned, ScannedModel::prepare(scene, model, plant, options));
  CaseTally tally(fmt::format("nudges of {} that do not die out", points.size()), 0, band);
  int swinging = 0;
  std::string note;
  for (const Point& at : points) {
    plant.rate_hz = at.rate_hz;
    plant.device.delay_ticks = static_cast<std::uint32_t>(at.delay_ticks);
    plant.device.hand.stiffness_N_per_m = at.hand_N_per_m;
    plant.device.hand.damping_Ns_per_m = at.hand_Ns_per_m;
    const double damping = plant.device.limits.damping_Ns_per_m + at.hand_Ns_per_m;
    const double stiffness =
        std::min(at.share * passiveStiffnessLimit(damping, 1 / at.rate_hz, at.delay_ticks),
                 kMaxProfileStiffness_N_per_m);
    ASSIGN_OR_RETURN(const auto run, nudge(source, scanned.with(stiffness), stiffness, plant, options));
    const std::string point = pointText(stiffness, plant);
    if (!run.outcome.stable) {
      ++swinging;
      note = "swings on at " + point;
    }
    const bool diverges = !run.outcome.finite || run.outcome.fault != Fault::kNone;
    tally.add(run.run, run.watch, swinging, point, diverges);
  }
  CaseOutcome outcome = tally.finish();
  outcome.row.note = note;
  return outcome;
}

}  // namespace needlelab
