#include "db/teaching/assignments.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>

#include "db/people/look_alikes.h"
#include "db/people/people.h"
#include "db/store/rows.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxDatesKept = 1 << 20;  // of groups; 16 bytes each

constexpr std::string_view kAssignment =
    "SELECT id, course_id, exercise_id, group_id, trainee, due_unix_ns, by_whom,"
    " created_unix_ns, coalesce((SELECT g.name FROM groups g WHERE g.id = group_id), '') FROM assignments ";

pb::Assignment assignmentOf(const Statement& row) {
  pb::Assignment found;
  found.set_id(row.natural(0));
  found.set_course_id(row.text(1));
  found.set_exercise_id(row.text(2));
  found.set_group_id(row.text(3));
  found.set_trainee(row.text(4));
  found.set_trainee_full_name(row.text(4));
  found.set_due_unix_ns(row.integer(5));
  found.set_by(row.text(6));
  found.set_created_unix_ns(row.integer(7));
  found.set_group_name(row.text(8));
  return found;
}

Status checkTrainee(Connection& connection, const std::string& name) {
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(name));
  if (!person) return Error{ErrorCode::kNotFound, "there is no person named '" + name + "'"};
  if (person->role != pb::TRAINEE)
    return Error{ErrorCode::kInvalidInput, "'" + name + "' is not a trainee: exercises are for trainees"};
  return {};
}

}  // namespace

Result<pb::Assignment> AssignmentStore::put(const pb::Assignment& given) {
  if (given.course_id().empty() == given.exercise_id().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of course_id and exercise_id"};
  if (given.group_id().empty() == given.trainee().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of group_id and trainee"};
  if (given.due_unix_ns() < 0)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("assignment, due_unix_ns: {}, allowed is 0 (never) and above", given.due_unix_ns())};
  if (!given.trainee().empty()) {
    RETURN_IF_ERROR(checkTrainee(connection_, given.trainee()));
  } else {
    RETURN_IF_ERROR(requireThing(connection_, Thing::kGroup, given.group_id()));
  }
  if (!given.course_id().empty()) {
    RETURN_IF_ERROR(requireThing(connection_, Thing::kCourse, given.course_id()));
  } else {
    RETURN_IF_ERROR(requireThing(connection_, Thing::kExercise, given.exercise_id()));
  }
  auto known = connection_.query(
      "SELECT id FROM assignments WHERE coalesce(course_id, '') = ?"
      " AND coalesce(exercise_id, '') = ? AND coalesce(group_id, '') = ?"
      " AND coalesce(trainee, '') = ?",
      given.course_id(), given.exercise_id(), given.group_id(), given.trainee());
  ASSIGN_OR_RETURN(const bool found, known.step());
  pb::Assignment stored = given;
  if (found) {
    stored.set_id(known.natural(0));
    auto renew = connection_.query(
        "UPDATE assignments SET by_whom = ?, created_unix_ns = ?, due_unix_ns = nullif(?, 0) WHERE id = ?",
        given.by(), given.created_unix_ns(), given.due_unix_ns(), stored.id());
    RETURN_IF_ERROR(renew.run());
    return stored;
  }
  ASSIGN_OR_RETURN(
      const auto id,
      connection_.insert("INSERT INTO assignments (course_id, exercise_id, group_id, trainee,"
                         " due_unix_ns, by_whom, created_unix_ns)"
                         " VALUES (nullif(?, ''), nullif(?, ''), nullif(?, ''), nullif(?, ''),"
                         " nullif(?, 0), ?, ?) RETURNING id",
                         given.course_id(), given.exercise_id(), given.group_id(), given.trainee(),
                         given.due_unix_ns(), given.by(), given.created_unix_ns()));
  stored.set_id(static_cast<std::uint64_t>(id));
  return stored;
}

Result<pb::Assignment> AssignmentStore::remove(std::uint64_t id) {
  ASSIGN_OR_RETURN(const auto removed,
                   connection_.query(std::string(kAssignment) + "WHERE id = ?", id).first(assignmentOf));
  if (!removed) return Error{ErrorCode::kNotFound, fmt::format("there is no assignment {}", id)};
  RETURN_IF_ERROR(connection_.run("DELETE FROM assignments WHERE id = ?", id));
  return *removed;
}

Result<std::vector<pb::Assignment>> AssignmentStore::list(const Filter& filter) {
  return connection_
      .query(std::string(kAssignment) +
                 "WHERE (?1 = '' OR trainee = ?1 OR group_id IN (SELECT group_id"
                 " FROM group_members WHERE person = ?1)) AND (?2 = ''"
                 " OR course_id = ?2 OR exercise_id IN (SELECT id FROM exercises"
                 " WHERE curriculum_id = ?2)) AND (?3 = '' OR group_id = ?3)"
                 " AND id < ?4 ORDER BY id DESC LIMIT ?5",
             filter.trainee, filter.course_id, filter.group_id,
             filter.below == 0 ? std::uint64_t{INT64_MAX} : filter.below,
             filter.most == 0 ? std::uint64_t{INT64_MAX} : filter.most)
      .all(assignmentOf);
}

namespace {

/// Assignments of trainee ?1.
constexpr std::string_view kOfTrainee =
    "(trainee = ?1 OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))";

Result<bool> isFound(Result<std::optional<std::int64_t>> found) {
  if (!found) return found.error();
  return found->has_value();
}

std::int64_t firstInteger(const Statement& row) {
  return row.integer(0);
}

}  // namespace

Result<bool> AssignmentStore::isAssigned(std::string_view trainee, std::string_view exercise_id,
                                         std::string_view course_id) {
  return isFound(connection_
                     .query(fmt::format("SELECT 1 FROM assignments WHERE {} AND (exercise_id = ?2"
                                        " OR course_id = ?3) LIMIT 1",
                                        kOfTrainee),
                            trainee, exercise_id, course_id)
                     .first(firstInteger));
}

Result<bool> AssignmentStore::isAssignedOf(std::string_view trainee, std::string_view course_id) {
  return isFound(
      connection_
          .query(fmt::format("SELECT 1 FROM assignments WHERE {} AND (course_id = ?2 OR exercise_id IN"
                             " (SELECT id FROM exercises WHERE curriculum_id = ?2)) LIMIT 1",
                             kOfTrainee),
                 trainee, course_id)
          .first(firstInteger));
}

Result<std::int64_t> AssignmentStore::dueOf(std::string_view trainee, std::string_view exercise_id,
                                            std::string_view course_id, std::int64_t otherwise) {
  // the same conditions as the index assignments_once, so that no other assignments are read
  ASSIGN_OR_RETURN(
      const auto due,
      connection_
          .query("SELECT due_unix_ns FROM assignments WHERE coalesce(course_id, '') IN ('', ?3)"
                 " AND coalesce(exercise_id, '') IN ('', ?2) AND due_unix_ns IS NOT NULL"
                 " AND (trainee = ?1 OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))"
                 " ORDER BY CASE WHEN trainee IS NULL THEN 1 ELSE 0 END,"
                 " CASE WHEN exercise_id IS NULL THEN 1 ELSE 0 END, due_unix_ns DESC LIMIT 1",
                 trainee, exercise_id, course_id)
          .first([](const Statement& row) { return row.integer(0); }));
  return due.value_or(otherwise);
}

CourseDates::CourseDates(Connection& connection, std::string course_id,
                         const std::vector<std::string>& exercise_ids)
    : connection_(connection), course_id_(std::move(course_id)) {
  for (std::size_t i = 0; i < exercise_ids.size(); ++i) places_.emplace(exercise_ids[i], i);
}

Result<std::map<std::string, CourseDates::Dates>> CourseDates::datesWhere(
    std::string_view whose, std::span<const std::string> names) {
  std::map<std::string, Dates> all;
  for (const std::string& name : names) all.emplace(name, Dates());
  Statement row = connection_.query(
      fmt::format("SELECT exercise_id, due_unix_ns, {0} FROM assignments WHERE due_unix_ns IS NOT NULL"
                  " AND (course_id = ?1 OR EXISTS (SELECT 1 FROM exercises e WHERE e.id = exercise_id"
                  " AND e.curriculum_id = ?1)) AND {0}{1}",
                  whose, amongTexts(connection_, 2)),
      course_id_);
  bindTexts(connection_, row, names);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, row.step());
    if (!more) return all;
    ++read_;
    Dates& dates = all[row.text(2)];
    if (row.isNull(0)) {
      dates.course_ns = std::max(dates.course_ns, row.integer(1));
    } else if (const auto place = places_.find(row.text(0)); place != places_.end()) {
      dates.exercises_ns.emplace_back(place->second, row.integer(1));
    }
  }
}

