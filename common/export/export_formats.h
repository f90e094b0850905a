/// The formats in which recordings, scores, results and studies leave needlelab, in one table
/// (export_formats.cpp). `needlelab-admin`, the web port and the console take from it what they offer, the
/// names, the file suffixes and the writers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/csv.h"
#include "common/gesture/sample.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Where a format is offered: a command of needlelab-admin, or a download of the console. Each place needs
/// one kind of writer.
enum class ExportPlace : std::uint8_t {
  kSessionExport,   ///< `session export`: samples
  kStudyRecording,  ///< `study recording`: samples
  kStudyExport,     ///< `study export`: records
  kRecords,         ///< `person export`, `export-all`: records. recordsEnd, the last line, is of JSON lines.
  kScoresExport,    ///< `scores export`: scores
  kResults,         ///< `results --out`: results
  kWebSamples,      ///< a session's samples. A row has at most 600 bytes (kMaxPieceRows).
  kWebScores,       ///< scores
  kWebResults,      ///< a course's results
  kWebStudy,        ///< records, written in the browser (client/web/app/pages/exports.js)
};

// Writers append text to `out`: begin() once, add() for each item in order, end() once. A file may be made
// in pieces of any length. Thread: one.

class SampleWriter {
 public:
  virtual ~SampleWriter() = default;
  /// `session`: makes the session's description, a JSON object.
  virtual void begin(std::string& out, const std::function<std::string()>& session) = 0;
  /// `first_time_ns`: the time of the recording's first sample.
  virtual void add(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) = 0;
  virtual void end(std::string&) {}
};

class ScoreWriter {
 public:
  virtual ~ScoreWriter() = default;
  virtual void begin(std::string& out) = 0;
  /// Errors: kCorrupt, naming the session, if the stored score is invalid; nothing is appended then.
  virtual Status add(std::string& out, const pb::ScoreRow& row) = 0;
  virtual void end(std::string&) {}
};

class ResultWriter {
 public:
  virtual ~ResultWriter() = default;
  /// `first`: the first page of GetResults with `with_measures`.
  virtual void begin(std::string& out, const pb::Results& first) = 0;
  /// Errors: kCorrupt if the stored score is invalid; nothing is appended then.
  virtual Status add(std::string& out, const pb::ResultRow& person, const pb::ResultCell& cell) = 0;
  virtual void end(std::string&) {}
};

/// How a format's file is made. Only needlelab-admin makes what is not text.
enum class ExportForm : std::uint8_t {
  kText,       ///< by the row's writer
  kRecording,  ///< samples: the recording's chunks, byte for byte
  kHdf5,       ///< samples: client/admin/files
  kBids,       ///< records and samples, in a folder: client/admin/study_folder.cpp
};

/// A row of the table.
struct ExportFormat {
  std::string_view name;            ///< of --format
  std::string_view suffix;          ///< of the file's or folder's name, with its dot, in small letters
  std::string_view media_type;      ///< Content-Type
  std::string_view title;           ///< of the format, for people
  std::string_view words;           ///< what the file holds
  std::vector<ExportPlace> places;  ///< the first row of a place is its default
  ExportForm form = ExportForm::kText;
  // The writer of text, by what the file holds.
  std::unique_ptr<SampleWriter> (*samples)() = nullptr;
  std::unique_ptr<ScoreWriter> (*scores)() = nullptr;
  std::unique_ptr<ResultWriter> (*results)(const CsvStyle& style) = nullptr;
  void (*record)(std::string& out, const std::string& record) = nullptr;  ///< appends one record
};

std::span<const ExportFormat> exportFormats();

/// The formats of a place, in the table's order; at least one.
std::vector<const ExportFormat*> formatsAt(ExportPlace place);

/// The formats of a place in a sentence: "csv, json or recording". `what`: &ExportFormat::name or another
/// text.
std::string formatList(ExportPlace place, std::string_view ExportFormat::*what);

/// Chooses a format of a place by its name; if `given` is empty by the file's suffix, otherwise the default.
/// `given`: the name of a format of this place, or empty. Errors: kInvalidInput if name and suffix
/// contradict each other.
Result<const ExportFormat*> formatFor(ExportPlace place, std::string_view given, const std::string& file);

}  // namespace needlelab
