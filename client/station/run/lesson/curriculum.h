/// Courses, trainees and their standings, as the server reports them. CurriculumCache keeps them for times
/// without the server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/secret.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// An exercise as the server lists it.
struct ServerExercise {
  std::string exercise_id, name, profile_id, description;
  std::string course_id = {}, course = {};  ///< its course's id and name
  bool assigned_only = false;               ///< only trainees to whom its course is assigned may take it
  bool exam = false;                        ///< its course is an exam, and so assigned only
};

/// A trainee to choose from at the station.
struct KnownTrainee {
  std::string name;         ///< the account's
  std::string full_name;    ///< empty: not known
  std::string person = {};  ///< "@" and the UUID, as in a session's description; empty: not known
  friend bool operator==(const KnownTrainee&, const KnownTrainee&) = default;
};

/// A trainee's standing in an exercise.
struct StepStanding {
  std::string exercise_id;
  bool done = false;  ///< passed, or tried if nothing is required
  std::uint32_t attempts = 0;
  std::vector<std::string> locked_by = {};                    ///< exercises to pass first
  std::optional<std::uint32_t> attempts_left = std::nullopt;  ///< none: unlimited
  std::int64_t due_unix_ns = 0;                               ///< 0: never
  friend bool operator==(const StepStanding&, const StepStanding&) = default;
};

/// A trainee's assignments, direct or through a group, and progress.
struct TraineeStanding {
  std::int64_t as_of_unix_ns = 0;      ///< when the server reported it
  std::vector<std::string> courses;    ///< ids of the assigned courses
  std::vector<std::string> exercises;  ///< ids of individually assigned exercises
  std::vector<StepStanding> steps;     ///< in all exercises of all courses
  friend bool operator==(const TraineeStanding&, const TraineeStanding&) = default;
};

struct Curriculum {
  std::vector<ServerExercise> exercises;             ///< course after course, in the courses' order
  std::vector<KnownTrainee> trainees;                ///< by name
  std::map<std::string, TraineeStanding> standings;  ///< by the trainee's name
};

/// Returns whether a trainee with this standing (null: not known) may take the exercise: it is open to all,
/// or assigned to the trainee.
bool canStart(const ServerExercise& exercise, const TraineeStanding* standing);
/// Records that the trainee begins the exercise, until the server sends the standing again: uses one of
/// limited attempts, and counts an exam's exercise as done for the exercises that wait for it. Does nothing
/// if the standing is not known.
void noteBegun(Curriculum& curriculum, const std::string& trainee, const std::string& exercise_id);

/// Returns the full name, with the account's name if two people share it; without a full name, the account's
/// name.
std::string shownName(const std::vector<KnownTrainee>& trainees, const std::string& name);
/// Returns the account that `text` names: by a shown name, otherwise `text` itself.
std::string accountOf(const std::vector<KnownTrainee>& trainees, const std::string& text);
/// Returns KnownTrainee::person of the account; empty if not known.
std::string personOf(const std::vector<KnownTrainee>& trainees, const std::string& name);

/// Sends a request to the server, over a separate connection or the uplink's.
using AskServer = std::function<Result<pb::Reply>(pb::Request)>;
/// Returns all exercises of all courses. Errors: from `ask`.
Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask);
/// Returns everyone who is assigned one of these exercises' courses or has tried one. Errors: from `ask`.
Result<std::vector<KnownTrainee>> traineesBy(const AskServer& ask,
                                             const std::vector<ServerExercise>& exercises);
/// Returns a trainee's standing in these exercises. Errors: as traineesBy.
Result<TraineeStanding> standingBy(const AskServer& ask, const std::vector<ServerExercise>& exercises,
                                   const std::string& trainee, std::int64_t now_unix_ns);
/// Updates exercises, trainees, and the standing of `trainee` (empty: none) from the server. Drops the
/// standings of trainees whom the server no longer lists. Errors: from `ask`; `curriculum` is then unchanged.
Status updateCurriculum(Curriculum& curriculum, const AskServer& ask, const std::string& trainee,
                        std::int64_t now_unix_ns);

/// File SPOOL/lessons/curriculum.cache: a nonce and JSON, encrypted (libsodium's secretbox) with a key
/// derived from the station's. Without the station's key, nothing is kept or found. Thread: one.
class CurriculumCache {
 public:
  /// `key_file`: the station's (station_key.h); if it is empty or not a key, nothing is kept.
  CurriculumCache(const std::filesystem::path& spool, const std::filesystem::path& key_file);
  ~CurriculumCache() { wipe(key_); }
  CurriculumCache(const CurriculumCache&) = delete;
  CurriculumCache& operator=(const CurriculumCache&) = delete;

  /// Keeps the newest 500 standings, and which of the listed trainees are asked for a code. Errors:
  /// kUnavailable (disk, no folder).
  Status keep(const Curriculum& curriculum) const;
  /// Keeps whether the server asks for a code of this trainee; never the code. Errors: as keep.
  Status keepAsksCode(const std::string& trainee, bool asks) const;
  /// As noteBegun(). Errors: as keep.
  Status keepBegun(const std::string& trainee, const std::string& exercise_id) const;
  /// Returns whether the server asked for this trainee's code when it was last reachable.
  [[nodiscard]] bool asksCode(const std::string& trainee) const;
  /// Returns all trainees for whom asksCode is true.
  [[nodiscard]] std::set<std::string> allTraineesWithCode() const;
  /// Returns the kept curriculum. Empty if there is none, or if the file is damaged or made with another key;
  /// the server then sends it again.
  [[nodiscard]] Curriculum find() const;

 private:
  Status write(const Curriculum& curriculum, const std::set<std::string>& asks_code) const;
  std::filesystem::path file_;
  std::string key_;  // empty: no key
};

}  // namespace needlelab
