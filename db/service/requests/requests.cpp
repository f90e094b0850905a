#include "db/service/requests/requests.h"

#include <fmt/core.h>

#include <stdexcept>
#include <string>
#include <type_traits>

#include "common/base/program.h"
#include "db/service/requests/handlers.h"

namespace needlelab {
namespace {

using namespace handlers;
using Call = pb::Request;
using pb::Reply;
using enum RequestThreads;
using enum Storing;

constexpr unsigned bit(pb::Role role) {
  // proto3 keeps numbers outside the enum: they have no bit
  return role >= pb::Role_MIN && role <= pb::Role_MAX ? 1u << role : 0u;
}
constexpr unsigned kTrainee = bit(pb::TRAINEE);
constexpr unsigned kInstructor = bit(pb::INSTRUCTOR);
constexpr unsigned kManager = bit(pb::CURRICULUM_MANAGER);
constexpr unsigned kAdmin = bit(pb::ADMINISTRATOR);
constexpr unsigned kStation = bit(pb::STATION);
constexpr unsigned kResearcher = bit(pb::RESEARCHER);
constexpr unsigned kManagers = kManager | kAdmin;
constexpr unsigned kStaff = kInstructor | kManagers;
constexpr unsigned kPeople = kStaff | kTrainee;
constexpr unsigned kAll = kPeople | kStation;
constexpr unsigned kReaders = kAll | kResearcher;  // for data about no particular person

/// The call's own message. Its type must match the row's handler; a test compares them.
template <typename Message>
const Message& callOf(const pb::Request& request) {
  const auto* field = pb::Request::descriptor()->FindFieldByNumber(request.call_case());
  const auto* call =
      google::protobuf::DynamicCastToGenerated<Message>(&request.GetReflection()->GetMessage(request, field));
  if (call == nullptr) throw std::logic_error("the handler takes another message than " + field->name());
  return *call;
}

/// Wraps a handler of handlers.h and borrows a reader for it.
template <typename Message>
Result<Reply> execute(const ServiceParts& parts, const Principal& who, const pb::Request& request,
                      RequestUnderWay& under_way, Result<Reply> (*handler)(const Context&, const Message&)) {
  return withReader(parts, who, callName(request.call_case()), under_way,
                    [&](const Context& context) { return handler(context, callOf<Message>(request)); });
}
/// Wraps a handler that borrows its own readers.
template <typename Message>
Result<Reply> execute(const ServiceParts& parts, const Principal& who, const pb::Request& request,
                      RequestUnderWay& under_way,
                      Result<Reply> (*handler)(const ServiceParts&, const Principal&, const Message&,
                                               RequestUnderWay&)) {
  return handler(parts, who, callOf<Message>(request), under_way);
}

template <typename Message>
const google::protobuf::Descriptor* messageTypeOf(Result<Reply> (*)(const Context&, const Message&)) {
  return Message::descriptor();
}
template <typename Message>
const google::protobuf::Descriptor* messageTypeOf(Result<Reply> (*)(const ServiceParts&, const Principal&,
                                                                    const Message&, RequestUnderWay&)) {
  return Message::descriptor();
}

/// A row's entry for a function that takes the call's message.
template <auto kHandler, Storing kStoring = kNothing>
constexpr RequestHandler to = {
    [](const ServiceParts& parts, const Principal& who, const pb::Request& request,
       RequestUnderWay& under_way) { return execute(parts, who, request, under_way, kHandler); },
    [] { return messageTypeOf(kHandler); }, kStoring};

// call, name in the audit log, permitted roles, handler (with what it stores), reply, threads; HTTP lines
// clang-format off
constexpr RequestRow kRows[] = {
  // --- people. A trainee or a researcher gets only their own data; the handlers check that
  {Call::kListUsers,               "user list",            kStaff,                to<listUsers>,                 Reply::kUsers, kWorkers,
   {{"GET /people?search&role&limit&page", "People, by name"}}},
  // managers: no role above their own
  {Call::kAddUser,                 "user add",             kManagers,             to<addUser, kStores>,          Reply::kDone, kPasswords,
   {{"POST /people", "A new person"}}},
  {Call::kImportPeople,            "user import",          kManagers,             to<importPeople, kStores>,     Reply::kPeopleImport, kSlow,
   {{"POST /people/import", "A class from CSV: name, full_name, role, group, password, code"}}},
  {Call::kGetUser,                 "user show",            kPeople | kResearcher, to<getUser>,                   Reply::kUser, kWorkers,
   {{"GET /people/{name}", "One person"}}},
  // ChangeUser has the same HTTP line; its role is checked afterwards
  {Call::kSetConsent,              "consent",              kPeople,               to<setConsent, kStores>,       Reply::kUser, kWorkers,
   {{"PATCH /people/{name}", "Role, name, access (If-Match); or consent to studies, alone"}}},
  {Call::kChangeUser,              "user change",          kManagers,             to<changeUser, kNeeded>,       Reply::kUser},
  // people: their own; managers: those of lower roles
  {Call::kSetPassword,             "user passwd",          kPeople | kResearcher, to<setPassword, kNeeded>,      Reply::kDone, kPasswords,
   {{"POST /people/{name}/password", "A new password; ends the person's sessions"}}},
  // people: their own; managers: those of the people they manage
  {Call::kSetCode,                 "user code",            kPeople | kResearcher, to<setCode, kStores>,          Reply::kNewCode, kPasswords,
   {{"POST /people/{name}/code", "A code that stations ask for: given, or made, or (empty) removed"}}},
  {Call::kDisableUser,             "user disable",         kManagers,             to<disableUser, kNeeded>,      Reply::kDone},
  {Call::kListConsents,            "consent list",         kPeople,               to<listConsents>,              Reply::kConsents, kWorkers,
   {{"GET /people/{name}/consents", "Every statement of consent to studies"}}},
  // people: their own; managers: everyone's
  {Call::kExportPerson,            "person export",        kPeople,               to<exportPerson, kNeeded>,     Reply::kRecords, kViews,
   {{"GET /people/{name}/export", "Everything that is stored about a person, to download"}}},
  {Call::kErasePerson,             "person erase",         kAdmin,                to<erasePerson, kNeeded>,      Reply::kErasure, kSlow,
   {{"DELETE /people/{name}/data", "Erases a person; confirm must be the name"}}},
  {Call::kListMentions,            "person mentions",      kAdmin,                to<listMentions>,              Reply::kMentions, kViews,
   {{"GET /people/{name}/mentions?text&page", "Texts that people wrote and that name the person"}}},
  {Call::kRedact,                  "person redact",        kAdmin,                to<redact, kStores>,           Reply::kDone, kViews,
   {{"POST /people/{name}/mentions", "Removes the person's names from one of these texts"}}},

  // --- groups
  {Call::kListGroups,              "group list",           kStaff,                to<listGroups>,                Reply::kGroups, kWorkers,
   {{"GET /groups?search&limit&brief&page", "Groups, by id; brief=yes: with the number of members only"}}},
  {Call::kGetGroup,                "group show",           kStaff,                to<getGroup>,                  Reply::kGroup, kWorkers,
   {{"GET /groups/{id}", "One group"}}},
  {Call::kPutGroup,                "group set",            kManagers,             to<putGroup, kStores>,         Reply::kGroup, kWorkers,
   {{"POST /groups", "A new group"},
     {"PUT /groups/{id}", "A group with all its members"}}},
  {Call::kRemoveGroup,             "group remove",         kManagers,             to<removeGroup, kStores>,      Reply::kDone, kWorkers,
   {{"DELETE /groups/{id}", "Removes a group and its assignments"}}},

  // --- stations, and messages to them
  {Call::kListStations,            "station list",         kStaff,                to<listStations>,              Reply::kStations, kWorkers,
   {{"GET /stations?page", "Stations, online or not"}}, ServerPart::kFillStations},
  {Call::kAddStation,              "station add",          kAdmin,                to<addStation, kStores>,       Reply::kStationKey},
  {Call::kRevokeStation,           "station revoke",       kAdmin,                to<revokeStation, kNeeded>,    Reply::kDone},
  {Call::kTraineeMessage,          "message",              kInstructor | kAdmin,  to<traineeMessage, kStores>,   Reply::kDone, kWorkers, {}, ServerPart::kDeliver},
  {Call::kNextExercise,            "next exercise",        kInstructor | kAdmin,  to<nextExercise, kStores>,     Reply::kDone, kWorkers, {}, ServerPart::kDeliver},
  {Call::kSetAids,                 "aids",                 kStaff,                to<setAids, kStores>,          Reply::kDone, kWorkers, {}, ServerPart::kDeliver},
  {Call::kStopLesson,              "stop",                 kStaff,                to<stopLesson, kNeeded>,       Reply::kDone, kWorkers, {}, ServerPart::kDeliver},

  // --- profiles, courses, exercises
  {Call::kListProfiles,            "profile list",         kReaders,              to<listProfiles>,              Reply::kProfiles, kWorkers,
   {{"GET /profiles", "Patient profiles"}}},
  {Call::kGetProfile,              "profile show",         kReaders,              to<getProfile>,                Reply::kProfile, kWorkers,
   {{"GET /profiles/{id}?revision", "A profile; revision: by default the newest"}}},
  {Call::kImportProfile,           "profile import",       kManagers,             to<importProfile, kStores>,    Reply::kProfile, kWorkers,
   {{"PUT /profiles/{id}", "A new revision; If-Match \"0\": a new profile"}}},
  {Call::kListProfileRevisions,    "profile revisions",    kStaff | kResearcher,  to<profileRevisions>,          Reply::kRevisions, kWorkers,
   {{"GET /profiles/{id}/revisions?page", "Revisions of a profile, newest first"}}},
  {Call::kCheckText,               "check text",           kStaff,                to<checkJson>,                 Reply::kTextCheck, kWorkers,
   {{"POST /profiles/check", "Everything that is wrong with a profile"},
     {"POST /courses/check", "What is wrong with a course"}}},
  {Call::kPreviewProfile,          "profile preview",      kStaff,                to<previewProfile>,            Reply::kProfilePreview, kViews,
   {{"POST /profiles/preview?points", "Force over depth, by the engine"}}},
  {Call::kListCurricula,           "curriculum list",      kReaders,              to<listCurricula>,             Reply::kCurricula, kWorkers,
   {{"GET /courses", "Courses"}}},
  {Call::kGetCurriculum,           "curriculum export",    kReaders,              to<getCurriculum>,             Reply::kCurriculum, kWorkers,
   {{"GET /courses/{id}?revision", "A course; revision: by default the newest"}}},
  {Call::kImportCurriculum,        "curriculum import",    kManagers,             to<importCurriculum, kStores>, Reply::kCurriculum, kWorkers,
   {{"PUT /courses/{id}", "A new revision; If-Match \"0\": a new course"}}},
  {Call::kListCurriculumRevisions, "curriculum revisions", kStaff | kResearcher,  to<curriculumRevisions>,       Reply::kRevisions, kWorkers,
   {{"GET /courses/{id}/revisions?page", "Revisions of a course, newest first"}}},
  {Call::kListExercises,           "exercise list",        kReaders,              to<listExercises>,             Reply::kExercises, kWorkers,
   {{"GET /exercises?course&page", "Exercises of a course, or of all"}}},
  {Call::kListMeasures,            "measures",             kReaders,              to<listMeasures>,              Reply::kMeasures, kWorkers,
   {{"GET /measures", "What scores measure"}}},
  {Call::kGetReference,            "reference show",       kPeople,               to<getReference>,              Reply::kReference, kViews,
   {{"GET /exercises/{id}/reference", "Bands of chosen sessions of experts"}}},
  // the reply contains the bands, like that of "reference show"
  {Call::kSetReference,            "reference set",        kStaff,                to<setReference, kStores>,     Reply::kReference, kViews,
   {{"PUT /exercises/{id}/reference", "Chooses the sessions of experts (If-Match)"}}},

  // --- assignments, lessons, results
  {Call::kListAssignments,         "assign list",          kAll,                  to<listAssignments>,           Reply::kAssignments, kWorkers,
   {{"GET /assignments?trainee&course&group&limit&page", "Assignments: who does what, until when"}}},
  {Call::kAssign,                  "assign",               kStaff,                to<assign, kStores>,           Reply::kAssignments, kWorkers,
   {{"POST /assignments", "An exercise or a course for a trainee or a group"}}},
  {Call::kRemoveAssignment,        "assign remove",        kStaff,                to<removeAssignment, kStores>, Reply::kDone, kWorkers,
   {{"DELETE /assignments/{id}", "Removes an assignment"}}},
  {Call::kGetLesson,               "lesson",               kAll,                  to<getLesson>,                 Reply::kLesson},
  {Call::kCheckTrainee,            "check trainee",        kStation,              to<checkTrainee>,              Reply::kTraineeChecked},
  // stations: names, and the cells of the trainee that they name; the handler checks that
  {Call::kGetResults,              "results",              kAll,                  to<getResults>,                Reply::kResults, kViews,
   {{"GET /results?course&group&limit&page", "Trainee by exercise, by name"},
     {"GET /courses/{id}/results.*?group&separator", "A table for a spreadsheet; separator: comma, semicolon (with decimal commas) or tab"}}},
  {Call::kGetProgress,             "progress",             kPeople,               to<getProgress>,               Reply::kProgress, kViews,
   {{"GET /people/{name}/progress?exercise&newest_first&page", "Attempts in order of time; newest_first=yes: of one exercise"}}},
  {Call::kListTried,               "tried",                kPeople,               to<listTried>,                 Reply::kTriedExercises, kWorkers,
   {{"GET /people/{name}/exercises", "Exercises at which there are attempts, the one tried last first"}}},
  {Call::kGetAttempt,              "attempt show",         kPeople,               to<getAttempt>,                Reply::kAttempt, kViews,
   {{"GET /sessions/{id}/attempt", "The session as an attempt: its number, whether it counts"}}},
  {Call::kGetToday,                "today",                kStaff,                to<getToday>,                  Reply::kToday, kViews,
   {{"GET /today?list&limit&page", "What needs attention: numbers, and the rows of one list: due, behind or struggling"}}},
  {Call::kExcuseAttempt,           "attempt excuse",       kStaff,                to<excuseAttempt, kStores>,    Reply::kAttempt, kWorkers,
   {{"POST /sessions/{id}/excuse", "Excuses an attempt: it does not count"}}},

  // --- sessions, recordings, remarks
  {Call::kListSessions,            "session list",         kPeople,               to<listSessions>,              Reply::kSessions, kWorkers,
   {{"GET /sessions?trainee&station&exercise&from_ms&to_ms&verdict&search&limit&page", "Recorded sessions, newest first"},
     {"GET /unknown-trainees?page", "Sessions whose trainee was unknown on arrival; they wait to be assigned"}}},
  {Call::kGetSession,              "session show",         kPeople,               to<getSession>,                Reply::kSession, kWorkers,
   {{"GET /sessions/{id}", "One session"}}},
  {Call::kAssignSession,           "session assign",       kManagers,             to<assignSession, kStores>,    Reply::kSession, kWorkers,
   {{"POST /sessions/{id}/trainee", "Gives a session of an unknown trainee to the right person"}}},
  {Call::kReadChunks,              "session export",       kPeople,               to<readChunks>,                Reply::kChunks, kWorkers,
   {{"GET /sessions/{id}/samples?from_s&to_s&points", "Samples for a plot, decimated"},
     {"GET /sessions/{id}/samples.*?from_s&to_s", "All samples; units in the header"}}},
  {Call::kSeekSession,             "session seek",         kPeople,               to<seekSession>,               Reply::kSought},
  {Call::kVerifySession,           "session verify",       kStaff,                to<verifySession>,             Reply::kVerified, kSlow},
  {Call::kListEvents,              "session events",       kPeople,               to<listEvents>,                Reply::kEvents, kWorkers,
   {{"GET /sessions/{id}/events?page", "Aspirations and injections"}}},
  {Call::kGetSection,              "session section",      kPeople,               to<getSection>,                Reply::kSection, kViews,
   {{"GET /sessions/{id}/section", "The session's body, cut where the needle first came in"}}},
  {Call::kListAnnotations,         "annotate list",        kPeople,               to<listAnnotations>,           Reply::kAnnotations, kWorkers,
   {{"GET /sessions/{id}/annotations?page", "Remarks"}}},
  {Call::kAnnotate,                "annotate",             kInstructor | kAdmin,  to<annotate, kStores>,         Reply::kAnnotation, kWorkers,
   {{"POST /sessions/{id}/annotations", "A remark"}}},

  // --- scores
  {Call::kGetScore,                "score show",           kPeople,               to<getScore>,                  Reply::kScore, kViews,
   {{"GET /sessions/{id}/score?definition_version", "The session's score; definition_version: by default the newest"}}},
  {Call::kRescoreSession,          "rescore",              kStaff,                to<rescore, kStores>,          Reply::kScore, kScores,
   {{"POST /sessions/{id}/rescore", "Scores the session again by the program's present definitions"}}},
  {Call::kListScores,              "score list",           kStaff,                to<listScores>,                Reply::kScores, kViews,
   {{"GET /scores.*?course&group", "Scores, a measure a line; units in a column"}}},
  {Call::kRescoreAll,              "rescore all",          kManagers,             to<rescoreAll, kStores>,       Reply::kRescoreReport, kHours,
   {{"POST /scores/rescore", "All sessions whose newest score is of older definitions"}}},

  // --- studies, and exports of everything
  {Call::kExportStudy,             "study export",         kResearcher | kAdmin,  to<exportStudy, kNeeded>,      Reply::kRecords, kViews,
   {{"GET /studies/{study}?exercise&remarks&page", "Records of those who consent, under pseudonyms"}}},
  {Call::kReadStudyRecording,      "study recording",      kResearcher | kAdmin,  to<readStudyRecording>,        Reply::kChunks, kViews},
  {Call::kExportAll,               "export-all",           kAdmin,                to<exportAll, kNeeded>,        Reply::kRecords},

  // --- the lab
  {Call::kGetLabSettings,          "lab show",             kReaders,              to<getLabSettings>,            Reply::kLabSettings, kWorkers,
   {{"GET /lab/settings", "What holds for the whole lab"}}},
  {Call::kChangeLabSettings,       "lab set",              kAdmin,                to<changeLabSettings, kStores>, Reply::kLabSettings, kWorkers,
   {{"PATCH /lab/settings", "Changes lab settings; omitted ones stay"}}},

  // --- the database itself
  {Call::kListAudit,               "audit",                kAdmin,                to<listAudit>,                 Reply::kAudit, kWorkers,
   {{"GET /audit?who&action&page", "Who changed what; newest first"}}},
  {Call::kBackup,                  "backup",               kAdmin,                to<backup, kNeeded>,           Reply::kBackupDone, kSlow,
   {{"POST /backup", "A verified copy on the server's machine; without a path beside the database"}}},
  {Call::kCheck,                   "check",                kAdmin,                to<check>,                     Reply::kCheckReport, kSlow,
   {{"POST /check", "Checks the database and every recording in it"}}},
  {Call::kListRetention,           "retention show",       kManagers,             to<listRetention>,             Reply::kRetention, kWorkers,
   {{"GET /retention", "What is kept, and for how long"}}},
  {Call::kSetRetention,            "retention set",        kManagers,             to<setRetention, kNeeded>,     Reply::kDone, kWorkers,
   {{"PUT /retention", "Sets the policy of an exercise, or of all; as_default removes the exercise's own"}}},
  {Call::kRunRetention,            "retention run",        kManagers,             to<runRetentionNow, kNeeded>,  Reply::kRetentionReport, kHours,
   {{"POST /retention/run", "Thins and deletes now, or says what it would"}}},
};
// clang-format on

}  // namespace

std::span<const RequestRow> requestRows() {
  return kRows;
}

const RequestRow* requestRow(pb::Request::CallCase call) {
  for (const RequestRow& row : kRows) {
    if (row.call == call) return &row;
  }
  return nullptr;
}

RequestThreads threadsOf(const pb::Request& request, pb::Role role) {
  const bool has_code = !request.get_lesson().code().empty() || !request.check_trainee().code().empty();
  if (has_code && role == pb::STATION) return kPasswords;
  const RequestRow* row = requestRow(request.call_case());
  return row == nullptr ? kWorkers : row->threads;
}

Storing storingOf(pb::Request::CallCase call) {
  const RequestRow* row = requestRow(call);
  return row == nullptr ? kNothing : row->handler.storing;
}

std::string_view callName(pb::Request::CallCase call) {
  const RequestRow* row = requestRow(call);
  return row == nullptr ? "?" : row->action;
}

bool mayAsk(const RequestRow& row, pb::Role role) {
  return role != pb::ROLE_UNSPECIFIED && (row.roles & bit(role)) != 0;
}

Status checkRole(const Principal& principal, pb::Request::CallCase call) {
  const RequestRow* row = requestRow(call);
  if (row == nullptr) {
    return Error{ErrorCode::kInvalidInput,
                 "the request holds no call that this program (needlelab " + programVersion() + ") knows"};
  }
  if (mayAsk(*row, principal.role)) return {};
  std::string who;
  for (int number = pb::Role_MIN; number <= pb::Role_MAX; ++number) {
    const auto role = static_cast<pb::Role>(number);
    if (mayAsk(*row, role)) who += (who.empty() ? "" : ", ") + std::string(roleName(role));
  }
  return Error{ErrorCode::kDenied, fmt::format("'{}' is not for the role {} of '{}', only for: {}",
                                               row->action, roleName(principal.role), principal.name, who)};
}

}  // namespace needlelab
