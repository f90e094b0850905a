/// A still hand holds the needle in tissue, the encoder counts 30 µm: the force must stand still.
#include "stability/closed_loop_case.h"
#include "stability/hold_cases.h"

namespace needlelab {

Result<CaseOutcome> holdQuantised(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "hold_quantised", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  const BandFilter band = entry.chatterFilter();
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();

  const auto run = runScene(source, scene, path.plan, plant);
  if (!run.ok()) return run.error();
  CaseOutcome outcome{measuredRow(*run, window, band), {traceOf(*run, std::string(axialModelName(model)))}};
  outcome.row.measured = peakToPeak(forceAlong(ticksIn(*run, window), kInward_W));
  outcome.row.limit = limit;
  outcome.row.quantity = "force peak-to-peak in the hold [N]";
  judge(outcome.row, growsIn(*run, window));
  return outcome;
}

}  // namespace needlelab
