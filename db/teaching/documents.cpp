#include "db/teaching/documents.h"

#include <fmt/core.h>

#include <map>

#include "common/base/text/text.h"
#include "db/people/look_alikes.h"
#include "db/store/rows.h"
#include "db/teaching/attempts.h"

namespace needlelab {
namespace {

constexpr std::string_view kExercise =
    "SELECT id, curriculum_id, name, profile_id, json, assigned_only, exam_attempts, results_from_unix_ns"
    " FROM exercises ";

CourseRules rulesAt(const Statement& row, int first) {
  CourseRules rules{row.integer(first) != 0, std::nullopt, row.integer(first + 2)};
  if (!row.isNull(first + 1)) rules.exam_attempts = row.natural32(first + 1);
  return rules;
}

StoredExercise exerciseOf(const Statement& row) {
  return {row.text(0), row.text(1), row.text(2), row.text(3), row.text(4), rulesAt(row, 5)};
}

}  // namespace

Result<std::uint32_t> ProfileStore::put(const StoredProfile& profile, std::optional<std::uint32_t> base) {
  for (const Status& valid :
       {checkName("profile id", profile.id), checkNewText("profile name", profile.name, 1, 200),
        checkNote("profile '" + profile.id + "'", profile.json, 2, kMaxJsonBytes)}) {
    if (!valid) return valid.error();
  }
  NewestRevision before;
  const auto stored = get(profile.id, 0);
  if (stored) {
    before = {stored->revision, stored->author, stored->created_unix_ns};
  } else if (stored.error().code != ErrorCode::kNotFound) {
    return stored.error();
  } else {
    RETURN_IF_ERROR(checkVisible("profile id", profile.id));
  }
  if (!stored || stored->name != profile.name)
    RETURN_IF_ERROR(checkNewNames(connection_, Thing::kProfile, profile.id, profile.name));
  RETURN_IF_ERROR(checkBase("profile '" + profile.id + "'", base, before));
  if (stored && stored->json == profile.json) return stored->revision;
  const std::uint32_t newest = before.revision;
  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO profiles (id, revision, name, json, author, created_unix_ns) VALUES (?,?,?,?,?,?)",
      profile.id, newest + 1, profile.name, profile.json, profile.author, profile.created_unix_ns));
  return newest + 1;
}

Result<StoredProfile> ProfileStore::get(std::string_view id, std::uint32_t revision) {
  auto row = connection_.query(
      "SELECT id, revision, name, json, author, created_unix_ns FROM profiles"
      " WHERE id = ?1 AND (?2 = 0 OR revision = ?2) ORDER BY revision DESC LIMIT 1",
      id, revision);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) {
    return Error{ErrorCode::kNotFound, "there is no profile '" + std::string(id) + "'" +
                                           (revision == 0 ? "" : fmt::format(" of revision {}", revision))};
  }
  return StoredProfile{row.text(0), row.natural32(1), row.text(2), row.text(3), row.text(4), row.integer(5)};
}

Result<std::vector<StoredProfile>> ProfileStore::list() {
  return connection_
      .prepare(
          "SELECT id, revision, name, author, created_unix_ns FROM profiles AS p"
          " WHERE revision = (SELECT max(revision) FROM profiles WHERE id = p.id)"
          " ORDER BY id")
      .all([](const Statement& row) {
        return StoredProfile{row.text(0), row.natural32(1), row.text(2), "", row.text(3), row.integer(4)};
      });
}

Result<std::vector<StoredProfile>> ProfileStore::revisions(std::string_view id) {
  ASSIGN_OR_RETURN(auto found, connection_
                                   .query("SELECT revision, name, author, created_unix_ns FROM profiles"
                                          " WHERE id = ? ORDER BY revision DESC",
                                          id)
                                   .all([&](const Statement& row) {
                                     return StoredProfile{std::string(id), row.natural32(0), row.text(1), "",
                                                          row.text(2),     row.integer(3)};
                                   }));
  if (found.empty()) return Error{ErrorCode::kNotFound, "there is no profile '" + std::string(id) + "'"};
  return found;
}

Result<std::uint32_t> CurriculumStore::put(const StoredCurriculum& curriculum,
                                           std::optional<std::uint32_t> base) {
  for (const Status& valid :
       {checkName("curriculum id", curriculum.id), checkNewText("curriculum name", curriculum.name, 1, 200),
        checkNote("curriculum '" + curriculum.id + "'", curriculum.json, 2, kMaxJsonBytes)}) {
    if (!valid) return valid.error();
  }
  for (const StoredExercise& item : curriculum.exercises) {
    const std::string field = "curriculum '" + curriculum.id + "', exercise '" + item.id + "'";
    RETURN_IF_ERROR(checkVisible(field + ", id", item.id));
    RETURN_IF_ERROR(checkVisible(field + ", name", item.name));
  }
  NewestRevision before;
  const auto stored = get(curriculum.id, 0);
  if (stored) {
    before = {stored->revision, stored->author, stored->created_unix_ns};
  } else if (stored.error().code != ErrorCode::kNotFound) {
    return stored.error();
  } else {
    RETURN_IF_ERROR(checkVisible("curriculum id", curriculum.id));
  }
  if (!stored || stored->name != curriculum.name)
    RETURN_IF_ERROR(checkNewNames(connection_, Thing::kCourse, curriculum.id, curriculum.name));
  RETURN_IF_ERROR(checkBase("course '" + curriculum.id + "'", base, before));
  if (stored && stored->json == curriculum.json) return stored->revision;
  const std::uint32_t newest = before.revision;
  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO curricula (id, revision, name, json, author, created_unix_ns) VALUES (?,?,?,?,?,?)",
      curriculum.id, newest + 1, curriculum.name, curriculum.json, curriculum.author,
      curriculum.created_unix_ns));

  RETURN_IF_ERROR(setExercises(curriculum));
  return newest + 1;
}

