#include "common/export/export_formats.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/base/program.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"
#include "common/scoring/attempts/result_table.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

template <typename Interface, typename Writer>
std::unique_ptr<Interface> make() {
  return std::make_unique<Writer>();
}

// --- samples

class SamplesAsCsv : public SampleWriter {
 public:
  void begin(std::string& out, const std::function<std::string()>&) override { appendSampleCsvHeader(out); }
  void add(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) override {
    appendSampleCsvRow(out, sample, first_time_ns);
  }
};

/// {"version", "machine", "session", "rows"}.
/// Of each 4 ms the sample with the greatest force, so that the file is for a spreadsheet and keeps the
/// peaks.
class SamplesForASpreadsheet : public SampleWriter {
 public:
  void begin(std::string& out, const std::function<std::string()>&) override { appendSampleCsvHeader(out); }
  void add(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) override {
    constexpr std::int64_t kRow_ns = 4'000'000;
    const std::int64_t row = (sample.time_ns - first_time_ns) / kRow_ns;
    if (kept_ && row != row_) write(out);
    if (!kept_ || squaredForce(sample) > squaredForce(*kept_)) kept_ = sample;
    row_ = row;
    first_time_ns_ = first_time_ns;
  }
  void end(std::string& out) override {
    if (kept_) write(out);
  }

 private:
  static double squaredForce(const GestureSample& s) {
    return s.force_W_N[0] * s.force_W_N[0] + s.force_W_N[1] * s.force_W_N[1] +
           s.force_W_N[2] * s.force_W_N[2];
  }
  void write(std::string& out) {
    appendRoundedCsvRow(out, *kept_, first_time_ns_);
    kept_.reset();
  }
  std::optional<GestureSample> kept_;
  std::int64_t row_ = 0, first_time_ns_ = 0;
};

class SamplesAsJson : public SampleWriter {
 public:
  void begin(std::string& out, const std::function<std::string()>& session) override {
    const nlohmann::ordered_json head = {{"version", programVersion()}, {"machine", machineText()}};
    out += head.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
    out.back() = ',';  // replaces the closing brace
    out += "\"session\":" + session() + ",\"rows\":[\n";
  }
  void add(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) override {
    if (!first_) out += ",\n";
    first_ = false;
    appendSampleJson(out, sample, first_time_ns);
  }
  void end(std::string& out) override { out += "\n]}\n"; }

 private:
  bool first_ = true;
};

// --- scores

std::string sessionText(const pb::Attempt& attempt) {
  Uuid id{};
  if (attempt.session_id().size() == id.size())
    std::copy(attempt.session_id().begin(), attempt.session_id().end(), id.begin());
  return uuidText(id);
}

class ScoresAsCsv : public ScoreWriter {
 public:
  void begin(std::string& out) override { appendScoreCsvHeader(out); }
  Status add(std::string& out, const pb::ScoreRow& row) override {
    const auto& attempt = row.attempt();
    const ScoreCsvAttempt beside{sessionText(attempt),      attempt.trainee(),
                                 attempt.exercise_id(),     attempt.number(),
                                 attempt.started_unix_ns(), row.score().definition_version()};
    const Status done = appendScoreCsvRows(out, beside, row.score().measures_json());
    if (done) return {};
    return Error{done.error().code, "session " + beside.session + ": " + done.error().message};
  }
};

/// The console's columns. Leaves out a score that is invalid.
class ScoresAsWebCsv : public ScoreWriter {
 public:
  void begin(std::string& out) override {
    out +=
        "trainee,exercise_id,attempt,session_id,started_unix_ms,passed,definition_version,measure,value,"
        "unit,min,max,met\r\n";
  }
  Status add(std::string& out, const pb::ScoreRow& row) override {
    const pb::Attempt& attempt = row.attempt();
    const auto measures = readShallowJson<nlohmann::json>(row.score().measures_json());
    if (!measures.is_array()) return {};
    const std::string head = fmt::format(
        "{},{},{},{},{},{},{},", csvCell(attempt.trainee()), csvCell(attempt.exercise_id()), attempt.number(),
        sessionText(attempt), attempt.started_unix_ns() / 1'000'000,
        row.score().has_passed() ? yesOrNo(row.score().passed()) : "", row.score().definition_version());
    for (const nlohmann::json& measure : measures) {
      if (!measure.is_object()) continue;
      const bool judged = measure.contains("passed") && measure["passed"].is_boolean();
      out += fmt::format("{}{},{},{},{},{},{}\r\n", head, textCell(measure, "measure"),
                         numberCell(measure, "value"), textCell(measure, "unit"), numberCell(measure, "min"),
                         numberCell(measure, "max"), judged ? yesOrNo(measure["passed"].get<bool>()) : "");
    }
    return {};
  }

 private:
  static std::string csvCell(std::string_view text) {
    std::string cell;
    appendCsvText(cell, text);
    return cell;
  }
  static std::string numberCell(const nlohmann::json& row, const char* name) {
    std::string text;
    if (row.contains(name) && row[name].is_number()) appendNumber(text, row[name].get<double>());
    return text;
  }
  static std::string textCell(const nlohmann::json& row, const char* name) {
    return row.contains(name) && row[name].is_string() ? csvCell(row[name].get<std::string>())
                                                       : std::string();
  }
  static const char* yesOrNo(bool yes) { return yes ? "yes" : "no"; }
};

