/// A trainee's standing in an exercise: locks, attempts left, due date; and who may practise. Private to
/// db/service.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/people/people.h"
#include "db/store/connection.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Passed; or, for an exercise without requirements, has a counting attempt.
bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise);

struct ExerciseStanding {
  AttemptStanding attempts;
  bool done = false;
  std::vector<std::string> locked_by;          ///< prerequisite exercises not yet passed
  std::optional<std::uint32_t> attempts_left;  ///< nothing: unlimited
  std::int64_t due_unix_ns = 0;                ///< 0: never
};

/// An exercise with the data needed for a trainee's standing in it.
struct ReadExercise {
  StoredExercise stored;
  pb::Exercise exercise;
  struct Before {
    std::string id;
    bool needs_no_pass = false;  ///< any attempt is enough, as in an exam; if removed, only a pass counts
  };
  std::vector<Before> prerequisites;
};
/// Before::needs_no_pass of the exercises looked up so far, by id.
using KnownPrerequisites = std::map<std::string, bool>;
/// Reads and parses those prerequisites that are not yet in `known`. kCorrupt: this program cannot read a
/// stored text.
Result<ReadExercise> readExercise(Connection& connection, const StoredExercise& stored,
                                  const pb::Exercise& exercise, KnownPrerequisites& known);
/// The trainee's standing, from the sums (AttemptStore::standings()) and the due date set by assignments
/// (CourseDates; 0: the exercise's own).
ExerciseStanding standingBy(const ReadExercise& exercise,
                            const std::map<std::string, AttemptStanding>& attempts,
                            std::int64_t assigned_due_unix_ns);

/// Parses an exercise's text. kCorrupt: this program cannot read the stored text.
Result<pb::Exercise> exerciseOf(const StoredExercise& stored);

/// The trainee's due date, from assignments or else from the exercise; 0: never.
Result<std::int64_t> dueOf(Connection& connection, const std::string& trainee, const StoredExercise& stored,
                           const pb::Exercise& exercise);

/// `trainee` may be any name, known or not.
Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise);

/// Nothing if the trainee may begin; otherwise the reason, as a text for the trainee with the exercises'
/// names.
Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const CourseRules& rules, const ExerciseStanding& standing);

// who may practise: trainee_handlers.cpp

/// Whether a station may learn about `name` (`person`: its account): kGuestName; an enabled trainee; enabled
/// staff with an assignment, such as an expert who records a reference. All others look like unknown names. A
/// session under a name does not count: anyone with a station's key can send one under any name.
Result<bool> stationMayKnow(Connection& reader, const std::optional<Person>& person, const std::string& name);
/// Whether a course is visible to the requester: trainees see only courses that are for all, or that are
/// assigned to them in whole or in part.
Result<bool> seesCourse(Connection& reader, const StoredCurriculum& course, const std::string& name,
                        pb::Role asked_by);
/// kNotFound if the course is not visible, as for one that does not exist.
Status requireVisible(Connection& reader, const StoredCurriculum& course, const std::string& name,
                      pb::Role asked_by);
/// For an exercise by assignment only: whether it is assigned to the trainee `name` (empty: no one in
/// particular; allowed for any station). kNotFound for trainees themselves, who do not see it; kDenied, with
/// a text for the trainee, for all others.
Status mayBegin(Connection& reader, const StoredExercise& exercise, const std::string& name,
                pb::Role asked_by);
/// Whether a lesson of `name` may begin; several reads: call it within one view. kNotFound, for a station: it
/// may not know the name (stationMayKnow); the text suggests similar names that it may know. kDenied, for
/// others: disabled. Staff may look at a lesson of any name.
Status mayPractise(Connection& reader, const std::string& name, pb::Role asked_by);

}  // namespace needlelab
