/// The accuracy report's comparison of models with recorded needle forces. Each part skips with a note where
/// its recording is not there.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// Every model that can follow it, fitted to a part of the force-depth curve of bovine liver and heart; the
/// error on the part held out: alternate blocks, and the end of the curve (extrapolation).
Result<AccuracyRows> recordedCurveRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes);
/// The hold's relaxation by the stop's two modes, and the withdrawal.
Result<AccuracyRows> recordedHoldRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);
/// Puncture of a film: each needle predicted from the two others by a power law.
Result<AccuracyRows> recordedFilmRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);
/// The statistical model's draws against the distribution that they are to have. Needs no recording.
Result<AccuracyRows> statisticalRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                     std::vector<std::string>& notes);
/// The epidural sample's table against the polynomials that it restates. Needs no recording.
Result<AccuracyRows> epiduralRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

/// All of them, in that order.
Result<AccuracyRows> recordedRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

}  // namespace needlelab
