/// A trainee's standing in an exercise: locks, attempts left, due date; and who practises. Private to this
/// folder.
#pragma once

#include <cstdint>
#include <map>
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

/// Standings of one view of the database. An exercise that others need first is read and parsed once, and a
/// trainee's attempts at it once, as long as the same trainee is asked for. Does not own the connection.
/// Thread: as its Connection.
class Standings {
 public:
  explicit Standings(Connection& connection) : connection_(connection) {}

  /// `trainee` may be any name, known or not.
  Result<ExerciseStanding> of(const std::string& trainee, const StoredExercise& stored,
                              const pb::Exercise& exercise);

 private:
  /// Whether the prerequisite is done; of a removed exercise: whether it was passed.
  Result<bool> isDoneBefore(const std::string& trainee, const std::string& prerequisite);

  Connection& connection_;
  std::map<std::string, std::optional<pb::Exercise>> exercises_;  // by id; nothing: removed
  std::string trainee_;
  std::map<std::string, bool> done_;  // of trainee_, by exercise
};

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