Status CurriculumStore::setExercises(const StoredCurriculum& curriculum) {
  // the exercises replace those of the previous revision
  std::map<std::string, CourseRules> before;
  {
    ASSIGN_OR_RETURN(const auto all, exercisesOf(curriculum.id));
    for (const StoredExercise& item : all) before[item.id] = item.rules;
  }
  RETURN_IF_ERROR(connection_.run("DELETE FROM exercises WHERE curriculum_id = ?", curriculum.id));
  ASSIGN_OR_RETURN(const auto profiles, ThingNames::read(connection_, Thing::kProfile));
  ASSIGN_OR_RETURN(auto exercises, ThingNames::read(connection_, Thing::kExercise));
  std::int64_t position = 0;
  for (const StoredExercise& item : curriculum.exercises) {
    const std::string field = "curriculum '" + curriculum.id + "', exercise '" + item.id + "'";
    RETURN_IF_ERROR(checkName(field + ", id", item.id));
    if (const Status known = profiles.require(item.profile_id); !known)
      return Error{known.error().code,
                   field + ", profile_id: " + known.error().message + ": import it first"};
    if (const auto other = exercise(item.id); other) {
      return Error{
          ErrorCode::kAlreadyExists,
          field + ": there is already an exercise of this id in curriculum '" + other->curriculum_id + "'"};
    } else if (other.error().code != ErrorCode::kNotFound) {
      return other.error();
    }
    if (!before.contains(item.id)) RETURN_IF_ERROR(exercises.checkNew(item.id, item.name));
    exercises.add(item.id, item.name);
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO exercises (id, curriculum_id, position, name, profile_id, json,"
                        " assigned_only, exam_attempts, results_from_unix_ns) VALUES (?,?,?,?,?,?,?,?,?)",
                        item.id, curriculum.id, position++, item.name, item.profile_id, item.json,
                        item.rules.assigned_only, item.rules.exam_attempts, item.rules.results_from_unix_ns));
    const auto was = before.find(item.id);
    if ((was == before.end() ? std::nullopt : was->second.exam_attempts) != item.rules.exam_attempts)
      RETURN_IF_ERROR(AttemptStore(connection_).countExam(item.id));
  }
  return {};
}

Result<StoredCurriculum> CurriculumStore::get(std::string_view id, std::uint32_t revision) {
  auto row = connection_.query(
      "SELECT id, revision, name, json, author, created_unix_ns FROM curricula"
      " WHERE id = ?1 AND (?2 = 0 OR revision = ?2) ORDER BY revision DESC LIMIT 1",
      id, revision);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) {
    return Error{ErrorCode::kNotFound, "there is no curriculum '" + std::string(id) + "'" +
                                           (revision == 0 ? "" : fmt::format(" of revision {}", revision))};
  }
  ASSIGN_OR_RETURN(auto exercises, exercisesOf(id));
  return StoredCurriculum{row.text(0), row.natural32(1), row.text(2),         row.text(3),
                          row.text(4), row.integer(5),   std::move(exercises)};
}

Result<std::vector<StoredCurriculum>> CurriculumStore::list() {
  const auto withExercises = [&](const Statement& row) -> Result<StoredCurriculum> {
    ASSIGN_OR_RETURN(auto exercises, exercisesOf(row.text(0)));
    return StoredCurriculum{row.text(0), row.natural32(1), row.text(2),         "",
                            row.text(3), row.integer(4),   std::move(exercises)};
  };
  return connection_
      .prepare(
          "SELECT id, revision, name, author, created_unix_ns FROM curricula AS c"
          " WHERE revision = (SELECT max(revision) FROM curricula WHERE id = c.id)"
          " ORDER BY id")
      .all(withExercises);
}

Result<StoredExercise> CurriculumStore::exercise(std::string_view id) {
  auto row = connection_.query(std::string(kExercise) + "WHERE id = ?", id);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) return Error{ErrorCode::kNotFound, "there is no exercise '" + std::string(id) + "'"};
  return exerciseOf(row);
}

Result<CourseRules> CurriculumStore::rulesOf(std::string_view exercise_id) {
  ASSIGN_OR_RETURN(const auto rules,
                   connection_
                       .query("SELECT assigned_only, exam_attempts, results_from_unix_ns FROM exercises"
                              " WHERE id = ?",
                              exercise_id)
                       .first([](const Statement& row) { return rulesAt(row, 0); }));
  return rules.value_or(CourseRules());
}

Result<std::vector<StoredExercise>> CurriculumStore::exercisesOf(std::string_view curriculum_id) {
  return connection_
      .query(std::string(kExercise) + "WHERE curriculum_id = ? ORDER BY position", curriculum_id)
      .all(exerciseOf);
}

Result<std::vector<StoredCurriculum>> CurriculumStore::revisions(std::string_view id) {
  ASSIGN_OR_RETURN(auto found, connection_
                                   .query("SELECT revision, name, author, created_unix_ns"
                                          " FROM curricula WHERE id = ? ORDER BY revision DESC",
                                          id)
                                   .all([&](const Statement& row) {
                                     return StoredCurriculum{
                                         std::string(id), row.natural32(0), row.text(1), "",
                                         row.text(2),     row.integer(3),   {}};
                                   }));
  if (found.empty()) return Error{ErrorCode::kNotFound, "there is no curriculum '" + std::string(id) + "'"};
  return found;
}

}  // namespace needlelab
