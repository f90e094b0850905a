// The people whose lessons a station may begin, the names that a station may list, and similar names for an
// unknown one.
#include <fmt/core.h>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/text/text.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/standing.h"
#include "db/store/connection.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempt_sums.h"
#include "db/teaching/documents.h"

namespace needlelab {
namespace {

/// The people who may practise, whether or not something is assigned to them.
Result<std::vector<KnownName>> listedPeople(Connection& reader) {
  std::vector<KnownName> people;
  ASSIGN_OR_RETURN(auto all, PeopleStore(reader).list());
  for (Person& person : all) {
    ASSIGN_OR_RETURN(const bool known, stationMayKnow(reader, person, person.ref));
    if (known) people.push_back({person.name, std::move(person.full_name)});
  }
  return people;
}

/// "'tom' (Tom Smith), 'tim' or 'kim'"
std::string orList(const std::vector<KnownName>& people) {
  std::string text;
  for (std::size_t i = 0; i < people.size(); ++i) {
    if (i > 0) text += i + 1 == people.size() ? " or " : ", ";
    text += "'" + people[i].name + "'";
    if (!people[i].full_name.empty()) text += " (" + printable(people[i].full_name) + ")";
  }
  return text;
}

}  // namespace

Result<bool> stationMayKnow(Connection& reader, const std::optional<Person>& person,
                            const std::string& name) {
  if (!person) return name == kGuestName;
  if (person->disabled) return false;
  if (person->role == pb::TRAINEE) return true;
  ASSIGN_OR_RETURN(const auto assigned, AssignmentStore(reader).list({.trainee = name, .most = 1}));
  return !assigned.empty();
}

Status mayPractise(Connection& reader, const std::string& name, pb::Role asked_by) {
  if (name.empty()) return {};
  ASSIGN_OR_RETURN(const auto person, PeopleStore(reader).find(name));
  if (asked_by != pb::STATION) {
    if (person && person->disabled)
      return Error{ErrorCode::kDenied, "'" + printable(name) + "' is disabled: ask an administrator"};
    return {};
  }
  ASSIGN_OR_RETURN(const bool known, stationMayKnow(reader, person, name));
  if (known) return {};
  // the same answer for unknown names, for staff, and for people whose access has ended
  RETURN_IF_ERROR(checkName("trainee", name));
  ASSIGN_OR_RETURN(const auto people, listedPeople(reader));
  // an account whose access has ended looks like an unknown name
  ASSIGN_OR_RETURN(const auto typed, shownName(reader, name));
  const auto near = nearNames(typed, people);
  return Error{
      ErrorCode::kNotFound,
      fmt::format("the server knows no one named '{}' who may practise. {}Give the name of a trainee's "
                  "account, practise as '{}', or ask a manager to add this person; staff practise as members "
                  "of a group with an assignment",
                  printable(name), near.empty() ? "" : "Did you mean " + orList(near) + "? ", kGuestName)};
}

Result<bool> seesCourse(Connection& reader, const StoredCurriculum& course, const std::string& name,
                        pb::Role asked_by) {
  // a course's rules are the same in each of its exercises
  const bool for_all = course.exercises.empty() || !course.exercises.front().rules.assigned_only;
  if (for_all || asked_by != pb::TRAINEE) return true;
  return AssignmentStore(reader).isAssignedOf(name, course.id);
}

Status requireVisible(Connection& reader, const StoredCurriculum& course, const std::string& name,
                      pb::Role asked_by) {
  ASSIGN_OR_RETURN(const bool seen, seesCourse(reader, course, name, asked_by));
  if (seen) return {};
  return Error{ErrorCode::kNotFound, "there is no curriculum '" + course.id + "'"};
}

Status mayBegin(Connection& reader, const StoredExercise& exercise, const std::string& name,
                pb::Role asked_by) {
  if (!exercise.rules.assigned_only || name.empty()) return {};
  ASSIGN_OR_RETURN(const bool assigned,
                   AssignmentStore(reader).isAssigned(name, exercise.id, exercise.curriculum_id));
  if (assigned) return {};
  if (asked_by == pb::TRAINEE)
    return Error{ErrorCode::kNotFound, "there is no exercise '" + exercise.id + "'"};
  return Error{ErrorCode::kDenied,
               "\"" + exercise.name + "\" is only for those to whom it is assigned; ask your instructor"};
}

namespace handlers {

Result<pb::Reply> checkTrainee(const Context& context, const pb::CheckTrainee& call) {
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  RETURN_IF_ERROR(mayPractise(context.reader, call.trainee(), context.who.role));
  ASSIGN_OR_RETURN(const bool code_checked, checkCodeOf(context, call.trainee(), call.code()));
  pb::Reply reply;
  reply.mutable_trainee_checked()->set_code_checked(code_checked);
  ASSIGN_OR_RETURN(const auto person, outerRef(context.reader, call.trainee()));
  reply.mutable_trainee_checked()->set_person_ref(person.value_or(""));
  return reply;
}

}  // namespace handlers
}  // namespace needlelab
