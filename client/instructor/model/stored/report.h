/// The report on a session: collects data from the server, writes a page for people.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/instructor/model/stored/stored_gesture.h"
#include "client/view/model/plot.h"
#include "common/base/result.h"
#include "common/scoring/attempts/reference.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {

/// A measure compared with the experts, from the server's GetScore.
struct PlaceRow {
  std::string measure, words;
  PlaceMarks marks;
};
/// A measure over this trainee's attempts at this exercise.
struct ProgressRow {
  std::string measure, unit, words;
  std::vector<double> attempts;  ///< attempt numbers, from 1
  std::vector<double> values;
};

struct ReportData {
  std::shared_ptr<const StoredGesture> gesture;
  std::vector<Measure> measures;  ///< from the newest score; empty if not scored yet
  std::uint32_t definition_version = 0;
  std::optional<bool> passed;
  std::string exercise_name, exercise_text;
  std::vector<pb::ReferenceBand> bands;  ///< from the exercise's reference
  std::vector<PlaceRow> places;
  std::vector<ProgressRow> progress;
  std::vector<pb::Annotation> remarks;  ///< by time; current, so some may be newer than the loaded gesture
  std::uint32_t attempt = 0;            ///< this session's attempt number; 0: unknown
  std::vector<std::string> notes;       ///< what is missing, for the reader
};

/// Requests all data except the recording. Omits missing data with a note; a lost connection is an error.
/// `gesture` must not be null.
Result<ReportData> collectReport(const LabCall& call, std::shared_ptr<const StoredGesture> gesture);

/// Parses GetProgress.measures_json.
std::vector<ProgressRow> progressRowsOf(const std::string& measures_json);
/// Parses Score.comparison_json; omits rows without a comparison.
std::vector<PlaceRow> placeRowsOf(const std::string& comparison_json);
/// Returns this measure's row; null if it was not compared.
const PlaceRow* placeOf(const ReportData& data, const std::string& measure);

/// Returns the names of the profile's layers for people, for `measureWords`; empty if the profile is not
/// readable.
std::vector<std::string> layerNamesOf(const ReportData& data);

/// Plots a measure over the attempts with the experts' range as a band, in display units.
Plot progressPlot(const ReportData& data, const ProgressRow& row);

/// Returns the page: one self-contained HTML file with plots, measures, progress, remarks. Escapes all text
/// from other people; contains no script and no links to other files. Deterministic.
std::string reportHtml(const ReportData& data);

/// Reads the session and its data and writes the page. Errors: from loadGesture, collectReport and the disk.
Status writeReport(const LabCall& call, const std::string& session_id, const std::filesystem::path& file,
                   const ScenePreparer& prepare = {});

/// Writes the samples as CSV with the columns of gesture/sample.h, as `needlelab-admin session export
/// --format csv` does. Errors: from the disk, with the file's name.
Status writeSamplesCsv(const StoredGesture& gesture, const std::filesystem::path& file);

// --- plots as SVG within HTML

/// Escapes other people's text for use between tags and in quoted attributes: & < > " ' become entities;
/// control characters and invalid UTF-8 become '?'.
std::string htmlText(std::string_view text);

/// In points.
struct SvgSize {
  double width = 720, height = 200;
};
/// Returns one <svg> with all names escaped. Draws long series by the minimum and maximum at each point.
/// Converts the dark window's colours to ink for white paper; shows time in s.
std::string svgPlot(const Plot& plot, SvgSize size = {});

/// A value compared with the experts: a bar for their range, a diamond for the value.
std::string svgPlace(const PlaceMarks& marks);

}  // namespace needlelab
