/// What a report about a session says, gathered from the server.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "common/base/result.h"
#include "common/scoring/measures.h"

namespace needlelab {

/// A measure beside the experts', as the server's GetScore says it.
struct StandingRow {
  std::string measure, standing, words;
};
/// A measure over the attempts of this trainee at this exercise.
struct ProgressRow {
  std::string measure, unit, words;
  std::vector<double> attempts;  ///< numbers, from 1
  std::vector<double> values;
};

struct ReportData {
  std::shared_ptr<const StoredGesture> gesture;
  std::vector<Measure> measures;  ///< of the newest score; empty: none yet
  std::uint32_t definition_version = 0;
  std::optional<bool> passed;
  std::string exercise_name, exercise_text;
  std::vector<pb::ReferenceBand> bands;  ///< of the exercise's reference
  std::vector<StandingRow> standings;
  std::vector<ProgressRow> progress;
  std::vector<pb::Annotation>
      remarks;                     ///< by time, as they are now: some may be newer than the loaded gesture
  std::uint32_t attempt = 0;       ///< this session's number; 0: not known
  std::vector<std::string> notes;  ///< what could not be had, in words
};

/// Everything beside the recording. What the server does not have is left out and noted; a lost connection is
/// an error. `gesture` not null.
Result<ReportData> collectReport(const LabCall& call, std::shared_ptr<const StoredGesture> gesture);

/// Rows of GetProgress.measures_json.
std::vector<ProgressRow> progressRowsOf(const std::string& measures_json);
/// Rows of Score.comparison_json.
std::vector<StandingRow> standingRowsOf(const std::string& comparison_json);

}  // namespace needlelab
