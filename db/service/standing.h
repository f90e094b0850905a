/// A trainee's standing in an exercise: locks, attempts left, due date; and who practises. Private to this
/// folder.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
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

/// An exercise with what a trainee's standing in it needs.
struct ReadExercise {
  StoredExercise stored;
  pb::Exercise exercise;
  struct Before {
    std::string id;
    bool asks_nothing = false;  ///< an attempt is enough, as in an exam; of a removed one only a pass counts
  };
  std::vector<Before> prerequisites;
};
/// Of the exercises that were looked up so far, by id: Before::asks_nothing.
using KnownPrerequisites = std::map<std::string, bool>;
/// Reads and parses the prerequisites that are not `known` yet. kCorrupt: this program cannot read a stored
/// text.
Result<ReadExercise> readExercise(Connection& connection, const StoredExercise& stored,
                                  const pb::Exercise& exercise, KnownPrerequisites& known);
/// The trainee's standing by its sums (AttemptStore::standings()) and the date that assignments set for it
/// (CourseDates; 0: the exercise's own counts).
ExerciseStanding standingBy(const ReadExercise& exercise,
                            const std::map<std::string, AttemptStanding>& attempts,
                            std::int64_t assigned_due_unix_ns);

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
                                          const CourseRules& rules, const ExerciseStanding& standing);

// who practises: trainee_handlers.cpp

/// Whether a station hears of `name` (`person`: its account): kGuestName; an enabled trainee; enabled staff
/// to whom somebody assigned a lesson, such as an expert who records a reference. All others look like names
/// that nobody has. A session under a name is no reason: whoever has a station's key can send one under any
/// name.
Result<bool> stationMayKnow(Connection& reader, const std::optional<Person>& person, const std::string& name);
/// Whether a course is shown to whoever asks: to trainees those alone that are for all, or that are assigned
/// to them, whole or in part.
Result<bool> seesCourse(Connection& reader, const StoredCurriculum& course, const std::string& name,
                        pb::Role asked_by);
/// kNotFound, as of a course that is not there: it is not shown.
Status requireSeen(Connection& reader, const StoredCurriculum& course, const std::string& name,
                   pb::Role asked_by);
/// Of an exercise that is assigned only: whether it is assigned to the trainee `name` (empty: nobody in
/// particular, for which any station may have it). kNotFound to trainees themselves, who do not see it;
/// kDenied, with a text for the trainee, to all others.
Status mayBegin(Connection& reader, const StoredExercise& exercise, const std::string& name,
                pb::Role asked_by);
/// Whether a lesson of `name` may begin; several reads: call it within one view. kNotFound, to a station: it
/// may not know the name (stationMayKnow); the text gives similar names that it may. kDenied, to others:
/// disabled. Staff may look at the lesson of any name.
Status mayPractise(Connection& reader, const std::string& name, pb::Role asked_by);

}  // namespace needlelab
