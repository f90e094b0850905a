#include "db/assignment_store.h"

#include <optional>

#include "db/curriculum_store.h"
#include "db/group_store.h"
#include "db/people_store.h"

namespace needlelab {
namespace {

constexpr std::string_view kAssignment =
    "SELECT id, course_id, exercise_id, group_id, trainee, due_unix_ns, by_whom, created_unix_ns FROM "
    "assignments ";

pb::Assignment assignmentOf(const Statement& row) {
  pb::Assignment found;
  found.set_id(row.natural(0));
  found.set_course_id(row.text(1));
  found.set_exercise_id(row.text(2));
  found.set_group_id(row.text(3));
  found.set_trainee(row.text(4));
  found.set_due_unix_ns(row.integer(5));
  found.set_by(row.text(6));
  found.set_created_unix_ns(row.integer(7));
  return found;
}

Status checkTrainee(Connection& connection, const std::string& name) {
  const auto person = PeopleStore(connection).find(name);
  if (!person) return person.error();
  if (!*person) return Error{ErrorCode::kNotFound, "there is no person named '" + name + "'"};
  if ((*person)->role != pb::TRAINEE)
    return Error{ErrorCode::kInvalidInput, "'" + name + "' is no trainee: exercises are for trainees"};
  return {};
}

}  // namespace

Result<pb::Assignment> AssignmentStore::put(const pb::Assignment& given) {
  if (given.course_id().empty() == given.exercise_id().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of course_id and exercise_id"};
  if (given.group_id().empty() == given.trainee().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of group_id and trainee"};
  if (given.due_unix_ns() < 0)
    return Error{ErrorCode::kInvalidInput, "assignment, due_unix_ns: " + std::to_string(given.due_unix_ns()) +
                                               ", allowed is 0 (never) and above"};
  if (!given.trainee().empty()) {
    if (auto valid = checkTrainee(connection_, given.trainee()); !valid) return valid.error();
  } else if (const auto group = GroupStore(connection_).get(given.group_id()); !group) {
    return group.error();
  }
  if (!given.course_id().empty()) {
    if (const auto course = CurriculumStore(connection_).get(given.course_id()); !course)
      return course.error();
  } else if (const auto exercise = CurriculumStore(connection_).exercise(given.exercise_id()); !exercise) {
    return exercise.error();
  }
  auto known = connection_.query(
      "SELECT id FROM assignments WHERE coalesce(course_id, '') = ? AND coalesce(exercise_id, '') = ?"
      " AND coalesce(group_id, '') = ? AND coalesce(trainee, '') = ?",
      given.course_id(), given.exercise_id(), given.group_id(), given.trainee());
  const auto found = known.step();
  if (!found) return found.error();
  pb::Assignment stored = given;
  if (*found) {
    stored.set_id(known.natural(0));
    auto renew = connection_.query(
        "UPDATE assignments SET by_whom = ?, created_unix_ns = ?, due_unix_ns = nullif(?, 0) WHERE id = ?",
        given.by(), given.created_unix_ns(), given.due_unix_ns(), stored.id());
    if (auto done = renew.run(); !done) return done.error();
    return stored;
  }
  if (auto done = connection_.run(
          "INSERT INTO assignments (course_id, exercise_id, group_id, trainee, due_unix_ns, by_whom,"
          " created_unix_ns) VALUES (nullif(?, ''), nullif(?, ''), nullif(?, ''), nullif(?, ''), nullif(?, "
          "0), ?, ?)",
          given.course_id(), given.exercise_id(), given.group_id(), given.trainee(), given.due_unix_ns(),
          given.by(), given.created_unix_ns());
      !done)
    return done.error();
  stored.set_id(static_cast<std::uint64_t>(connection_.lastRowId()));
  return stored;
}

Result<pb::Assignment> AssignmentStore::remove(std::uint64_t id) {
  std::optional<pb::Assignment> removed;
  {
    auto row = connection_.query(std::string(kAssignment) + "WHERE id = ?", id);
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return Error{ErrorCode::kNotFound, "there is no assignment " + std::to_string(id)};
    removed = assignmentOf(row);
  }
  if (auto done = connection_.run("DELETE FROM assignments WHERE id = ?", id); !done) return done.error();
  return *removed;
}

Result<std::vector<pb::Assignment>> AssignmentStore::list(const Filter& filter) {
  std::vector<pb::Assignment> assignments;
  auto rows = connection_.query(std::string(kAssignment) +
                                    "WHERE (?1 = '' OR trainee = ?1 OR group_id IN (SELECT group_id FROM "
                                    "group_members WHERE person = ?1))"
                                    " AND (?2 = '' OR course_id = ?2 OR exercise_id IN (SELECT id FROM "
                                    "exercises WHERE curriculum_id = ?2))"
                                    " AND (?3 = '' OR group_id = ?3) ORDER BY id DESC",
                                filter.trainee, filter.course_id, filter.group_id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return assignments;
    assignments.push_back(assignmentOf(rows));
  }
}

Result<std::int64_t> AssignmentStore::dueOf(std::string_view trainee, std::string_view exercise_id,
                                            std::string_view course_id, std::int64_t otherwise) {
  // the order of precedence as a number; an assignment without a date of its own says nothing
  auto row = connection_.query(
      "SELECT due_unix_ns FROM assignments WHERE due_unix_ns IS NOT NULL AND (exercise_id = ?2 OR course_id "
      "= ?3) AND"
      " (trainee = ?1 OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))"
      " ORDER BY (trainee IS NULL) * 2 + (exercise_id IS NULL), due_unix_ns DESC LIMIT 1",
      trainee, exercise_id, course_id);
  const auto found = row.step();
  if (!found) return found.error();
  return *found ? row.integer(0) : otherwise;
}

}  // namespace needlelab
