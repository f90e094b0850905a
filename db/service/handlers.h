/// One function per call. The caller has checked the role; the functions check access to each person's data.
/// Private to this folder.
#pragma once

#include <atomic>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "common/base/physical_disks.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/db_writer.h"
#include "db/encrypted_backup.h"
#include "db/person_refs.h"
#include "db/service/reference_paths.h"
#include "db/service/requests.h"
#include "needlelab/control.pb.h"
#include "needlelab/live.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {
class CodeTries;
class Duties;
class ExportLedger;
struct RequestUnderWay;
}  // namespace needlelab

namespace needlelab::handlers {

/// A handler's tools for one request.
struct Context {
  const Principal& who;
  DbWriter& writer;
  Connection& reader;
  std::int64_t now_unix_ns;
  std::string_view action;  ///< for the audit log
  ExportLedger& exports;
  CodeTries& codes;
  const std::atomic<bool>* cancelled = nullptr;  ///< set when the program ends: cancels long reads
  ReferencePaths* paths = nullptr;               ///< of reference sessions
  const BlockDevices* disks = nullptr;           ///< null: this machine's
  const BackupKey* backup_key = nullptr;         ///< null: backups are not encrypted
  RequestUnderWay* under_way = nullptr;          ///< null: a function of the service asks
  const Duties* duties = nullptr;                ///< null: nobody else works on the database
};

/// Whether the person is there, by the account that it logged in with, is not disabled and has this role; or
/// the station is there and is not revoked.
Result<bool> accessHolds(Connection& connection, const Principal& who);
/// The same of many, in some statements for all of them: of a server's connections.
Result<std::vector<bool>> accessHoldsOf(Connection& connection, std::span<const Principal> all);
/// kDenied when `who` came by a log-in and its access does not hold any more.
Status checkAccess(Connection& connection, const Principal& who);

/// Checks the asker's access, runs `work` on the writer and adds a line to the audit log, all or nothing;
/// returns after the commit.
Status write(const Context& context, const std::string& subject, const std::string& detail,
             const std::function<Status(Connection&)>& work);
/// The same, without a line when `work` finds on the writer that everything is so already, and returns false:
/// somebody else may have come first since a reader looked.
Status writeIfChanged(const Context& context, const std::string& subject, const std::string& detail,
                      const std::function<Result<bool>(Connection&)>& work);

/// The same for an edit: a conflict's message describes the earlier change as in the audit log.
Status edit(const Context& context, const std::string& subject, const std::string& detail,
            const std::function<Status(Connection&)>& work);
/// Writes down that somebody reads others' data, before it is returned. Many reads of one subject by one
/// person within an hour make one line (ExportLedger::isNew). Where the database can no longer be written to,
/// reading goes on without a line.
Status noteRead(const Context& context, const std::string& subject, const std::string& detail);

/// The request ends an access, or what it was opened with (Outcome::access_changed). Called within the
/// transaction: a COMMIT whose answer is lost may have been carried out.
void noteAccessChanged(const Context& context);

/// Where the asker has changed its own access, and keeps it on the connection on which it asks
/// (Outcome::access_number): within the transaction, after the change.
Status keepOwnAccess(const Context& context, Connection& writer, const std::string& name);

/// A reply that only confirms success.
pb::Reply doneReply();
/// kDenied unless the requester may assign or remove `role`, or set the password of a person with it. An
/// administrator may for all roles; a curriculum manager for roles up to its own, but not for researchers.
Status mayManage(const Context& context, pb::Role role);
/// The same for replacing one role by another: a curriculum manager cannot change the role of another
/// curriculum manager.
Status mayChangeRole(const Context& context, pb::Role from, pb::Role to);
/// "a, b, c, d, e and 3 more"
std::string someNames(const std::vector<std::string>& names);
/// The differences between two states of a group, as text: for the audit log and for the person whose edit
/// conflicts.
std::string groupChange(const pb::Group& before, const pb::Group& after);
/// kDenied when a trainee or a researcher asks for another person's data. `what`: "results".
Status ownOnly(const Context& context, const std::string& name, const std::string& what);

/// A session id from the network. kInvalidInput when the bytes are not one.
Result<Uuid> sessionId(const std::string& bytes);

// people and groups: people_handlers.cpp
Result<pb::Reply> addUser(const Context& context, const pb::AddUser& call);
Result<pb::Reply> setPassword(const Context& context, const pb::SetPassword& call);
Result<pb::Reply> disableUser(const Context& context, const pb::DisableUser& call);
Result<pb::Reply> listUsers(const Context& context, const pb::ListUsers& call);
Result<pb::Reply> getUser(const Context& context, const pb::GetUser& call);
Result<pb::Reply> changeUser(const Context& context, const pb::ChangeUser& call);
Result<pb::Reply> setConsent(const Context& context, const pb::SetConsent& call);
Result<pb::Reply> listConsents(const Context& context, const pb::ListConsents& call);
Result<pb::Reply> importPeople(const Context& context, const pb::ImportPeople& call);  ///< people_import.cpp
Result<pb::Reply> putGroup(const Context& context, const pb::PutGroup& call);
Result<pb::Reply> getGroup(const Context& context, const pb::GetGroup& call);
Result<pb::Reply> listGroups(const Context& context, const pb::ListGroups& call);
Result<pb::Reply> removeGroup(const Context& context, const pb::RemoveGroup& call);

// stations, and messages to them (the server delivers those): station_handlers.cpp
Result<pb::Reply> addStation(const Context& context, const pb::AddStation& call);
Result<pb::Reply> revokeStation(const Context& context, const pb::RevokeStation& call);
Result<pb::Reply> listStations(const Context& context, const pb::ListStations& call);
Result<pb::Reply> traineeMessage(const Context& context, const pb::TraineeMessage& call);
Result<pb::Reply> nextExercise(const Context& context, const pb::NextExercise& call);
Result<pb::Reply> setAids(const Context& context, const pb::SetAids& call);
Result<pb::Reply> stopLesson(const Context& context, const pb::StopLesson& call);

// profiles, curricula, lessons: lesson_handlers.cpp; profile_preview.cpp
Result<pb::Reply> importProfile(const Context& context, const pb::ImportProfile& call);
Result<pb::Reply> getProfile(const Context& context, const pb::GetProfile& call);
Result<pb::Reply> listProfiles(const Context& context, const pb::ListProfiles& call);
Result<pb::Reply> importCurriculum(const Context& context, const pb::ImportCurriculum& call);
Result<pb::Reply> getCurriculum(const Context& context, const pb::GetCurriculum& call);
Result<pb::Reply> listCurricula(const Context& context, const pb::ListCurricula& call);
Result<pb::Reply> getLesson(const Context& context, const pb::GetLesson& call);
Result<pb::Reply> profileRevisions(const Context& context, const pb::ListRevisions& call);
Result<pb::Reply> curriculumRevisions(const Context& context, const pb::ListRevisions& call);
Result<pb::Reply> checkJson(const Context& context, const pb::CheckText& call);
Result<pb::Reply> listExercises(const Context& context, const pb::ListExercises& call);
Result<pb::Reply> listMeasures(const Context& context, const pb::ListMeasures& call);
Result<pb::Reply> previewProfile(const Context& context, const pb::PreviewProfile& call);

// assignments and results: result_handlers.cpp
Result<pb::Reply> assign(const Context& context, const pb::Assign& call);
Result<pb::Reply> removeAssignment(const Context& context, const pb::RemoveAssignment& call);
Result<pb::Reply> listAssignments(const Context& context, const pb::ListAssignments& call);
Result<pb::Reply> getResults(const Context& context, const pb::GetResults& call);  ///< course_results.cpp
Result<pb::Reply> getProgress(const Context& context, const pb::GetProgress& call);
Result<pb::Reply> listTried(const Context& context, const pb::ListTried& call);
Result<pb::Reply> getAttempt(const Context& context, const pb::GetAttempt& call);
Result<pb::Reply> excuseAttempt(const Context& context, const pb::ExcuseAttempt& call);

Result<pb::Reply> checkTrainee(const Context& context,
                               const pb::CheckTrainee& call);  ///< trainee_handlers.cpp

// codes of trainees: code_handlers.cpp
Result<pb::Reply> setCode(const Context& context, const pb::SetCode& call);
Result<pb::Reply> getLabSettings(const Context& context, const pb::GetLabSettings& call);
Result<pb::Reply> changeLabSettings(const Context& context, const pb::ChangeLabSettings& call);
/// Whether a station may begin a lesson of `name`, who may practise (mayPractise, standing.h), with this
/// code. Returns whether the code was compared; false: nobody is asked for one. kCode, with a text for the
/// trainee: the code is missing or wrong, or has to wait; kDenied: no code, and the lab requires one. Nobody
/// but stations is asked. Hashes a code that is given: call it where
/// threadsOf() puts such requests.
Result<bool> checkCodeOf(const Context& context, const std::string& name, const std::string& code);

// score_handlers.cpp; rescoring: Service::rescore()
Result<pb::Reply> getScore(const Context& context, const pb::GetScore& call);
Result<pb::Reply> listScores(const Context& context, const pb::ListScores& call);
Result<pb::Reply> setReference(const Context& context, const pb::SetReference& call);
Result<pb::Reply> getReference(const Context& context, const pb::GetReference& call);

// erasures.cpp, study_handlers.cpp, record_handlers.cpp
/// Up to the commit.
Result<pb::Reply> erasePerson(const Context& context, const pb::ErasePerson& call);
Result<pb::Reply> listMentions(const Context& context, const pb::ListMentions& call);
Result<pb::Reply> redact(const Context& context, const pb::Redact& call);
/// Where the last backup was put; empty: there was none, or the folder is not there now (a stick).
std::filesystem::path backupsFolder(Connection& reader);
Result<pb::Reply> exportStudy(const Context& context, const pb::ExportStudy& call);
Result<pb::Reply> readStudyRecording(const Context& context, const pb::ReadStudyRecording& call);
Result<pb::Reply> exportPerson(const Context& context, const pb::ExportPerson& call);
Result<pb::Reply> exportAll(const Context& context, const pb::ExportAll& call);

// sessions, annotations, events: session_handlers.cpp
Result<pb::Reply> listSessions(const Context& context, const pb::ListSessions& call);
Result<pb::Reply> getSession(const Context& context, const pb::GetSession& call);
Result<pb::Reply> assignSession(const Context& context, const pb::AssignSession& call);
Result<pb::Reply> readChunks(const Context& context, const pb::ReadChunks& call);
/// The same without a line of the audit log, for a caller that has written its own.
Result<pb::Reply> readChunksUnnoted(const Context& context, const pb::ReadChunks& call);
Result<pb::Reply> seekSession(const Context& context, const pb::SeekSession& call);
Result<pb::Reply> verifySession(const Context& context, const pb::VerifySession& call);
Result<pb::Reply> annotate(const Context& context, const pb::Annotate& call);
Result<pb::Reply> listAnnotations(const Context& context, const pb::ListAnnotations& call);
Result<pb::Reply> listEvents(const Context& context, const pb::ListEvents& call);

/// A session by its id from the network, if this person may see it: a trainee sees only its own, and gets the
/// error for unknown sessions for others.
Result<pb::SessionInfo> visibleSession(const Context& context, const std::string& bytes);
/// Maximum size of a reply: it must fit into a 1 MiB message with its envelope.
inline constexpr std::size_t kMaxReplyBytes = (1u << 20) - 4096;

// --- lists that are longer than a message come in pages (control.proto)

/// Counts the bytes of a page's rows.
class PageRoom {
 public:
  /// False: the page is full and cannot take `row_bytes` more. The first row always fits.
  bool take(std::size_t row_bytes) {
    const bool fits = bytes_ == 0 || bytes_ + row_bytes <= kMaxReplyBytes;
    if (fits) bytes_ += row_bytes + 8;
    return fits;
  }
  /// With the names that will stand in the place of refs.
  bool take(const google::protobuf::Message& row) { return take(row.ByteSizeLong() + roomForNames(row)); }

 private:
  std::size_t bytes_ = 0;
};

/// Parses a numeric page token: a position in a list, or an id. 0 for the first page. kInvalidInput.
inline Result<std::uint64_t> numberOfPage(const std::string& page) {
  std::uint64_t number = 0;
  if (page.empty()) return number;
  const auto [end, error] = std::from_chars(page.data(), page.data() + page.size(), number);
  if (error == std::errc() && end == page.data() + page.size()) return number;
  return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
}

// the database itself: upkeep_handlers.cpp
Result<pb::Reply> backup(const Context& context, const pb::Backup& call);
Result<pb::Reply> check(const Context& context, const pb::Check& call);
Result<pb::Reply> listAudit(const Context& context, const pb::ListAudit& call);

// retention.cpp; its runs: Service::retention()
Result<pb::Reply> listRetention(const Context& context, const pb::ListRetention& call);
Result<pb::Reply> setRetention(const Context& context, const pb::SetRetention& call);

}  // namespace needlelab::handlers
