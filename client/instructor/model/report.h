/// The report about a session: its data, gathered from the server, and a page for people.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "client/view/model/plot.h"
#include "common/base/result.h"
#include "common/scoring/measures.h"

namespace needlelab {

/// A measure beside the experts', from the server's GetScore.
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
  std::vector<std::string> notes;  ///< what the server could not give, for the reader
};

/// Asks the server for everything beside the recording. Leaves out and notes what the server does not have; a
/// lost connection is an error. `gesture` is not null.
Result<ReportData> collectReport(const LabCall& call, std::shared_ptr<const StoredGesture> gesture);

/// Rows of GetProgress.measures_json.
std::vector<ProgressRow> progressRowsOf(const std::string& measures_json);
/// Rows of Score.comparison_json.
std::vector<StandingRow> standingRowsOf(const std::string& comparison_json);

/// A measure over the attempts, with the experts' range as a band, in shown units.
Plot progressPlot(const ReportData& data, const ProgressRow& row);

/// The page: one HTML file that needs no other, with plots, measures, progress, remarks. All text that others
/// wrote is escaped; there is no script and no link to another file. The same data give the same bytes.
std::string reportHtml(const ReportData& data);

/// Reads the session and its data, and writes the page. Errors: those of loadGesture, collectReport
/// and the disk.
Status writeReport(const LabCall& call, const std::string& session_id, const std::filesystem::path& file,
                   const ScenePreparer& prepare = {});

/// The samples as CSV, the columns of gesture/sample_csv.h: as `needlelab-admin session export --format csv`.
/// Errors: the disk's, with the file's name.
Status writeSamplesCsv(const StoredGesture& gesture, const std::filesystem::path& file);

}  // namespace needlelab
