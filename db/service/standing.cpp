#include "db/service/standing.h"

#include "common/profile/profile.h"
#include "db/assignments.h"

namespace needlelab {

Result<pb::Exercise> exerciseOf(const StoredExercise& stored) {
  auto exercise = parseExercise(stored.json, "exercise '" + stored.id + "'");
  if (!exercise) return Error{ErrorCode::kCorrupt, exercise.error().message};
  return exercise;
}

bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise) {
  const bool asks_nothing = exercise.requirements().empty() && !exercise.has_time_limit_s();
  return asks_nothing ? attempts.counted > 0 : attempts.passed.value_or(false);
}

Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise) {
  ExerciseStanding standing;
  const auto attempts = AttemptStore(connection).standing(trainee, stored.id);
  if (!attempts) return attempts.error();
  standing.attempts = *attempts;
  standing.done = isDone(*attempts, exercise);
  if (exercise.has_attempts()) {
    const std::uint32_t used = std::min(exercise.attempts(), attempts->counted);
    standing.attempts_left = exercise.attempts() - used;
  }
  for (const std::string& before : exercise.prerequisites()) {
    const auto there = AttemptStore(connection).standing(trainee, before);
    if (!there) return there.error();
    const auto other = CurriculumStore(connection).exercise(before);
    if (!other && other.error().code != ErrorCode::kNotFound) return other.error();
    bool done = there->passed.value_or(false);
    if (other) {
      const auto text = exerciseOf(*other);
      if (!text) return text.error();
      done = isDone(*there, *text);
    }
    if (!done) standing.locked_by.push_back(before);
  }
  const auto own_due =
      exercise.has_due_unix_ms() ? static_cast<std::int64_t>(exercise.due_unix_ms()) * 1'000'000 : 0;
  const auto due = AssignmentStore(connection).dueOf(trainee, stored.id, stored.curriculum_id, own_due);
  if (!due) return due.error();
  standing.due_unix_ns = *due;
  return standing;
}

Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const ExerciseStanding& standing) {
  if (!standing.locked_by.empty()) {
    std::string names;
    for (const std::string& id : standing.locked_by) {
      const auto other = CurriculumStore(connection).exercise(id);
      if (!other && other.error().code != ErrorCode::kNotFound) return other.error();
      names += (names.empty() ? "\"" : ", \"") + (other ? other->name : id) + "\"";
    }
    return std::optional("\"" + exercise.name() + "\" is still locked: pass " + names + " first");
  }
  if (standing.attempts_left == 0u) {
    const std::string times = exercise.attempts() == 1
                                  ? "the one attempt"
                                  : "all " + std::to_string(exercise.attempts()) + " attempts";
    return std::optional("\"" + exercise.name() + "\": " + times +
                         " have been used; ask your instructor, who can give one back");
  }
  return std::optional<std::string>();
}

}  // namespace needlelab
