/// When an insertion begins and ends, and where (DESIGN §3.1). Rare, hence apart from the tick.
#pragma once

#include <limits>

#include "haptics/effects/tick.h"

namespace needlelab {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// The report of a tick without force.
void clearReport(StepReport& report, double depth_m, std::uint32_t flags) noexcept;

/// A tick at whose start or end the tip is not in tissue: nothing, an exit or an entry. False when there is
/// no force in this tick; then the report is complete. True at an entry: P0, n, u and all that is remembered
/// are set to their beginning, the tick goes on as any other.
bool changeContact(const SceneModel& model, const TipSample& sample, double depth_m, SimState& state,
                   StepReport& report) noexcept;

}  // namespace needlelab
