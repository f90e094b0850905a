#include "stability/hold_cases.h"

namespace needlelab {

std::vector<StabilityCase> holdCases() {
  return {
      {"hold_quantised", "a hold with a coarse encoder", true, false, holdQuantised},
  };
}

}  // namespace needlelab
