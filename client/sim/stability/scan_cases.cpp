#include "client/sim/stability/scan_cases.h"

namespace needlelab {

std::vector<StabilityCase> scanCases() {
  return {
      {"stiffness_scan", "a nudge dies out up to 0.9 of the theory's stiffness, at every rate and delay",
       true, false, stiffnessScan},
      {"over_limit_bounded", "a wall far too stiff for a soft hand stays within its own forces", true, false,
       overLimitBounded},
      {"free_hand_release", "a needle that the hand lets go is not thrown out", true, false, freeHandRelease},
      {"skin_flutter", "trembling through the skin gives the hand no energy", true, false, skinFlutter},
      {"friction_reversal", "shaft friction turns round without chatter", false, false, frictionReversal},
      {"late_and_missing_ticks", "ticks that come late or not at all do not shake the hold", true, false,
       lateAndMissingTicks},
  };
}

}  // namespace needlelab
