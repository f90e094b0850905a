#include "db/service/context/logins.h"

#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"

namespace needlelab {
namespace {

/// One text for every reason, so that an attacker cannot find valid names.
Error loginRefused() {
  return {ErrorCode::kDenied, "name or password (for a station: key) is wrong, or access was withdrawn"};
}

}  // namespace

Result<Principal> Logins::loginPerson(const std::string& user, const std::string& password) {
  std::optional<Person> person;
  std::optional<std::int64_t> number;
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    ASSIGN_OR_RETURN(const auto ref, findPerson(*reader, user));
    // read before the account: after a change in between the number is outdated, but not the account
    ASSIGN_OR_RETURN(number, numberNow(*reader, AccessKind::kPerson, ref.value_or("")));
    ASSIGN_OR_RETURN(auto found, PeopleStore(*reader).find(ref.value_or("")));
    person = std::move(found);
  }
  // also for unknown names, so that the time is the same
  ASSIGN_OR_RETURN(const bool right,
                   verifyPassword(person ? person->password_hash : std::string(), password));
  if (!right || !person || person->disabled) return loginRefused();
  return Principal{person->ref, person->role, true, number, person->name};
}

Result<std::optional<Principal>> Logins::principalOf(const std::string& name) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto person, PeopleStore(*reader).findNamed(name));
  if (!person) return std::optional<Principal>();
  return std::optional(Principal{person->ref, person->role, true, {}, person->name});
}

Result<Principal> Logins::loginStation(const std::string& station, const std::string& key) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto number, numberNow(*reader, AccessKind::kStation, station));
  ASSIGN_OR_RETURN(const auto right, StationStore(*reader).checkKey(station, key));
  if (!right) return loginRefused();
  return Principal{station, pb::STATION, true, number};
}

Result<std::optional<std::int64_t>> Logins::numberNow(Connection& reader, AccessKind what,
                                                      const std::string& name) const {
  if (!is_numbered_) return std::optional<std::int64_t>();
  ASSIGN_OR_RETURN(const std::int64_t number, AccessNumberStore(reader).of(what, name));
  return std::optional(number);
}

Result<bool> Logins::isKnownStation(const std::string& name) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto found, StationStore(*reader).find(name));
  return found.has_value();
}

Result<bool> Logins::stillAllowed(const Principal& principal) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return isAccessValid(*reader, principal);
}

Result<std::vector<bool>> Logins::stillAllowed(const std::vector<Principal>& all) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return areAccessesValid(*reader, all);
}

}  // namespace needlelab
