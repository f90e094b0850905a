/// A trainee's standing in an exercise: locks, attempts left, due date; and who practises. Private to this
/// folder.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/assignments.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/people.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Passed; or, for an exercise without requirements, tried in an attempt that counts.
bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise);

struct ExerciseStanding {
  AttemptStanding attempts;
  bool done = false;
  std::vector<std::string> locked_by;          ///< prerequisite exercises not yet passed
  std::optional<std::uint32_t> attempts_left;  ///< nothing: unlimited
  std::int64_t due_unix_ns = 0;                ///< 0: never
};

/// Parses an exercise's text. kCorrupt: this program cannot read the stored text.
Result<pb::Exercise> exerciseOf(const StoredExercise& stored);

/// Until when the trainee is to have done it, by the assignments, else by the exercise; 0: never.
Result<std::int64_t> dueOf(Connection& connection, const std::string& trainee, const StoredExercise& stored,
                           const pb::Exercise& exercise);

/// `trainee` may be any name, known or not.
Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise);

/// Nothing when the trainee may begin; otherwise the reason, as a text for the trainee with the exercises'
/// names.
Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const ExerciseStanding& standing);

// who practises: trainee_handlers.cpp

/// Members of the group; or all trainees with an assignment of the course or one of its exercises, or with an
/// attempt.
Result<std::set<std::string>> traineesOf(Connection& reader, const std::string& course_id,
                                         const std::string& group_id);
/// Whether a station hears of `name` (`person`: its account): kGuestName; an enabled trainee; enabled staff
/// to whom somebody assigned a lesson, such as an expert who records a reference. All others look like names
/// that nobody has. A session under a name is no reason: whoever has a station's key can send one under any
/// name.
Result<bool> stationMayKnow(Connection& reader, const std::optional<Person>& person, const std::string& name);
/// Whether a lesson of `name` may begin; several reads: call it within one view. kNotFound, to a station: it
/// may not know the name (stationMayKnow); the text gives similar names that it may. kDenied, to others:
/// disabled. Staff may look at the lesson of any name.
Status mayPractise(Connection& reader, const std::string& name, pb::Role asked_by);

}  // namespace needlelab
