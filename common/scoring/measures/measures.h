/// Measures of a gesture, computed from its recording alone (README.md): pure functions, no files, no clock.
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
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/motion/dtw.h"
#include "common/scoring/motion/recorded_samples.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// All measures of a gesture, in a fixed order. A measure that does not apply is omitted: layers and targets
/// that the profile does not have, tissue that was never entered, smoothness without movement, errors against
/// a plan that the exercise does not have.
///
/// Definitions are beside the functions (measure_rows.cpp), the code of each group (measures.cpp,
/// measures_in_tissue.cpp), and in track.h, dtw.h and syringe_events.h. In common:
/// - Lengths of paths, speeds, swept area and smoothness come from positions averaged to 100 Hz and
///   low-passed to 6 Hz (track.h), so that they do not depend on the loop's rate. Depths, distances and
///   forces come from the ticks themselves.
/// - The needle is in tissue when the engine says so (a layer is given). A tick stands for the time to the
///   next one.
/// - Gaps of up to 0.1 s are bridged by straight lines; nothing is assumed about longer gaps (their time
///   counts in `elapsed_s` only).
/// - Samples that are not finite, absurd (1 km, 1 MN) or not in ascending order of ticks are skipped.
///
/// `rate_hz`: rate of the loop; there is no score outside 50-40,000, nor for a motion that is too long or in
/// too many pieces (checkMotion in motion_cost.h gives the reason). `X_WL`: pose of the profile's frame in W.
/// `exercise`: errors refer to its plan; its requirements (and its time limit, as a requirement on
/// MeasureRole::kTime) fill min, max, passed; a requirement on a measure that this gesture does not have adds
/// a row that is not passed and states the reason. `references`: paths of gestures to compare with (dtw.h);
/// without references there is no `dtw_distance_m`. Thread: any; shares no state.
std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz,
                                  const pb::Profile& profile, const Pose& X_WL,
                                  const pb::Exercise* exercise = nullptr,
                                  std::span<const TipPath> references = {});
/// The same, bit for bit, for a recording that is decoded block by block; check samples.fault() afterwards.
/// Memory besides the samples: about 25 bytes per sample at 1 kHz.
std::vector<Measure> scoreGesture(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile,
                                  const Pose& X_WL, const pb::Exercise* exercise = nullptr,
                                  std::span<const TipPath> references = {});

/// scoreGesture in steps, so that other work can use the thread in between; the result is the same, bit for
/// bit, for any division into steps. A step exceeds its work by at most one piece; the longest piece is the
/// motion of the longest recording (about 0.2 s). Thread: one at a time.
class GestureScore {
 public:
  /// In a body: ticks whose path came too late, and those in which a layer had been passed unfelt.
  struct LatePaths {
    std::uint64_t kept = 0, skipped = 0;
    std::uint64_t first_tick = 0;  ///< of all of them
  };

  /// As for scoreGesture(); samples, profile, exercise and references must outlive it.
  GestureScore(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile, const Pose& X_WL,
               const pb::Exercise* exercise = nullptr, std::span<const TipPath> references = {});
  ~GestureScore();
  GestureScore(const GestureScore&) = delete;
  GestureScore& operator=(const GestureScore&) = delete;

  /// Returns true when done, or if the samples have a fault; then there are no measures.
  bool step(StepWork& work);
  /// Call when done; as scoreGesture().
  [[nodiscard]] const std::vector<Measure>& measures() const;
  /// Call when done, for a gesture that has measures; as syringeEvents().
  [[nodiscard]] const std::vector<pb::SyringeEvent>& events() const;
  /// Call when done.
  [[nodiscard]] const LatePaths& latePaths() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Whether `scoreGesture` can give a measure of this name for some profile, e.g. "peak_force_layer_3_n".
bool isMeasureName(std::string_view name);
/// Errors: kInvalidInput, naming the first requirement on a measure that does not exist, or that needs a plan
/// when the exercise has none: it could not be passed.
Status checkRequirements(const pb::Exercise& exercise);

/// The verdict on an attempt or a requirement, for people: "passed", "not passed", "no verdict" (nothing is
/// required, or there is no score yet). All screens, pages and tables in C++ use it; codes for computers
/// ("failed" in JSON and queries) are separate.
const char* verdictName(std::optional<bool> passed);

/// Returns a JSON list of {"measure", "value", "unit", "words"} and, for rows with a requirement, "min",
/// "max", "passed". `value` is null if nothing was measured.
std::string scoreJson(std::span<const Measure> measures);
/// Reads the rows that `scoreJson` wrote. Errors: kCorrupt if the text is not from `scoreJson`.
Result<std::vector<Measure>> parseScore(const std::string& json);
/// Formats a table for a terminal: aligned columns, words last, requirements marked.
std::string scoreText(std::span<const Measure> measures);

/// The identification of one score in a CSV.
struct ScoreCsvAttempt {
  std::string session, trainee, exercise;  ///< ids; the session's as text
  std::uint32_t attempt = 0;               ///< number of the attempt at that exercise, from 1
  std::int64_t started_unix_ns = 0;
  std::uint32_t definition_version = 0;
};

/// `session,trainee,exercise,attempt,started,definition_version,measure,value,unit,better,min,max,passed` and
/// a line feed. Stable: columns are only added at the end.
void appendScoreCsvHeader(std::string& out);

/// Appends one row per measure, in the score's order: `started` as isoTimeMs(), values with 17 significant
/// digits, empty if nothing was measured; min, max and passed (1 or 0), empty if nothing is required. Texts
/// that begin like a spreadsheet formula (= + - @) get a leading '; texts with commas, quotes or line feeds
/// are quoted. Errors: kCorrupt if `measures_json` is not a score; nothing is appended then.
Status appendScoreCsvRows(std::string& out, const ScoreCsvAttempt& attempt, const std::string& measures_json);

}  // namespace needlelab
