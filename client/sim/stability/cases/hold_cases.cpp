/// Closed-loop cases of a hand that inserts, holds and stops.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/stability/case.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {
namespace {

// cases about stops do not apply to a model without one
constexpr const char* kNoStop = "has no stop";

double chatterIn(const PlantRun& run, TimeWindow window) {
  return chatterOf(run, kInward_W, window);
}

// The worst hold over the entry's aims `beyond_m`, which rest the tip on a boundary.
Status worstHold(Trial& t) {
  t.judges("force peak-to-peak [N]", t.number("limit", 0));
  for (const double beyond_m : t.numbers("beyond_m")) RETURN_IF_ERROR(t.onPath(peakToPeakIn, {beyond_m, 1}));
  return {};
}

// Aims spread over one encoder step: the hard case is a needle that rests on a step's edge.
Status holdQuantised(Trial& t) {
  Trial fairer = t;
  RETURN_IF_ERROR(worstHold(t));
  if (t.model != AxialModel::kDirect && t.model != AxialModel::kVoigt) return {};
  // DIRECT holds at a constant force here; the fair comparison with the wall is an endless spring. VOIGT's
  // fair variant does not take its velocity from two encoder steps.
  fairer.scene.direct.step_at_layers = false;
  fairer.scene.voigt.velocity_noise_m = 1.01 * t.plant.device.encoder_step_m;
  RETURN_IF_ERROR(worstHold(fairer));
  const char* what = t.model == AxialModel::kDirect ? "a plain spring, without step at layers"
                                                    : "with a velocity over an adaptive window";
  t.row().note = fmt::format("{}: {:.3g} N", what, *fairer.row().measured);
  return {};
}

// After a creeping advance the force must be the rejection force.
Status creepThenStop(Trial& t) {
  if (!t.hasStop()) return t.notApplicable(kNoStop);
  t.judges("distance from f_rej [N]", t.number("limit", 0));
  const auto departure = [&](const PlantRun& run, TimeWindow window) {
    double worst = 0;
    for (const double force : forceAlong(ticksIn(run, window), kInward_W))
      worst = std::max(worst, std::abs(-force - t.scene.layers.front().rejection_force_N));
    return worst;
  };
  // the path's creep speed is 1 m/s, so the factor is the speed
  for (const double speed_mps : t.numbers("creep_m_s"))
    RETURN_IF_ERROR(t.onPath(departure, {0, speed_mps, "creep"}));
  return {};
}

// Firm tissue, soft hand: the needle advances as the force decays, which must not end the stop.
Status stopOnce(Trial& t) {
  if (!t.hasStop()) return t.notApplicable(kNoStop);
  t.judges("stops in one hold", t.number("limit", 0));
  bool stopped_at_all = true;
  const auto stops = [&](const PlantRun& run, TimeWindow window) {
    const int count = stopsIn(ticksIn(run, window), Phase::kFree);
    stopped_at_all = stopped_at_all && count > 0;
    return count;
  };
  for (const double stiffness : t.numbers("hand_stiffness_n_per_m")) {
    t.plant.device.hand.stiffness_N_per_m = stiffness;
    // a softer hand aims further, so that all are at the same depth when the stop begins
    const double further_m = t.scene.layers.front().cutting_force_N / std::max(1.0, stiffness);
    RETURN_IF_ERROR(t.onPath(stops, {further_m, 1}));
  }
  t.require(stopped_at_all);
  if (!stopped_at_all) t.row().note = "one of the hands was never seen to stop";
  return {};
}

// Random hands, drawn by number from the entry's ranges. Returns their mean chatter.
Result<double> meanChatter(Trial& t, std::uint64_t hands) {
  double sum = 0;
  for (std::uint64_t i = 0; i < hands; ++i) {
    HandRandom random(t.whole("seed") + i);
    HandOptions& hand = t.plant.device.hand;
    hand.stiffness_N_per_m = t.between("random.hand_stiffness_n_per_m", random.uniform());
    hand.damping_Ns_per_m = t.between("random.hand_damping_ns_per_m", random.uniform());
    hand.tremor_m = t.between("random.tremor_m", random.uniform());
    hand.seed = random.next();
    const auto chatter = [&](const PlantRun& run, TimeWindow window) {
      const double chatter_N = chatterIn(run, window);
      sum += chatter_N;
      return chatter_N;
    };
    RETURN_IF_ERROR(t.onPath(chatter, {t.between("random.depth_offset_m", random.uniform()), 1}));
  }
  return sum / static_cast<double>(hands);
}

Status holdTremorRandom(Trial& t) {
  const std::uint64_t others = t.whole("hands_of_other_models", 1);
  const std::uint64_t hands = t.model == AxialModel::kEnhancedTrackingWall ? t.whole("hands", 1) : others;
  const double share = t.number("share_of_voigt", 0, 1);
  t.judges("worst RMS in 50-500 Hz [N]", t.number("limit", 0));
  Trial compared = t;
  compared.source = engineSource();
  compared.scene = likeForLike(t.wall, AxialModel::kVoigt);
  ASSIGN_OR_RETURN(const auto mean, meanChatter(t, hands));
  ASSIGN_OR_RETURN(const auto voigt, meanChatter(compared, std::min(hands, others)));
  t.require(mean <= share * voigt);
  t.row().note = fmt::format("mean {:.3g} N over {} hands, Voigt's {:.3g} N; at most 1/8 of it passes", mean,
                             hands, voigt);
  return {};
}

// Share of a window's ticks in STOPPED.
double stoppedShare(std::span<const PlantTick> ticks) {
  const auto stopped = std::count_if(
      ticks.begin(), ticks.end(), [](const PlantTick& tick) { return tick.report.phase == Phase::kStopped; });
  return ticks.empty() ? 0 : static_cast<double>(stopped) / static_cast<double>(ticks.size());
}

// Puts the time from the target's rest to STOPPED into the row, over all tremors and seeds. Returns the
// smallest share of the remaining hold that is STOPPED.
Result<double> stoppedFrom(Trial& t, const std::string& path_field, double limit_s) {
  const TimedPlan path = t.path(path_field);
  const TimeWindow hold = t.window(path);
  const std::uint64_t seeds = t.whole("seeds", 1);
  double min_share = 1;
  for (const double tremor_m : t.numbers("tremor_m"))
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      t.plant.device.hand.tremor_m = tremor_m;
      t.plant.device.hand.seed = seed;
      ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
      const auto ticks = ticksIn(run, hold);
      const auto first = std::find_if(ticks.begin(), ticks.end(), [](const PlantTick& tick) {
        return tick.report.phase == Phase::kStopped;
      });
      const double after_s = first == ticks.end() ? hold.to_s - hold.from_s : first->time_s - hold.from_s;
      const auto rest = ticksIn(run, {hold.from_s + std::min(after_s, limit_s), hold.to_s});
      min_share = std::min(min_share, stoppedShare(rest));
      t.add(run, hold, after_s);
    }
  return min_share;
}

