#include "service/roles.h"

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
constexpr unsigned kStaff = kInstructor | kManager | kAdmin;
constexpr unsigned kPeople = kStaff | kTrainee;
constexpr unsigned kAll = kPeople | kStation;

struct Rule {
  Request::CallCase call;
  std::string_view name;
  unsigned roles;
};

constexpr std::array kRules = {
    Rule{Request::kAddUser, "user add", kAdmin},
    Rule{Request::kSetPassword, "user passwd", kPeople},  // one's own; an administrator: anybody's
    Rule{Request::kDisableUser, "user disable", kAdmin},
    Rule{Request::kListUsers, "user list", kStaff},
    Rule{Request::kAddStation, "station add", kAdmin},
    Rule{Request::kRevokeStation, "station revoke", kAdmin},
    Rule{Request::kListStations, "station list", kStaff},
    Rule{Request::kImportProfile, "profile import", kManager | kAdmin},
    Rule{Request::kGetProfile, "profile show", kAll},
    Rule{Request::kListProfiles, "profile list", kAll},
    Rule{Request::kImportCurriculum, "curriculum import", kManager | kAdmin},
    Rule{Request::kGetCurriculum, "curriculum export", kAll},
    Rule{Request::kListCurricula, "curriculum list", kAll},
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
  if (principal.role > pb::ROLE_UNSPECIFIED && principal.role <= pb::STATION &&
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
