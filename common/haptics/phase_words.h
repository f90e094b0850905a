/// The needle's phase in the words that every program shows to people. Tables of numbers have phaseName().
#pragma once

#include <cstdint>
#include <string_view>

#include "common/haptics/sim_state.h"

namespace needlelab {

/// "outside", "going in", "at rest", "coming out".
constexpr std::string_view phaseWord(Phase phase) {
  switch (phase) {
    case Phase::kInserting:
      return "going in";
    case Phase::kStopped:
      return "at rest";
    case Phase::kWithdrawing:
      return "coming out";
    default:
      return "outside";
  }
}
/// Of a number from the network; "outside" for an unknown one.
constexpr std::string_view phaseWord(std::uint32_t phase) {
  return phaseWord(phase <= 3 ? static_cast<Phase>(phase) : Phase::kFree);
}

}  // namespace needlelab
