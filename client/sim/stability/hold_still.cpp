/// hold_quantised and boundary_hold: nobody moves, so the force must not either.
#include <cstdio>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/hold_cases.h"

namespace needlelab {

namespace {

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
    const auto run = runScene(source, scene, path.plan, plant);
    if (!run.ok()) return run.error();
    tally.add(*run, window, peakToPeak(forceAlong(ticksIn(*run, window), kInward_W)),
              std::string(axialModelName(model)));
  }
  return tally.finish();
}

}  // namespace

// aims all over one encoder step: a needle that rests on its edge is the hard one
Result<CaseOutcome> holdQuantised(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  auto outcome = worstHold("hold_quantised", settings, model, source);
  if (model != AxialModel::kDirect || !outcome.ok()) return outcome;
  // DIRECT holds at a constant force here; a spring without end is the fair neighbour of the wall
  const auto spring = worstHold("hold_quantised", settings, model, [&](SceneSpec scene, double rate_hz) {
    scene.direct.step_at_layers = false;
    return source(scene, rate_hz);
  });
  if (!spring.ok()) return spring.error();
  char note[80];
  std::snprintf(note, sizeof note, "a plain spring, without step at layers: %.3g N", *spring->row.measured);
  outcome->row.note = note;
  return outcome;
}

// aims beyond the boundary by what leaves the tip on it, in one model or another
Result<CaseOutcome> boundaryHold(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  return worstHold("boundary_hold", settings, model, source);
}

}  // namespace needlelab
