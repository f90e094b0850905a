/// Devices that render late or loosely, and hands that let a stiff contact swing: with the passivity control
/// that a station turns on by itself where passivity is not proven (client/station/run/lesson.h), told the
/// delay and lag that it has measured.

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/motion_cases.h"

namespace needlelab {
namespace {

struct LateCase {
  const char* name;
  const char* summary;
};
constexpr std::array<LateCase, 6> kLateCases = {{
    {"lag_2ms", "a loose hand presses bone by motors that lag 2 ms, 2 ticks late"},
    {"lag_8ms", "the same with a lag of 8 ms, 1 tick late"},
    {"delay_varies", "a loose hand presses bone, each force 1 to 5 ticks late"},
    {"loose_tap", "a loose hand taps bone at 0.3 m/s"},
    {"grip_changes", "a hand that presses bone loosens its grip"},
    {"backlash", "a loose hand presses bone through a transmission with play"},
}};

Result<CaseOutcome> asMeasured(const char* name, const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source) {
  return lateContact(name, settings, model, source, Told::kAsMeasured);
}

}  // namespace

std::vector<StabilityCase> lateCases() {
  std::vector<StabilityCase> cases;
  for (const LateCase& one : kLateCases)
    cases.push_back(
        {one.name, one.summary, true, false,
         [name = one.name](const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source) {
           return asMeasured(name, settings, model, source);
         }});
  return cases;
}

Result<CaseOutcome> lateContact(const std::string& name, const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source, Told told) {
  CaseEntry entry(settings.file, name, settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const double limit_J = entry.number("limit_j", 0);
  if (entry.has("grip_changes")) {
    plant.device.hand.grip_changes_s = entry.window(path, "grip_changes").from_s;
    plant.device.hand.grip_share = entry.number("grip_changes.share", 0, 100);
  }
  if (!entry.status().ok()) return entry.status().error();

  plant.passivity.reset();
  ASSIGN_OR_RETURN(auto without, runScene(source, scene, path.plan, plant));
  PlantRun with = without;
  if (without.margins.passive < 1) {
    plant.passivity = passivityOf(plant);
    if (told == Told::kOneTick) plant.passivity->delay_ticks = 1, plant.passivity->lag_s = 0;
    ASSIGN_OR_RETURN(with, runScene(source, scene, path.plan, plant));
  }
  CaseOutcome outcome;
  outcome.row = measuredRow(with, {}, {});
  outcome.row.grip_energy_J.reset();
  const double judged_J = with.grip_energy_J;
  putControlled(outcome.row, {std::move(without), std::move(with)});
  judgeMotion(outcome.row, "energy given to the hand at any moment [J]", judged_J, limit_J);
  outcome.row.note = controlledNote(outcome.row);
  return outcome;
}

}  // namespace needlelab
