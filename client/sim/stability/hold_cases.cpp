/// The closed-loop cases of a hand that inserts, holds and stops. Private to this folder.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/stability/case.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {

/// A still hand and a coarse encoder: the force must be steady.
static Result<CaseOutcome> holdQuantised(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Many hands with different stiffness, damping, tremor and depth: measures the chatter of the force.
static Result<CaseOutcome> holdTremorRandom(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Usual sizes of tremor: a resting hand is detected as resting.
static Result<CaseOutcome> tremorStops(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A slow insertion is smooth and does not trigger a stop.
static Result<CaseOutcome> slowInsert(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A hold where one tissue ends and a firmer one begins.
static Result<CaseOutcome> boundaryHold(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A hand that creeps on in the stop: the force still decays to the rejection force.
static Result<CaseOutcome> creepThenStop(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Firm tissue, soft hand: the needle advances as the force decays, and this must not end the stop.
static Result<CaseOutcome> stopOnce(const CaseSettings&, AxialModel, const ForceSourceFactory&);

std::vector<StabilityCase> holdCases() {
  return {
      {"hold_quantised", "a still hand, encoder of 30 µm: the force stands still", true, false,
       holdQuantised},
      {"hold_tremor_random", "many hands with tremor: how much the force chatters", true, false,
       holdTremorRandom},
      {"tremor_stops", "a hand that rests is seen to rest, whatever its tremor", true, false, tremorStops},
      {"slow_insert_5mm_s", "a slow insertion is smooth, and no stop", true, false, slowInsert},
      {"boundary_hold", "a hold where firmer tissue begins", true, false, boundaryHold},
      {"creep_then_stop", "after a creeping advance the force is the rejection force", true, false,
       creepThenStop},
      {"stop_once", "firm tissue and a soft hand: one stop, not many", true, false, stopOnce},
  };
}

namespace {

// a case about the stop says nothing about a model that has none
CaseOutcome withoutStop() {
  CaseOutcome outcome;
  outcome.row.note = "has no stop";
  return outcome;
}

// the worst hold over the entry's aims `beyond_m`
Result<CaseOutcome> worstHold(std::string_view name, const CaseSettings& settings, AxialModel model,
                              const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, name, settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  CaseTally tally("force peak-to-peak [N]", entry.number("limit", 0), entry.chatterFilter());
  for (const double beyond_m : entry.numbers("beyond_m")) {
    const TimedPlan path = entry.path("path", {beyond_m, 1});
    const TimeWindow window = entry.window(path);
    if (!entry.status().ok()) return entry.status().error();
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    tally.add(run, window, peakToPeak(forceAlong(ticksIn(run, window), kInward_W)),
              std::string(axialModelName(model)));
  }
  return tally.finish();
}

}  // namespace

// aims spread over one encoder step: the hard case is a needle resting on a step's edge
Result<CaseOutcome> holdQuantised(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  auto outcome = worstHold("hold_quantised", settings, model, source);
  if ((model != AxialModel::kDirect && model != AxialModel::kVoigt) || !outcome.ok()) return outcome;
  // DIRECT holds at a constant force here; a spring without end is the fair neighbour of the wall. VOIGT's
  // fair form does not take its velocity from two encoder steps.
  CaseEntry entry(settings.file, "hold_quantised", settings.long_form);
  const double noise_m = 1.01 * entry.plant().device.encoder_step_m;
  const auto fairer = worstHold("hold_quantised", settings, model, [&](SceneSpec scene, double rate_hz) {
    scene.direct.step_at_layers = false;
    scene.voigt.velocity_noise_m = noise_m;
    return source(scene, rate_hz);
  });
  if (!fairer.ok()) return fairer.error();
  const char* what = model == AxialModel::kDirect ? "a plain spring, without step at layers"
                                                  : "with a velocity over an adaptive window";
  outcome->row.note = fmt::format("{}: {:.3g} N", what, *fairer->row.measured);
  return outcome;
}

// aims beyond the boundary so that the tip rests on it, for each of the models
Result<CaseOutcome> boundaryHold(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  return worstHold("boundary_hold", settings, model, source);
}

namespace {

// number of changes to STOPPED
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
  if (!hasStop(model)) return withoutStop();
  CaseEntry entry(settings.file, "creep_then_stop", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  CaseTally tally("distance from f_rej [N]", entry.number("limit", 0), entry.chatterFilter());
  for (const double speed_mps : entry.numbers("creep_m_s")) {
    // the path's creep is written for 1 m/s
    const TimedPlan path = entry.path("path", {0, speed_mps, "creep"});
    const TimeWindow window = entry.window(path);
    if (!entry.status().ok()) return entry.status().error();
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    double worst = 0;
    for (const double force : forceAlong(ticksIn(run, window), kInward_W))
      worst = std::max(worst, std::abs(-force - scene.layers.front().rejection_force_N));
    tally.add(run, window, worst, "creeping");
  }
  return tally.finish();
}

Result<CaseOutcome> stopOnce(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  if (!hasStop(model)) return withoutStop();
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
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    const int stops = stopsIn(ticksIn(run, window));
    stopped_at_all = stopped_at_all && stops > 0;
    tally.add(run, window, stops, fmt::format("hand of {} N/m", static_cast<int>(stiffness)));
  }
  CaseOutcome outcome = tally.finish();
  if (!stopped_at_all) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = "one of the hands was never seen to stop";
  }
  return outcome;
}

namespace {

// one of the random hands, drawn by its number from the entry's ranges
struct RandomHand {
  PlantOptions plant;
  TimedPlan path;
};
RandomHand randomHand(CaseEntry& entry, std::uint64_t number) {
  RandomHand hand;
  hand.plant = entry.plant();
  HandRandom random(entry.whole("seed") + number);
  HandOptions& options = hand.plant.device.hand;
  options.stiffness_N_per_m = entry.between("random.hand_stiffness_n_per_m", random.uniform());
  options.damping_Ns_per_m = entry.between("random.hand_damping_ns_per_m", random.uniform());
  options.tremor_m = entry.between("random.tremor_m", random.uniform());
  options.seed = random.next();
  hand.path = entry.path("path", {entry.between("random.depth_offset_m", random.uniform()), 1});
  return hand;
}

// mean chatter over the hands; the wall's is compared with Voigt's
Result<double> meanChatter(CaseEntry& entry, const SceneSpec& scene, const ForceSourceFactory& source,
                           std::uint64_t hands, CaseTally* tally, const std::string& label) {
  const BandFilter band = entry.chatterFilter();
  double sum = 0;
  for (std::uint64_t i = 0; i < hands; ++i) {
    const RandomHand hand = randomHand(entry, i);
    const TimeWindow window = entry.window(hand.path);
    if (!entry.status().ok()) return entry.status().error();
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, hand.path.plan, hand.plant));
    const double chatter = chatterOf(run, kInward_W, window, band);
    sum += chatter;
    if (tally != nullptr) tally->add(run, window, chatter, label);
  }
  return sum / static_cast<double>(hands);
}

std::string threeDigits(double value) {
  return fmt::format("{:.3g}", value);
}

// ticks of a window in STOPPED, as a share
double stoppedShare(std::span<const PlantTick> ticks) {
  const auto stopped = std::count_if(
      ticks.begin(), ticks.end(), [](const PlantTick& tick) { return tick.report.phase == Phase::kStopped; });
  return ticks.empty() ? 0 : static_cast<double>(stopped) / static_cast<double>(ticks.size());
}

}  // namespace

Result<CaseOutcome> holdTremorRandom(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "hold_tremor_random", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const std::uint64_t hands =
      entry.whole(model == AxialModel::kEnhancedTrackingWall ? "hands" : "hands_of_other_models", 1);
  const double share = entry.number("share_of_voigt", 0, 1);
  CaseTally tally("worst RMS in 50-500 Hz [N]", entry.number("limit", 0), entry.chatterFilter());
  ASSIGN_OR_RETURN(const auto mean,
                   meanChatter(entry, scene, source, hands, &tally, std::string(axialModelName(model))));
  ASSIGN_OR_RETURN(const auto voigt,
                   meanChatter(entry, likeForLike(entry.scene(), AxialModel::kVoigt), engineSource(),
                               std::min(hands, entry.whole("hands_of_other_models", 1)), nullptr, {}));

  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (row.passed && mean > share * voigt) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = fmt::format("mean {} N over {} hands, Voigt's {} N; at most 1/8 of it passes", threeDigits(mean),
                         hands, threeDigits(voigt));
  return outcome;
}

namespace {

// over all tremors and seeds of the entry
struct StopTimes {
  double latest_s = 0;     ///< from the rest of the target to STOPPED
  double least_share = 1;  ///< of the rest of the hold that is STOPPED
};
Result<StopTimes> stopTimes(CaseEntry& entry, const SceneSpec& scene, const ForceSourceFactory& source,
                            const std::string& path_field, double limit_s, CaseTally* tally) {
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path(path_field);
  const TimeWindow hold = entry.window(path);
  const std::uint64_t seeds = entry.whole("seeds", 1);
  const std::vector<double> tremors = entry.numbers("tremor_m");
  if (!entry.status().ok()) return entry.status().error();
  StopTimes all;
  for (const double tremor_m : tremors)
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      plant.device.hand.tremor_m = tremor_m;
      plant.device.hand.seed = seed;
      ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
      const auto ticks = ticksIn(run, hold);
      const auto first = std::find_if(ticks.begin(), ticks.end(), [](const PlantTick& tick) {
        return tick.report.phase == Phase::kStopped;
      });
      const double after_s = first == ticks.end() ? hold.to_s - hold.from_s : first->time_s - hold.from_s;
      const auto rest = ticksIn(run, {hold.from_s + std::min(after_s, limit_s), hold.to_s});
      all.latest_s = std::max(all.latest_s, after_s);
      all.least_share = std::min(all.least_share, stoppedShare(rest));
      if (tally != nullptr) tally->add(run, hold, after_s, "tremor " + threeDigits(tremor_m * 1e6) + " µm");
    }
  return all;
}

}  // namespace

Result<CaseOutcome> tremorStops(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source) {
  if (!hasStop(model)) return withoutStop();
  CaseEntry entry(settings.file, "tremor_stops", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit_s = entry.number("limit", 0), share = entry.number("share_stopped", 0, 1);
  CaseTally tally("STOPPED after the target rests [s]", limit_s, entry.chatterFilter());
  ASSIGN_OR_RETURN(const auto times, stopTimes(entry, scene, source, "path", limit_s, &tally));
  // no person stops within a millisecond: reported, not judged
  ASSIGN_OR_RETURN(const auto abrupt, stopTimes(entry, scene, source, "path_abrupt", limit_s, nullptr));

  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (row.passed && times.least_share < share) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = "STOPPED for " + threeDigits(100 * times.least_share) + " % of the rest of the hold, " +
             threeDigits(100 * share) +
             " % passes; a target that rests within one tick: " + threeDigits(abrupt.latest_s) +
             " s, not judged";
  return outcome;
}

Result<CaseOutcome> slowInsert(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "slow_insert_5mm_s", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  const BandFilter band = entry.chatterFilter();
  const std::uint64_t seeds = entry.whole("seeds", 1);
  CaseTally tally("RMS in 50-500 Hz [N]", entry.number("limit", 0), band);
  if (!entry.status().ok()) return entry.status().error();
  double stopped = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    plant.device.hand.seed = seed;
    ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
    stopped = std::max(stopped, stoppedShare(ticksIn(run, window)));
    tally.add(run, window, chatterOf(run, kInward_W, window, band), std::string(axialModelName(model)));
  }
  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (!hasStop(model)) {
    row.note = "has no stop: the chatter alone is judged";
    return outcome;
  }
  if (row.passed && stopped > 0) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = stopped > 0 ? "a false stop, " + threeDigits(100 * stopped) + " % of the slow insertion"
                         : "no false stop";
  return outcome;
}

}  // namespace needlelab
