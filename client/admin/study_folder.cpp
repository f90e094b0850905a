// A study as a Motion-BIDS dataset: bids-specification.readthedocs.io, "Motion", 1.9.0.
#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cctype>
#include <cstdio>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "client/admin/session_export.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/gesture/chunk.h"
#include "common/gesture/sample_columns.h"

namespace needlelab {
namespace {

constexpr char kStudyReadme[] =
    "Lessons of needle injection on a haptic simulator, recorded by needlelab. People and sessions have "
    "pseudonyms of this study.\n\nA row of *_motion.tsv is a tick of the haptic loop, a column a channel of "
    "*_channels.tsv. Times (t_s, of type LATENCY) begin at 0; a loop can miss ticks. Forces and torques act on "
    "the hand and have the type MISC. sourcedata/records.jsonl has profiles and scores.\n";

/// Letters and digits only, as BIDS demands.
std::string bidsLabel(std::string name) {
  std::erase_if(name, [](unsigned char c) { return c >= 0x80 || std::isalnum(c) == 0; });
  return name.empty() ? "lesson" : name;
}

std::string channelTable() {
  std::string table = "name\tcomponent\ttype\ttracked_point\tunits\treference_frame\tdescription\n";
  const GestureSample none;
  forEachSampleColumn(none, 0, [&](const SampleColumn& column, auto) {
    const std::string_view name = column.name, unit = column.unit;
    const auto in_frame = [&](const char* word) { return column.inFrame() ? word : "n/a"; };
    const char* const type = name == "t_s"                               ? "LATENCY"
                             : name[0] == 'q'                            ? "ORNT"
                             : column.inFrame() && name.starts_with('p') ? "POS"
                                                                         : "MISC";
    table += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\t{}\n", name, column.component, type, in_frame("tip"),
                         unit == "1" ? "n/a" : unit, in_frame("W"), column.description);
  });
  return table;
}

/// A folder under a temporary name; its end removes it.
struct TemporaryFolder {
  std::filesystem::path path;
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path.empty()) std::filesystem::remove_all(path, ignored);
  }
  [[nodiscard]] Status put(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path / name).parent_path());
    return writeFileAtomically(path / name, viewOf(text));
  }
  [[nodiscard]] Status put(const std::string& name, const Json& value) const {
    return put(name, value.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  }
};

/// `session`: its record in the study.
Status putSession(Backend& backend, const std::string& study, const Json& session, const std::string& subject,
                  const TemporaryFolder& folder) {
  const std::string name = session.at("session"), exercise = session.at("exercise_id");
  const std::string visit = "ses-" + bidsLabel(name);
  const std::string stem =
      fmt::format("{0}/{1}/motion/{0}_{1}_task-{2}", subject, visit, bidsLabel(exercise));
  const std::string tracked = stem + "_tracksys-needle";
  RETURN_IF_ERROR(folder.put(tracked + "_channels.tsv", channelTable()));
  const Json frames = {{"Description", "W: base of the device"},
                       {"Levels", {{"W", {{"RotationRule", "right-hand"}}}}}};
  RETURN_IF_ERROR(folder.put(tracked + "_channels.json", Json{{"reference_frame", frames}}));
  ASSIGN_OR_RETURN(auto motion, GrowingFile::create(folder.path / (tracked + "_motion.tsv")));
  double samples = 0, end_s = 0;
  RETURN_IF_ERROR(readStudyChunks(backend, study, name, [&](ByteView chunk) -> Status {
    ASSIGN_OR_RETURN(const auto decoded, decodeChunk(chunk));
    std::string rows;
    for (const GestureSample& sample : decoded) appendSampleRow(rows, sample, 0, '\t', "n/a");
    samples += static_cast<double>(decoded.size());
    end_s = 1e-9 * static_cast<double>(decoded.back().time_ns);
    return motion.append(viewOf(rows));
  }));
  RETURN_IF_ERROR(motion.finish());
  const double mean_hz = end_s > 0 ? (samples - 1) / end_s : 0;
  const bool thinned = session.at("recording") == "THINNED";
  const Json about = {{"TaskName", exercise},
                      {"SamplingFrequency", thinned ? Json(mean_hz) : session.at("rate_hz")},
                      {"SamplingFrequencyEffective", mean_hz},
                      {"TrackingSystemName", "needle"},
                      {"MissingValues", "n/a"}};
  RETURN_IF_ERROR(folder.put(tracked + "_motion.json", about));
  return folder.put(stem + "_events.tsv",
                    fmt::format("onset\tduration\ttrial_type\n0\t{:.6f}\tlesson\n", end_s));
}

}  // namespace

Status exportStudyFolder(Backend& backend, Output& output, const std::string& study,
                         const std::filesystem::path& path,
                         const std::function<void(pb::Request&, const std::string&)>& ask) {
  const auto target = path.has_filename() ? path : path.parent_path();
  if (target.empty() || std::filesystem::exists(std::filesystem::symlink_status(target)))
    return Error{ErrorCode::kInvalidInput,
                 "--out '" + path.string() + "': give the name of a new folder for Motion-BIDS"};
  std::string temporary = target.string() + std::string(kTemporaryMark) + "XXXXXX";
  if (::mkdtemp(temporary.data()) == nullptr) return systemError(target, "create the folder");
  TemporaryFolder folder{temporary};
  std::string records, people = "participant_id\n";
  std::vector<Json> sessions;
  RETURN_IF_ERROR(eachPage(backend, ask, [&](const pb::Reply& reply) {
    for (const std::string& record : reply.records().records()) {
      records += record + "\n";
      Json row = storedJson(record);
      row.erase("profile");
      if (row.at("kind") == "session" && row.at("recording") != "DELETED" && row.at("samples") != 0)
        sessions.push_back(std::move(row));
    }
    return reply.records().next_page();
  }));
  for (const Json& session : sessions) {
    const std::string subject = "sub-" + bidsLabel(session.at("person"));
    if (!people.ends_with(subject + "\n")) people += subject + "\n";  // a person's sessions follow each other
    RETURN_IF_ERROR(putSession(backend, study, session, subject, folder));
  }
  RETURN_IF_ERROR(folder.put("participants.tsv", people));
  const Json id = {{"Description", "the person's pseudonym, without its hyphen"}};
  RETURN_IF_ERROR(folder.put("participants.json", Json{{"participant_id", id}}));
  RETURN_IF_ERROR(folder.put("README", std::string(kStudyReadme)));
  RETURN_IF_ERROR(folder.put("sourcedata/records.jsonl", records));
  const Json program = {{"Name", "needlelab"}, {"Version", programVersion()}};
  const Json about = {{"Name", "needlelab study " + study},
                      {"BIDSVersion", "1.9.0"},
                      {"DatasetType", "raw"},
                      {"GeneratedBy", Json::array({program})}};
  RETURN_IF_ERROR(folder.put("dataset_description.json", about));
  if (::renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) != 0)
    return systemError(target, "rename into place");
  folder.path.clear();
  output.done(fmt::format("wrote {} recordings of study '{}' to {}", sessions.size(), study, path.string()));
  return syncFolder(target.parent_path());
}

}  // namespace needlelab
