/// Study `storage`: what a finer stored resolution gives, and costs.
#pragma once

#include "client/sim/accuracy/study.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// The steps of the standard resolution, all of them scaled as the length's step is to `length_m`; the tick's
/// own times keep 1 µs. 0 = lossless. Quaternions go to 2⁻¹² at most.
Resolution scaledResolution(double length_m);

/// Length steps of 0.1 µm to 100 µm and lossless: bytes and time a sample, error of the stored force and of
/// the force that the engine computes again from the stored poses.
Result<AccuracyRows> storageStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

}  // namespace needlelab
