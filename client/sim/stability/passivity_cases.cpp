/// The passivity control in front of the gate: loops that give energy to the hand, and ordinary gestures,
/// each with it and without it. Private to this folder.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/motion_cases.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {

/// A spring that is pressed while the gate fades the force in gives back more than it took.
static Result<CaseOutcome> passivityFadeIn(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// A load that the gate derates, and lets come back.
static Result<CaseOutcome> passivityDerated(const CaseSettings&, AxialModel, const ForceSourceFactory&);

std::vector<StabilityCase> passivityCases() {
  return {
      {"passivity_fade_in", "passivity control: pressed in the gate's fade-in, and drawn back after it", true,
       false, passivityFadeIn},
      {"passivity_derated", "passivity control: the load of derated_release", true, false, passivityDerated},
      {"passivity_transparent", "passivity control: what it takes off ordinary gestures", true, false,
       passivityTransparent},
  };
}

Result<ControlledRuns> controlledRuns(const ForceSourceFactory& source, const SceneSpec& scene,
                                      const HandPlan& plan, PlantOptions plant) {
  plant.passivity.reset();
  ASSIGN_OR_RETURN(auto without, runScene(source, scene, plan, plant));
  plant.passivity = passivityOf(plant);
  ASSIGN_OR_RETURN(auto with, runScene(source, scene, plan, plant));
  return ControlledRuns{std::move(without), std::move(with)};
}

void putControlled(CaseRow& row, const ControlledRuns& runs) {
  row.grip_energy_J = std::max(row.grip_energy_J.value_or(0), runs.without.grip_energy_J);
  row.controlled_energy_J = std::max(row.controlled_energy_J.value_or(0), runs.with.grip_energy_J);
  row.distortion_N = std::max(row.distortion_N.value_or(0), greatestDistortion_N(runs.with));
}

std::string controlledNote(const CaseRow& row) {
  return fmt::format("without it {:.2g} mJ, with it {:.2g} mJ; it takes off up to {:.2g} N",
                     1e3 * row.grip_energy_J.value_or(0), 1e3 * row.controlled_energy_J.value_or(0),
                     row.distortion_N.value_or(0));
}

namespace {

constexpr const char* kGiven = "energy given to the hand at any moment, with passivity control [J]";

Result<CaseOutcome> onPath(CaseEntry& entry, const SceneSpec& scene, const TimedPlan& path,
                           const PlantOptions& plant, double limit, const ForceSourceFactory& source) {
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto runs, controlledRuns(source, scene, path.plan, plant));
  CaseOutcome outcome;
  outcome.row = measuredRow(runs.with, {}, {});
  outcome.row.grip_energy_J.reset();
  putControlled(outcome.row, runs);
  judgeMotion(outcome.row, kGiven, runs.with.grip_energy_J, limit);
  outcome.row.note = controlledNote(outcome.row);
  return outcome;
}

}  // namespace

Result<CaseOutcome> passivityFadeIn(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "passivity_fade_in", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const double limit = entry.number("limit", 0);
  return onPath(entry, scene, path, plant, limit, source);
}

Result<CaseOutcome> passivityDerated(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  CaseEntry own(settings.file, "passivity_derated", settings.long_form);
  const double limit = own.number("limit", 0);
  if (!own.status().ok()) return own.status().error();
  CaseEntry entry(settings.file, "derated_release", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  plant.device.hand.let_go_s = entry.window(path, "free").from_s;
  return onPath(entry, scene, path, plant, limit, source);
}

}  // namespace needlelab