Status CourseDates::readFor(std::span<const std::string> trainees) {
  ASSIGN_OR_RETURN(own_, datesWhere("trainee", trainees));
  ASSIGN_OR_RETURN(groups_of_, GroupStore(connection_).groupsOfMany(trainees));
  if (kept_ > kMaxDatesKept) {
    groups_.clear();
    kept_ = 0;
  }
  std::set<std::string> unread;
  for (const auto& [trainee, groups] : groups_of_)
    for (const std::string& group : groups)
      if (!groups_.contains(group)) unread.insert(group);
  if (unread.empty()) return {};
  const std::vector<std::string> ids(unread.begin(), unread.end());
  ASSIGN_OR_RETURN(auto dates, datesWhere("group_id", ids));
  for (const auto& [group, some] : dates) kept_ += some.exercises_ns.size();
  groups_.merge(dates);
  return {};
}

Result<std::vector<std::int64_t>> CourseDates::of(const std::string& trainee) {
  if (!own_.contains(trainee)) RETURN_IF_ERROR(readFor(std::span(&trainee, 1)));
  const Dates& own = own_[trainee];
  std::vector<std::int64_t> dates(places_.size());
  const auto addLatest = [&](const Dates& some) {
    for (const auto& [place, due_ns] : some.exercises_ns) dates[place] = std::max(dates[place], due_ns);
  };
  // lowest precedence first: later values override
  std::int64_t of_course_ns = 0;
  for (const std::string& group : groups_of_[trainee]) {
    const Dates& some = groups_[group];
    of_course_ns = std::max(of_course_ns, some.course_ns);
    addLatest(some);
  }
  for (std::int64_t& date : dates) {
    if (own.course_ns != 0) {
      date = own.course_ns;
    } else if (date == 0) {
      date = of_course_ns;
    }
  }
  for (const auto& [place, due_ns] : own.exercises_ns) dates[place] = 0;
  addLatest(own);
  return dates;
}

}  // namespace needlelab