// --- results, records

class ResultsAsCsv : public ResultWriter {
 public:
  explicit ResultsAsCsv(const CsvStyle& style) : table_(style) {}
  void begin(std::string& out, const pb::Results& first) override { table_.begin(out, first); }
  Status add(std::string& out, const pb::ResultRow& person, const pb::ResultCell& cell) override {
    return table_.add(out, person, cell);
  }

 private:
  ResultTable table_;
};

std::unique_ptr<ResultWriter> resultsAsCsv(const CsvStyle& style) {
  return std::make_unique<ResultsAsCsv>(style);
}

void appendLine(std::string& out, const std::string& record) {
  out += record;
  out += '\n';
}

// --- the table

std::vector<ExportFormat> allFormats() {
  using enum ExportPlace;
  return {
      {.name = "csv",
       .suffix = ".csv",
       .media_type = "text/csv; charset=utf-8",
       .title = "CSV",
       .words = "250 rows a second, each the sample with the greatest force of its 4 ms, rounded",
       .places = {kSessionExport},
       .samples = make<SampleWriter, SamplesForASpreadsheet>},
      {.name = "csv",
       .suffix = ".csv",
       .media_type = "text/csv; charset=utf-8",
       .title = "CSV",
       .words = "every tick, units in the header",
       .places = {kStudyRecording, kWebSamples},
       .samples = make<SampleWriter, SamplesAsCsv>},
      {.name = "json",
       .suffix = ".json",
       .media_type = "application/json",
       .title = "JSON",
       .words = "every tick, and what the session was",
       .places = {kSessionExport, kStudyRecording},
       .samples = make<SampleWriter, SamplesAsJson>},
      {.name = "recording",
       .suffix = ".nlrec",
       .media_type = "application/octet-stream",
       .title = "recording",
       .words = "the chunks as they are stored (common/gesture/FORMAT.md)",
       .places = {kSessionExport, kStudyRecording},
       .form = ExportForm::kRecording},
      {.name = "hdf5",
       .suffix = ".h5",
       .media_type = "application/x-hdf5",
       .title = "HDF5",
       .words = "every tick, a data set for each column with unit and resolution, and what the session was",
       .places = {kSessionExport, kStudyRecording},
       .form = ExportForm::kHdf5},
      {.name = "csv",
       .suffix = ".csv",
       .media_type = "text/csv; charset=utf-8",
       .title = "CSV",
       .words = "one row for each attempt and measure",
       .places = {kScoresExport},
       .scores = make<ScoreWriter, ScoresAsCsv>},
      {.name = "csv",
       .suffix = ".csv",
       .media_type = "text/csv; charset=utf-8",
       .title = "CSV",
       .words = "one row per attempt and measure, units in the header",
       .places = {kWebScores},
       .scores = make<ScoreWriter, ScoresAsWebCsv>},
      {.name = "csv",
       .suffix = ".csv",
       .media_type = "text/csv; charset=utf-8",
       .title = "CSV",
       .words = "a row for each person and exercise, with the measures that the course asks for",
       .places = {kResults, kWebResults},
       .results = resultsAsCsv},
      {.name = "jsonl",
       .suffix = ".jsonl",
       .media_type = "application/x-ndjson",
       .title = "JSON lines",
       .words = "sessions and scores",
       .places = {kStudyExport, kWebStudy},
       .record = appendLine},
      {.name = "bids",
       .suffix = ".bids",
       .media_type = "inode/directory",
       .title = "Motion-BIDS",
       .words = "a folder with the records and every recording",
       .places = {kStudyExport},
       .form = ExportForm::kBids},
      {.name = "jsonl",
       .suffix = ".jsonl",
       .media_type = "application/x-ndjson",
       .title = "JSON lines",
       .words = "everything but recordings",
       .places = {kRecords},
       .record = appendLine},
  };
}

}  // namespace

std::span<const ExportFormat> exportFormats() {
  static const std::vector<ExportFormat> all = allFormats();
  return all;
}

std::vector<const ExportFormat*> formatsAt(ExportPlace place) {
  std::vector<const ExportFormat*> found;
  for (const ExportFormat& format : exportFormats()) {
    if (std::find(format.places.begin(), format.places.end(), place) != format.places.end())
      found.push_back(&format);
  }
  return found;
}

std::string formatList(ExportPlace place, std::string_view ExportFormat::*what) {
  const auto formats = formatsAt(place);
  std::string list;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    if (i > 0) list += i + 1 == formats.size() ? " or " : ", ";
    list += formats[i]->*what;
  }
  return list;
}

Result<const ExportFormat*> formatFor(ExportPlace place, std::string_view given, const std::string& file) {
  const std::string suffix = lowerCase(std::filesystem::path(file).extension().string());
  const ExportFormat *by_name = nullptr, *by_suffix = nullptr;
  const auto formats = formatsAt(place);
  for (const ExportFormat* format : formats) {
    if (format->name == given) by_name = format;
    if (format->suffix == suffix) by_suffix = format;
  }
  if (by_name != nullptr && by_suffix != nullptr && by_name != by_suffix) {
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("--out {}: the name says {}, --format says {}: leave --format out, or take another name",
                    file, by_suffix->name, given)};
  }
  return by_name != nullptr ? by_name : by_suffix != nullptr ? by_suffix : formats.front();
}

}  // namespace needlelab
