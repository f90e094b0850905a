/// Runs a gesture under the passivity observer and judges what it saw by DESIGN §10, `random_energy`.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "client/sim/stability/force_source.h"
#include "client/sim/stability/passivity_gesture.h"
#include "client/sim/stability/passivity_observer.h"

namespace needlelab {

/// What may be wrong with a gesture's forces.
enum class PassivityCheck : std::uint8_t { kFinite, kEnergy, kForceStep };
inline constexpr std::array<std::string_view, 3> kPassivityCheckNames = {"finite", "energy_j",
                                                                         "force_step_n"};

struct PassivityLimits {
  double energy_J = 5e-5;  ///< that an insertion, or all of the gesture, may give to the hand
  double step_N = 0.05;    ///< beyond ΣK·|Δp|/c where no release is declared
};

/// One failed check.
struct PassivityFinding {
  PassivityCheck check = PassivityCheck::kFinite;
  double measured = 0, limit = 0;
};

/// The motion is prescribed; the scene is the gesture's, rendered by `model` (likeForLike). Errors: those of
/// the profile and of the source.
Result<PassivityRecord> runGesture(const PassivityGesture& gesture, AxialModel model,
                                   const ForceSourceFactory& source);

/// The energy that is judged: the greatest of the whole gesture's net and of what any insertion had given at
/// any moment since its entry. Stricter than DESIGN §10, where what cutting takes may pay for a gift.
double judgedEnergy_J(const PassivityRecord& record);

/// The first failed check, in the order of PassivityCheck.
std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits);
/// Whether that one check failed.
std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits,
                                          PassivityCheck check);

}  // namespace needlelab
