#include "db/service/context/principal.h"

#include <map>

#include "db/login/access_numbers.h"
#include "db/login/credentials.h"
#include "db/people/people.h"

namespace needlelab {
namespace {

struct RoleName {
  pb::Role role;
  std::string_view name;
};
constexpr RoleName kRoleNames[] = {
    {pb::TRAINEE, "trainee"},
    {pb::INSTRUCTOR, "instructor"},
    {pb::CURRICULUM_MANAGER, "curriculum-manager"},
    {pb::ADMINISTRATOR, "administrator"},
    {pb::STATION, "station"},
    {pb::RESEARCHER, "researcher"},
};

/// Whether the account still has the access number that `who` logged in with, if numbers are compared.
Result<bool> hasNumber(Connection& connection, AccessKind what, const Principal& who) {
  if (!who.access_number) return true;
  ASSIGN_OR_RETURN(const std::int64_t number, AccessNumberStore(connection).of(what, who.name));
  return number == *who.access_number;
}

}  // namespace

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

Result<bool> isAccessValid(Connection& connection, const Principal& who) {
  if (who.role == pb::STATION) {
    ASSIGN_OR_RETURN(const auto station, StationStore(connection).find(who.name));
    if (!station || station->revoked) return false;
    return hasNumber(connection, AccessKind::kStation, who);
  }
  ASSIGN_OR_RETURN(const bool is_unchanged, hasNumber(connection, AccessKind::kPerson, who));
  if (!is_unchanged) return false;
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(who.name));
  return person && !person->disabled && person->role == who.role;
}

Result<std::vector<bool>> areAccessesValid(Connection& connection, std::span<const Principal> all) {
  std::vector<std::string> people, stations;
  for (const Principal& who : all) (who.role == pb::STATION ? stations : people).push_back(who.name);
  ASSIGN_OR_RETURN(const auto view, Transaction::view(connection));
  ASSIGN_OR_RETURN(const auto accounts, PeopleStore(connection).findAll(people));
  ASSIGN_OR_RETURN(const auto of_people,
                   AccessNumberStore(connection).numbersOf(AccessKind::kPerson, people));
  ASSIGN_OR_RETURN(const auto of_stations,
                   AccessNumberStore(connection).numbersOf(AccessKind::kStation, stations));
  std::map<std::string, bool> in_use;
  if (!stations.empty()) {
    ASSIGN_OR_RETURN(const auto known, StationStore(connection).list());
    for (const Station& station : known) in_use[station.name] = !station.revoked;
  }
  std::vector<bool> hold;
  for (const Principal& who : all) {
    const bool is_station = who.role == pb::STATION;
    const auto& numbers = is_station ? of_stations : of_people;
    const auto number = numbers.find(who.name);
    const bool is_unchanged =
        !who.access_number || *who.access_number == (number == numbers.end() ? 0 : number->second);
    const auto person = accounts.find(who.name);
    const auto station = in_use.find(who.name);
    hold.push_back(is_unchanged && (is_station ? station != in_use.end() && station->second
                                               : person != accounts.end() && !person->second.disabled &&
                                                     person->second.role == who.role));
  }
  return hold;
}

Status checkAccess(Connection& connection, const Principal& who) {
  if (!who.logged_in) return {};
  ASSIGN_OR_RETURN(const bool holds, isAccessValid(connection, who));
  if (holds) return {};
  return Error{ErrorCode::kDenied,
               who.name + ": access was withdrawn, or the role was changed: log in again"};
}

}  // namespace needlelab
