/// hold_tremor_random, tremor_stops and slow_insert_5mm_s: hands that tremble.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/hold_cases.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {
namespace {

// one of the random hands: what the entry's ranges say, drawn by its number
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
    const auto run = runScene(source, scene, hand.path.plan, hand.plant);
    if (!run.ok()) return run.error();
    const double chatter = chatterOf(*run, kInward_W, window, band);
    sum += chatter;
    if (tally != nullptr) tally->add(*run, window, chatter, label);
  }
  return sum / static_cast<double>(hands);
}

std::string threeDigits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
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
  const auto mean = meanChatter(entry, scene, source, hands, &tally, std::string(axialModelName(model)));
  if (!mean.ok()) return mean.error();
  const auto voigt = meanChatter(entry, likeForLike(entry.scene(), AxialModel::kVoigt), engineSource(),
                                 std::min(hands, entry.whole("hands_of_other_models", 1)), nullptr, {});
  if (!voigt.ok()) return voigt.error();

  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (row.passed && *mean > share * *voigt) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = "mean " + threeDigits(*mean) + " N over " + std::to_string(hands) + " hands, Voigt's " +
             threeDigits(*voigt) + " N; at most 1/8 of it passes";
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
      const auto run = runScene(source, scene, path.plan, plant);
      if (!run.ok()) return run.error();
      const auto ticks = ticksIn(*run, hold);
      const auto first = std::find_if(ticks.begin(), ticks.end(), [](const PlantTick& tick) {
        return tick.report.phase == Phase::kStopped;
      });
      const double after_s = first == ticks.end() ? hold.to_s - hold.from_s : first->time_s - hold.from_s;
      const auto rest = ticksIn(*run, {hold.from_s + std::min(after_s, limit_s), hold.to_s});
      all.latest_s = std::max(all.latest_s, after_s);
      all.least_share = std::min(all.least_share, stoppedShare(rest));
      if (tally != nullptr) tally->add(*run, hold, after_s, "tremor " + threeDigits(tremor_m * 1e6) + " µm");
    }
  return all;
}

}  // namespace

Result<CaseOutcome> tremorStops(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "tremor_stops", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit_s = entry.number("limit", 0), share = entry.number("share_stopped", 0, 1);
  CaseTally tally("STOPPED after the target rests [s]", limit_s, entry.chatterFilter());
  const auto times = stopTimes(entry, scene, source, "path", limit_s, &tally);
  if (!times.ok()) return times.error();
  // no person stops from one millisecond to the next: told, not judged
  const auto abrupt = stopTimes(entry, scene, source, "path_abrupt", limit_s, nullptr);
  if (!abrupt.ok()) return abrupt.error();

  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (row.passed && times->least_share < share) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = "STOPPED for " + threeDigits(100 * times->least_share) + " % of the rest of the hold, " +
             threeDigits(100 * share) +
             " % passes; a target that rests within one tick: " + threeDigits(abrupt->latest_s) +
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
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    stopped = std::max(stopped, stoppedShare(ticksIn(*run, window)));
    tally.add(*run, window, chatterOf(*run, kInward_W, window, band), std::string(axialModelName(model)));
  }
  CaseOutcome outcome = tally.finish();
  CaseRow& row = outcome.row;
  if (row.passed && stopped > 0) row.passed = false, row.verdict = Verdict::kChatters;
  row.note = stopped > 0 ? "a false stop, " + threeDigits(100 * stopped) + " % of the slow insertion"
                         : "no false stop";
  return outcome;
}

}  // namespace needlelab
