/// Checks whether a needle enters the skin tip first: hub first indicates another quaternion order or frame.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

/// The needle points along z of its frame. `tip`: returns row i, in the limb's frame W. Returns a warning for
/// people about the first entry where it points out of the skin; empty if there is none.
std::optional<std::string> needleDirectionWarning(const Limb& limb, std::size_t rows,
                                                  const std::function<TipSample(std::size_t)>& tip);

/// Prints it on standard error.
void warnOfDirection(const char* command, const Limb& limb, std::size_t rows,
                     const std::function<TipSample(std::size_t)>& tip);
TipSample tipOf(const GestureSample& sample);

}  // namespace needlelab
