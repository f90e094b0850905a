/// Measures of a gesture, from its recording alone (DESIGN §11): pure functions, no files, no clock.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "gesture/sample.h"
#include "haptics/geometry.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// One row of a score.
struct Measure {
  std::string name;           ///< as in §11, e.g. "peak_force_n"
  double value = 0;           ///< always finite
  std::string unit;           ///< "m", "s", "N", "m/s", "m^2", or "" for counts and shares
  std::optional<double> min;  ///< the exercise's requirement, where it has one
  std::optional<double> max;
  std::optional<bool> passed;  ///< whether the requirement is met; empty where there is none
  std::string words;           ///< the measure and its requirement as a sentence for a person
};

/// All measures of a gesture, in a fixed order. A measure that does not apply is left out: forces of layers that the
/// profile does not have, target measures without a target, smoothness without movement.
///
/// Definitions and constants: beside the code that computes them, in this folder. Positions are low-passed to
/// `kAnalysisCutoffHz` and taken at `kAnalysisRateHz` before any length or derivative is computed, so that the
/// score does not depend on `rate_hz`; ticks that the recording lacks are bridged by straight lines, their forces count as none.
/// Samples with positions that are not finite, and samples out of order, are passed over.
///
/// `samples`: ticks ascending. `rate_hz`: of the loop, > 0. `X_WL`: the placement of the profile's frame in W.
/// `exercise`: its requirements fill min, max, passed; a requirement on a measure that the gesture does not have
/// gives a row that did not pass and says why.
std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz, const pb::Profile& profile,
                                  const Pose& X_WL, const pb::Exercise* exercise = nullptr);

/// Whether `scoreGesture` can give a measure of this name for some profile, e.g. "peak_force_layer_3_n".
bool isMeasureName(std::string_view name);
/// Errors: kInvalidInput, naming the first requirement whose measure no score has.
Status checkRequirements(const pb::Exercise& exercise);

/// A JSON list of {"measure", "value", "unit"} and, where there is a requirement, "min", "max", "passed"; "words" always.
std::string scoreJson(std::span<const Measure> measures);
/// A table for a terminal: aligned columns, the words last, requirements marked.
std::string scoreText(std::span<const Measure> measures);

}  // namespace needlelab
