#include "db/service/roles.h"

#include <array>

namespace needlelab {
namespace {

using Request = pb::Request;

constexpr unsigned bit(pb::Role role) {
  // proto3 keeps numbers that are no role: they have no bit
  return role >= pb::Role_MIN && role <= pb::Role_MAX ? 1u << role : 0u;
}
constexpr unsigned kTrainee =
    bit(pb::TRAINEE);  // where it is listed: its own data only, the handlers see to that
constexpr unsigned kInstructor = bit(pb::INSTRUCTOR);
constexpr unsigned kManager = bit(pb::CURRICULUM_MANAGER);
constexpr unsigned kAdmin = bit(pb::ADMINISTRATOR);
constexpr unsigned kStation = bit(pb::STATION);
constexpr unsigned kResearcher = bit(pb::RESEARCHER);
constexpr unsigned kStaff = kInstructor | kManager | kAdmin;
constexpr unsigned kPeople = kStaff | kTrainee;
constexpr unsigned kAll = kPeople | kStation;
constexpr unsigned kReaders = kAll | kResearcher;  // of what names nobody
constexpr unsigned kManagers = kManager | kAdmin;

struct Rule {
  Request::CallCase call;
  std::string_view name;
  unsigned roles;
};

constexpr std::array kRules = {
    Rule{Request::kAddUser, "user add",
         kManagers},  // a manager: nobody above itself; the handlers see to that
    Rule{Request::kSetPassword, "user passwd", kPeople | kResearcher},  // one's own; managers: below them
    Rule{Request::kDisableUser, "user disable", kManagers},
    Rule{Request::kListUsers, "user list", kStaff},
    Rule{Request::kAddStation, "station add", kAdmin},
    Rule{Request::kRevokeStation, "station revoke", kAdmin},
    Rule{Request::kListStations, "station list", kStaff},
    Rule{Request::kImportProfile, "profile import", kManager | kAdmin},
    Rule{Request::kGetProfile, "profile show", kReaders},
    Rule{Request::kListProfiles, "profile list", kReaders},
    Rule{Request::kImportCurriculum, "curriculum import", kManager | kAdmin},
    Rule{Request::kGetCurriculum, "curriculum export", kReaders},
    Rule{Request::kListCurricula, "curriculum list", kReaders},
    Rule{Request::kAssign, "assign", kStaff},
    Rule{Request::kListAssignments, "assign list", kAll},
    Rule{Request::kGetLesson, "lesson", kAll},
    Rule{Request::kListSessions, "session list", kPeople},
    Rule{Request::kGetSession, "session show", kPeople},
    Rule{Request::kReadChunks, "session export", kPeople},
    Rule{Request::kVerifySession, "session verify", kStaff},
    Rule{Request::kListEvents, "session events", kPeople},
    Rule{Request::kSeekSession, "session seek", kPeople},
    Rule{Request::kAnnotate, "annotate", kInstructor | kAdmin},
    Rule{Request::kListAnnotations, "annotate list", kPeople},
    Rule{Request::kBackup, "backup", kAdmin},
    Rule{Request::kCheck, "check", kAdmin},
    Rule{Request::kListAudit, "audit", kAdmin},
    Rule{Request::kListRetention, "retention show", kManager | kAdmin},
    Rule{Request::kSetRetention, "retention set", kManager | kAdmin},
    Rule{Request::kRunRetention, "retention run", kManager | kAdmin},
    Rule{Request::kTraineeMessage, "message", kInstructor | kAdmin},
    Rule{Request::kNextExercise, "next exercise", kInstructor | kAdmin},
    Rule{Request::kSetAids, "aids", kStaff},
    Rule{Request::kStopLesson, "stop", kStaff},
    Rule{Request::kGetUser, "user show", kPeople | kResearcher},  // a trainee, a researcher: its own
    Rule{Request::kChangeUser, "user change", kManagers},
    Rule{Request::kSetConsent, "consent", kPeople},
    Rule{Request::kListConsents, "consent list", kPeople},
    Rule{Request::kImportPeople, "user import", kManagers},
    Rule{Request::kExportPerson, "person export", kPeople},  // one's own; managers: anybody's
    Rule{Request::kErasePerson, "person erase", kAdmin},
    Rule{Request::kPutGroup, "group set", kManagers},
    Rule{Request::kGetGroup, "group show", kStaff},
    Rule{Request::kListGroups, "group list", kStaff},
    Rule{Request::kRemoveGroup, "group remove", kManagers},
    Rule{Request::kListProfileRevisions, "profile revisions", kStaff | kResearcher},
    Rule{Request::kListCurriculumRevisions, "curriculum revisions", kStaff | kResearcher},
    Rule{Request::kCheckText, "check text", kStaff},
    Rule{Request::kPreviewProfile, "profile preview", kStaff},
    Rule{Request::kListExercises, "exercise list", kReaders},
    Rule{Request::kListMeasures, "measures", kReaders},
    Rule{Request::kRemoveAssignment, "assign remove", kStaff},
    Rule{Request::kGetResults, "results", kPeople},
    Rule{Request::kGetProgress, "progress", kPeople},
    Rule{Request::kExcuseAttempt, "attempt excuse", kStaff},
    Rule{Request::kGetScore, "score show", kPeople},
    Rule{Request::kRescoreSession, "rescore", kStaff},
    Rule{Request::kRescoreAll, "rescore all", kManagers},
    Rule{Request::kListScores, "score list", kStaff},
    Rule{Request::kSetReference, "reference set", kStaff},
    Rule{Request::kGetReference, "reference show", kPeople},
    Rule{Request::kExportStudy, "study export", kResearcher | kAdmin},
    Rule{Request::kReadStudyRecording, "study recording", kResearcher | kAdmin},
    Rule{Request::kExportAll, "export-all", kAdmin},
    Rule{Request::kImportAll, "import-all", kAdmin},
};

struct RoleName {
  pb::Role role;
  std::string_view name;
};
constexpr std::array kRoleNames = {
    RoleName{pb::TRAINEE, "trainee"},
    RoleName{pb::INSTRUCTOR, "instructor"},
    RoleName{pb::CURRICULUM_MANAGER, "curriculum-manager"},
    RoleName{pb::ADMINISTRATOR, "administrator"},
    RoleName{pb::STATION, "station"},
    RoleName{pb::RESEARCHER, "researcher"},
};

const Rule* ruleOf(Request::CallCase call) {
  for (const Rule& rule : kRules) {
    if (rule.call == call) return &rule;
  }
  return nullptr;
}

}  // namespace

std::string_view callName(Request::CallCase call) {
  const Rule* rule = ruleOf(call);
  return rule == nullptr ? "?" : rule->name;
}

Status checkRole(const Principal& principal, Request::CallCase call) {
  const Rule* rule = ruleOf(call);
  if (rule == nullptr) {
    return Error{ErrorCode::kInvalidInput,
                 "the request holds no call that this program (needlelab " NEEDLELAB_VERSION ") knows"};
  }
  if (principal.role > pb::ROLE_UNSPECIFIED && principal.role <= pb::Role_MAX &&
      (rule->roles & bit(principal.role)) != 0) {
    return {};
  }
  std::string who;
  for (const RoleName& entry : kRoleNames) {
    if ((rule->roles & bit(entry.role)) != 0) who += (who.empty() ? "" : ", ") + std::string(entry.name);
  }
  return Error{ErrorCode::kDenied, "'" + std::string(rule->name) + "' is not for the role " +
                                       std::string(roleName(principal.role)) + " of '" + principal.name +
                                       "', only for: " + who};
}

std::string_view roleName(pb::Role role) {
  for (const RoleName& entry : kRoleNames) {
    if (entry.role == role) return entry.name;
  }
  return "(none)";
}

pb::Role roleOfName(std::string_view name) {
  for (const RoleName& entry : kRoleNames) {
    if (entry.name == name) return entry.role;
  }
  return pb::ROLE_UNSPECIFIED;
}

}  // namespace needlelab
