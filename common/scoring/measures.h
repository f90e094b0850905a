/// Measures of a gesture, from its recording alone (DESIGN §11): pure functions, no files, no clock.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/dtw.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The version of all definitions in this folder that decide about a value. It goes up by one whenever the
/// value of any measure of any gesture changes or a measure comes or goes; a test over committed gestures
/// (definition_test.cpp) tells when. Stored scores say which version they are of.
/// 1: until issue 5. 2: movements, turns, mean force per layer, work against clamping, distance from
/// references.
inline constexpr std::uint32_t kScoreDefinitionVersion = 2;

/// One row of a score.
struct Measure {
  std::string name;           ///< as in §11, e.g. "peak_force_n"
  double value = 0;           ///< always finite
  std::string unit;           ///< "m", "s", "N", "m/s", "m^2", or "" for counts and shares
  std::optional<double> min;  ///< the exercise's requirement, where it has one
  std::optional<double> max;
  std::optional<bool> passed;  ///< whether the requirement is met; empty where there is none
  std::string words;           ///< the measure and its requirement as a sentence for a person
  bool measured =
      true;  ///< false: required by the exercise, but this gesture has no such measure; `value` is 0
};

/// All measures of a gesture, in a fixed order. A measure that does not apply is left out: of layers and
/// targets that the profile does not have, of tissue that was never entered, smoothness without movement.
///
/// Definitions stand beside the code of each group: motion.cpp, actions.cpp, paths.cpp, tissue.cpp, aim.cpp,
/// syringe.cpp, smoothness.h. What they share:
/// - Lengths of paths, speeds, swept area and smoothness come from positions averaged to 100 Hz and
/// low-passed to 6 Hz
///   (track.h), so that they do not depend on the loop's rate. Depths, distances and forces come from the
///   ticks themselves.
/// - In tissue is what the engine took for it (a layer is given). A tick stands for the time to the next one.
/// - Ticks that are missing for up to 0.1 s are bridged by straight lines; nothing is assumed of longer gaps
/// (their time
///   counts in `elapsed_s` only). Samples that are not finite, absurd (1 km, 1 MN) or not in ascending order
///   of ticks are passed over.
///
/// `rate_hz`: of the loop; outside 50-40,000 there is no score. `X_WL`: where the profile's frame stood in W.
/// `exercise`: its requirements (and its time limit, as one on `elapsed_s`) fill min, max, passed; one on a
/// measure that this gesture does not have makes a row that did not pass and says why. `references`: paths of
/// gestures to compare with (paths.h); without any there is no `dtw_distance_m`. Thread: any; nothing is
/// shared.
std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz,
                                  const pb::Profile& profile, const Pose& X_WL,
                                  const pb::Exercise* exercise = nullptr,
                                  std::span<const TipPath> references = {});

/// Whether `scoreGesture` can give a measure of this name for some profile, e.g. "peak_force_layer_3_n".
bool isMeasureName(std::string_view name);
/// Errors: kInvalidInput, naming the first requirement whose measure no score has.
Status checkRequirements(const pb::Exercise& exercise);

/// A JSON list of {"measure", "value", "unit", "words"} and, where there is a requirement, "min", "max",
/// "passed". `value` is null where nothing was measured.
std::string scoreJson(std::span<const Measure> measures);
/// The rows that `scoreJson` wrote. kCorrupt: the text is none of its.
Result<std::vector<Measure>> parseScore(const std::string& json);
/// A table for a terminal: aligned columns, the words last, requirements marked.
std::string scoreText(std::span<const Measure> measures);

}  // namespace needlelab
