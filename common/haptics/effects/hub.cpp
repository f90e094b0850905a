/// HUB: stops a needle that is inserted to its hub. A spring between skin and hub pushes it out toward P0
/// (FORCE_MODEL.md, "Hub"). While P0 stays, the force depends only on the tip's place: it begins at 0 and is
/// conservative.
#include "common/haptics/effects/hub.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

double& stiffnessOf(SceneSpec& spec) {
  return spec.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m];
}

constexpr std::array<EffectField, 1> kHubFields = {
    {{"stiffness_n_per_m", "Stiffness of the skin under the hub", kStiffness, 300, stiffnessOf}}};

}  // namespace

double hubStiffness_N_per_m(const SceneModel& model) {
  return model.isLive(Effect::kHub) ? model.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m] : 0;
}

Vec3 pressHub(const SceneModel& model, Vec3 arm_W_m, double insertion_m, StepReport& report) noexcept {
  assert(insertion_m > model.needle_length_m);
  report.flags |= kFlagBeyondNeedle;
  report.hub_N = hubStiffness_N_per_m(model) * (insertion_m - model.needle_length_m);
  return arm_W_m * (-report.hub_N / insertion_m);
}

extern const EffectEntry kHubEntry;
constinit const EffectEntry kHubEntry = {
    .effect = Effect::kHub,
    .name = "HUB",
    .label = "Hub: stops a needle that is in to its hub",
    .short_name = "hub",
    .term = "hub",
    .along_u = false,
    .colour = 0xBBFFFF,
    .place = 8,
    .value =
        [](const StepReport& report) { return (report.flags & kFlagBeyondNeedle) != 0 ? report.hub_N : 0.0; },
    .section = "hub",
    .fields = kHubFields,
    .hasNumbers =
        [](const SceneSpec& spec) {
          return spec.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m] > 0;
        },
    .stiffness_N_per_m = hubStiffness_N_per_m,
    // when the hub is on the skin, the membranes are behind the tip and the fixture's push no longer grows
    .acts_with = ActsWith::kCutTissue,
    .lower = [](SceneSpec& spec, double share) { stiffnessOf(spec) *= share; }};

}  // namespace needlelab
