#include "client/sim/stability/motion_cases.h"

namespace needlelab {
namespace {

// a case of the gate: as shipped, with it
template <auto Run>
Result<CaseOutcome> gated(const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source) {
  return Run(settings, model, source, Gate::kPresent);
}

}  // namespace

std::vector<StabilityCase> motionCases() {
  return {
      {"retreat_in_ramp", "the needle is drawn back while the force of a stop fades", true, true,
       retreatInRamp},
      {"clamp_pump", "aside while shallow, in, back, out: the fixture must not pay", false, true, clampPump},
      {"tilt_pump", "tilted while shallow, in, upright, out: the tilt limit must not pay", false, true,
       tiltPump},
      {"turn_wide", "30 mm aside at 12 mm deep: the trajectory turns without a step", false, true, turnWide},
      {"grazing_85deg", "a needle nearly flat on the skin, in and out", false, true, grazing85},
      {"exit_normal", "the pull on the way out fades to nothing at the skin", true, true, exitNormal},
      {"sphere_far_side", "in on one side of a limb and out on the other", true, true, sphereFarSide},
      {"beyond_the_needle", "deeper than the needle is long, and out", true, true, beyondTheNeedle},
      {"starts_inside", "the station starts with the tip in the tissue", true, true, startsInside},
      {"teleport", "the tip jumps by 50 mm", true, true, gated<teleport>},
      {"not_a_number", "position or orientation is not a number", true, true, gated<notANumber>},
      {"frozen_device", "the device stands still, or says nothing more", true, true, gated<frozenDevice>},
      {"flipped_axis", "the needle points out of the tissue; samples of any kind", true, true,
       gated<flippedAxis>},
      {"random_energy", "random gestures in random scenes under the passivity observer", true, true,
       randomEnergy},
  };
}

}  // namespace needlelab
