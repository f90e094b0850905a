/// When an insertion begins and ends, and where (DESIGN §3.1). Rare, hence apart from the tick.
#pragma once

#include <limits>

#include "common/haptics/tick.h"

namespace needlelab {

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// The report of a tick without force.
void clearReport(StepReport& report, double depth_m, std::uint32_t flags) noexcept;

/// A tick that does not begin and end in the same layer: outside, an entry, an exit, another layer; or a
/// sample that is not finite. True in tissue: the report's flags say what happened, at an entry P0, n, u and
/// all that is remembered are set to their beginning, and the tick goes on as any other. False when there is
/// no force in this tick; then the report is complete.
bool changeContact(const SceneModel& model, const TipSample& sample, double depth_m, SimState& state,
                   StepReport& report) noexcept;

}  // namespace needlelab
