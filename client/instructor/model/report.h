/// A session as a page for people: one HTML file that needs no other, with plots, measures, progress,
/// remarks.
#pragma once

#include <filesystem>
#include <string>

#include "client/instructor/model/report_data.h"
#include "common/base/result.h"

namespace needlelab {

/// The whole page. Everything that came from elsewhere is escaped; no script, no link to another file. The
/// same data give the same bytes.
std::string reportHtml(const ReportData& data);

/// Reads the session and what belongs to it, and writes the page. Errors: those of loadGesture, collectReport
/// and the disk.
Status writeReport(const LabCall& call, const std::string& session_id, const std::filesystem::path& file,
                   const ScenePreparer& prepare = {});

/// The samples as CSV, the columns of gesture/sample_csv.h: as `needlelab-admin session export --format csv`.
/// Errors: the disk's, with the file's name.
Status writeSamplesCsv(const StoredGesture& gesture, const std::filesystem::path& file);

}  // namespace needlelab
