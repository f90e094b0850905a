/// Measures of a gesture, from its recording alone (README.md): pure functions, no files, no clock.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/dtw.h"
#include "common/scoring/recorded_samples.h"
#include "common/scoring/step_work.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The version of all definitions in this folder that decide about a value. Increase it by one whenever the
/// value of any measure of any gesture changes, or a measure is added or removed; a test over committed
/// gestures (definition_test.cpp) detects such a change. Stored scores contain their version.
/// 1: until issue 5. 2: movements, turns, mean force per layer, work against clamping, distance from
/// references. 3: contacts with bone. 4: errors against the exercise's plan; a gesture without one scores as
/// in 3. 5: SPARC of each movement, their mean by way; before, of the whole stretch in tissue, rests
/// included. 6: contacts of the hub with the skin. 7: in a target is in its tissues too; a profile whose
/// targets name none scores as in 6.
inline constexpr std::uint32_t kScoreDefinitionVersion = 7;

/// One row of a score.
struct Measure {
  std::string name;           ///< e.g. "peak_force_n"
  double value = 0;           ///< always finite
  std::string unit;           ///< "m", "s", "N", "m/s", "m^2", "J", "rad", or "" for counts and shares
  std::optional<double> min;  ///< the exercise's requirement, if any
  std::optional<double> max;
  std::optional<bool> passed;  ///< whether the requirement is met; empty without a requirement
  std::string words;           ///< the measure and its requirement as a sentence for a person
  bool measured =
      true;  ///< false: required by the exercise, but this gesture has no such measure; `value` is 0
};

/// All measures of a gesture, in a fixed order. A measure that does not apply is left out: for layers and
/// targets that the profile does not have, for tissue that was never entered, for smoothness without
/// movement, for errors against a plan that the exercise does not have.
///
/// Definitions stand beside the code of each group (measures.cpp, measures_in_tissue.cpp) and in track.h,
/// dtw.h and syringe_events.h. What they share:
/// - Lengths of paths, speeds, swept area and smoothness come from positions averaged to 100 Hz and
///   low-passed to 6 Hz (track.h), so that they do not depend on the loop's rate. Depths, distances and
///   forces come from the ticks themselves.
/// - The needle is in tissue when the engine says so (a layer is given). A tick stands for the time to the
///   next tick.
/// - Gaps of up to 0.1 s are bridged by straight lines; nothing is assumed about longer gaps (their time
///   counts in `elapsed_s` only).
/// - Samples that are not finite, absurd (1 km, 1 MN) or not in ascending order of ticks are skipped.
///
/// `rate_hz`: rate of the loop; outside 50-40,000 there is no score, nor for a motion that is too long or in
/// too many pieces (checkMotion of motion_cost.h says why). `X_WL`: pose of the profile's frame in
/// W. `exercise`: errors are taken from its plan; its requirements (and its time limit, as a requirement on
/// `elapsed_s`) fill min, max, passed; a requirement on a measure that this gesture does not have makes a row
/// that is not passed and states the reason. `references`: paths of gestures to compare with (dtw.h); without
/// references there is no `dtw_distance_m`. Thread: any; shares no state.
std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz,
                                  const pb::Profile& profile, const Pose& X_WL,
                                  const pb::Exercise* exercise = nullptr,
                                  std::span<const TipPath> references = {});
/// The same, bit for bit, of a recording that is decoded block by block; see samples.fault() afterwards.
/// Memory beside the samples: some 25 bytes a sample at 1 kHz.
std::vector<Measure> scoreGesture(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile,
                                  const Pose& X_WL, const pb::Exercise* exercise = nullptr,
                                  std::span<const TipPath> references = {});

/// The same in steps, between which others may have the thread: the same bits, however it is cut into steps.
/// One step is at most one piece longer than its work; the longest piece is the motion of the longest
/// recording (some 0.2 s). Thread: one at a time.
class GestureScore {
 public:
  /// As for scoreGesture(); samples, profile, exercise and references must outlive it.
  GestureScore(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile, const Pose& X_WL,
               const pb::Exercise* exercise = nullptr, std::span<const TipPath> references = {});
  ~GestureScore();
  GestureScore(const GestureScore&) = delete;
  GestureScore& operator=(const GestureScore&) = delete;

  /// True: it is done; or the samples have a fault, and there are no measures.
  bool step(StepWork& work);
  /// Once it is done: as scoreGesture().
  [[nodiscard]] const std::vector<Measure>& measures() const;
  /// Once it is done, of a gesture that has measures: as syringeEvents().
  [[nodiscard]] const std::vector<pb::SyringeEvent>& events() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Whether `scoreGesture` can give a measure of this name for some profile, e.g. "peak_force_layer_3_n".
bool isMeasureName(std::string_view name);
/// Errors: kInvalidInput with the first requirement on a measure that does not exist, or that needs a plan
/// which the exercise does not have: nobody could pass.
Status checkRequirements(const pb::Exercise& exercise);

/// The verdict on an attempt or on a requirement, for people: "passed", "not passed", "no verdict" (nothing
/// is required, or there is no score yet). Every screen, page and table in C++ takes it from here; codes for
/// computers ("failed" in JSON and queries) are not its matter.
const char* verdictName(std::optional<bool> passed);

/// Returns a JSON list of {"measure", "value", "unit", "words"} and, for rows with a requirement, "min",
/// "max", "passed". `value` is null where nothing was measured.
std::string scoreJson(std::span<const Measure> measures);
/// Reads the rows that `scoreJson` wrote. kCorrupt: the text is not from `scoreJson`.
Result<std::vector<Measure>> parseScore(const std::string& json);
/// Formats a table for a terminal: aligned columns, words last, requirements marked.
std::string scoreText(std::span<const Measure> measures);

/// The identification of one score in a CSV.
struct ScoreCsvAttempt {
  std::string session, trainee, exercise;  ///< ids; the session's as text
  std::uint32_t attempt = 0;               ///< number at that exercise, from 1
  std::int64_t started_unix_ns = 0;
  std::uint32_t definition_version = 0;
};

/// `session,trainee,exercise,attempt,started_unix_ns,definition_version,measure,value,unit,better,min,max,passed`
/// and a line feed. Stable: columns are only added at the end.
void appendScoreCsvHeader(std::string& out);

/// Appends one row per measure, in the score's order: values with 17 significant digits, empty where nothing
/// was measured; min, max and passed (1 or 0) empty where nothing is required. Texts that begin like a
/// spreadsheet formula (= + - @) get a leading '; texts with commas, quotes or line feeds are quoted. Errors:
/// kCorrupt if `measures_json` is not a score; nothing is appended then.
Status appendScoreCsvRows(std::string& out, const ScoreCsvAttempt& attempt, const std::string& measures_json);

}  // namespace needlelab
