/// What the server says of courses, trainees, and each trainee's standing. CurriculumCache keeps it for the
/// time without the server.
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
  bool assigned_only = false;               ///< its course is for those alone to whom it is assigned
  bool exam = false;                        ///< its course is an exam: assigned only, too
};

/// A trainee whom the station offers to choose.
struct KnownTrainee {
  std::string name;         ///< the account's
  std::string full_name;    ///< empty: not known
  std::string person = {};  ///< "@" and the UUID, for the description of a session; empty: not known
  friend bool operator==(const KnownTrainee&, const KnownTrainee&) = default;
};

/// A trainee's standing in an exercise.
struct StepStanding {
  std::string exercise_id;
  bool done = false;  ///< passed; or tried, where nothing is required
  std::uint32_t attempts = 0;
  std::vector<std::string> locked_by = {};                    ///< exercises to be passed first
  std::optional<std::uint32_t> attempts_left = std::nullopt;  ///< none: unlimited
  std::int64_t due_unix_ns = 0;                               ///< 0: never
  friend bool operator==(const StepStanding&, const StepStanding&) = default;
};

/// What is assigned to a trainee, directly or by a group, and how far the trainee is.
struct TraineeStanding {
  std::int64_t as_of_unix_ns = 0;      ///< when the server said it
  std::vector<std::string> courses;    ///< ids of the assigned courses
  std::vector<std::string> exercises;  ///< ids of the exercises assigned one by one
  std::vector<StepStanding> steps;     ///< in all exercises of all courses
  friend bool operator==(const TraineeStanding&, const TraineeStanding&) = default;
};

struct Curriculum {
  std::vector<ServerExercise> exercises;             ///< course after course, in the courses' order
  std::vector<KnownTrainee> trainees;                ///< by name
  std::map<std::string, TraineeStanding> standings;  ///< by the trainee's name
};

/// Returns whether the trainee of this standing (null: not known here) may take the exercise: it is for all,
/// or assigned to them.
bool mayTake(const ServerExercise& exercise, const TraineeStanding* standing);
/// Notes that the trainee begins the exercise, until the server gives the standing again: of limited attempts
/// one is used, and an exam's exercise is taken, as far as others wait for it. Nothing where the standing is
/// not known.
void noteBegun(Curriculum& curriculum, const std::string& trainee, const std::string& exercise_id);

/// Returns the full name, with the account's name if two people share it; without a full name the account's.
std::string shownName(const std::vector<KnownTrainee>& trainees, const std::string& name);
/// Returns the name of the account that `text` means: a shown name, else `text` itself.
std::string accountOf(const std::vector<KnownTrainee>& trainees, const std::string& text);
/// Returns KnownTrainee::person of the account; empty: not known.
std::string personOf(const std::vector<KnownTrainee>& trainees, const std::string& name);

/// Sends a request to the server, over a separate connection or the uplink's.
using AskServer = std::function<Result<pb::Reply>(pb::Request)>;
/// Returns all exercises of all courses. Errors: from `ask`.
Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask);
/// Returns everybody who is assigned one of these exercises' courses, or has tried. Errors: from `ask`.
Result<std::vector<KnownTrainee>> traineesBy(const AskServer& ask,
                                             const std::vector<ServerExercise>& exercises);
/// Returns a trainee's standing in these exercises. Errors: as traineesBy.
Result<TraineeStanding> standingBy(const AskServer& ask, const std::vector<ServerExercise>& exercises,
                                   const std::string& trainee, std::int64_t now_unix_ns);
/// Takes exercises, trainees, and the standing of `trainee` (empty: of nobody) from the server. Forgets the
/// standings of those whom the server does not list any more. Errors: from `ask`; `curriculum` stays
/// unchanged then.
Status updateCurriculum(Curriculum& curriculum, const AskServer& ask, const std::string& trainee,
                        std::int64_t now_unix_ns);

/// File SPOOL/lessons/curriculum.cache: a nonce and JSON, encrypted with a key that is made from the
/// station's own (libsodium's secretbox). Without the station's key nothing is kept or found. Thread: one.
class CurriculumCache {
 public:
  /// `key_file`: the station's (station_key.h); empty, or not a key: nothing is kept.
  CurriculumCache(const std::filesystem::path& spool, const std::filesystem::path& key_file);
  ~CurriculumCache() { wipe(key_); }
  CurriculumCache(const CurriculumCache&) = delete;
  CurriculumCache& operator=(const CurriculumCache&) = delete;

  /// Keeps the standings of the newest 500, and who is asked for a code, as far as the server lists them.
  /// Errors: kUnavailable (disk, no folder).
  Status keep(const Curriculum& curriculum) const;
  /// Keeps whether the server asks for a code of this trainee; never the code. Errors: as keep.
  Status keepAsksCode(const std::string& trainee, bool asks) const;
  /// As noteBegun(). Errors: as keep.
  Status keepBegun(const std::string& trainee, const std::string& exercise_id) const;
  /// Returns whether the server asked for a code of this trainee when it was last there.
  [[nodiscard]] bool asksCode(const std::string& trainee) const;
  /// Returns all of whom asksCode is true.
  [[nodiscard]] std::set<std::string> allAskedForCodes() const;
  /// Returns what was kept; an empty curriculum if there is none, or if the file is damaged or of another
  /// key: the server gives it again.
  [[nodiscard]] Curriculum find() const;

 private:
  Status write(const Curriculum& curriculum, const std::set<std::string>& asks_code) const;
  std::filesystem::path file_;
  std::string key_;  // empty: no key
};

}  // namespace needlelab
