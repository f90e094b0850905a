/// hold_quantised and boundary_hold: nobody moves, so the force must not either.
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
  CaseTally tally("force peak-to-peak [N]", entry.number("limit", 0), entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  const auto run = runScene(source, scene, path.plan, plant);
  if (!run.ok()) return run.error();
  tally.add(*run, window, peakToPeak(forceAlong(ticksIn(*run, window), kInward_W)),
            std::string(axialModelName(model)));
  return tally.finish();
}

Result<CaseOutcome> boundaryHold(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "boundary_hold", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  CaseTally tally("force peak-to-peak [N]", entry.number("limit", 0), entry.chatterFilter());
  // the hand aims beyond the boundary by what leaves the tip on it, in one model or another
  for (const double beyond_m : entry.numbers("beyond_m")) {
    const TimedPlan path = entry.path("path", {beyond_m, 1});
    const TimeWindow window = entry.window(path);
    if (!entry.status().ok()) return entry.status().error();
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    tally.add(*run, window, peakToPeak(forceAlong(ticksIn(*run, window), kInward_W)),
              std::string(axialModelName(model)));
  }
  return tally.finish();
}

}  // namespace needlelab
