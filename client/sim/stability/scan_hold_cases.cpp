/// Holds under bad conditions: a wall far too stiff, ticks that come late or not at all, friction after a
/// reversal. The force must stay within bounds, or stand still.
#include <algorithm>
#include <string>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/scan_cases.h"

namespace needlelab {
namespace {

double peakToPeakIn(const PlantRun& run, TimeWindow window) {
  return peakToPeak(forceAlong(ticksIn(run, window), kInward_W));
}

}  // namespace

// everything between full cutting and full attraction is what the tissue itself can do
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
  const auto run = runScene(source, scene, path.plan, plant);
  if (!run.ok()) return run.error();
  // the way in and out too; it is meant to swing: what counts is what bounds it
  const TimeWindow whole{0, path.plan.duration_s() + 1};
  tally.add(*run, whole, peakToPeakIn(*run, whole), std::string(axialModelName(model)), heldIn(*run, whole));
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
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    tally.add(*run, window, peakToPeakIn(*run, window), std::string(axialModelName(model)));
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

  const auto run = runScene(source, scene, path.plan, plant);
  if (!run.ok()) return run.error();
  for (const TimeWindow& after : {after_out, after_in})
    tally.add(*run, after, peakToPeakIn(*run, after), std::string(axialModelName(model)));
  return tally.finish();
}

}  // namespace needlelab