// With usual tremor, a resting hand must be detected as resting.
Status tremorStops(Trial& t) {
  if (!t.hasStop()) return t.notApplicable(kNoStop);
  const double limit_s = t.number("limit", 0), share = t.number("share_stopped", 0, 1);
  t.judges("STOPPED after the target rests [s]", limit_s);
  Trial abrupt = t;
  ASSIGN_OR_RETURN(const auto min_share, stoppedFrom(t, "path", limit_s));
  // no person stops within a millisecond: reported, not judged
  RETURN_IF_ERROR(stoppedFrom(abrupt, "path_abrupt", limit_s));
  t.require(min_share >= share);
  t.row().note = fmt::format(
      "STOPPED for {:.3g} % of the rest of the hold, {:.3g} % passes; a target that rests within one tick: "
      "{:.3g} s, not judged",
      100 * min_share, 100 * share, *abrupt.row().measured);
  return {};
}

Status slowInsert(Trial& t) {
  t.judges("RMS in 50-500 Hz [N]", t.number("limit", 0));
  double stopped = 0;
  const auto chatter = [&](const PlantRun& run, TimeWindow window) {
    stopped = std::max(stopped, stoppedShare(ticksIn(run, window)));
    return chatterIn(run, window);
  };
  const std::uint64_t seeds = t.whole("seeds", 1);
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    t.plant.device.hand.seed = seed;
    RETURN_IF_ERROR(t.onPath(chatter));
  }
  t.require(stopped == 0 || !t.hasStop());
  t.row().note = !t.hasStop()  ? "has no stop: the chatter alone is judged"
                 : stopped > 0 ? fmt::format("a false stop, {:.3g} % of the slow insertion", 100 * stopped)
                               : "no false stop";
  return {};
}

}  // namespace

std::vector<StabilityCase> holdCases() {
  return {
      {"hold_quantised", holdQuantised}, {"hold_tremor_random", holdTremorRandom},
      {"tremor_stops", tremorStops},     {"slow_insert_5mm_s", slowInsert},
      {"boundary_hold", worstHold},      {"creep_then_stop", creepThenStop},
      {"stop_once", stopOnce},
  };
}

}  // namespace needlelab
