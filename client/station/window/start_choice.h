/// The Start screen's logic: the lists of exercises and trainees, the device's state, the choice, and whether
/// a lesson can begin. No drawing.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/net/lesson_cache.h"
#include "client/net/spool.h"
#include "client/station/run/list_exercises.h"
#include "client/station/run/options.h"
#include "client/station/window/lesson_board.h"

namespace needlelab {

/// Without a server: the cache's exercises; names from the command line and from the spool's sessions.
StartLists localLists(const StationOptions& options, const Spool& spool);
/// Adds the server's exercises and trainees. Errors: those of `ask`; then `lists` is unchanged.
Status addServerLists(StartLists& lists, const std::vector<CachedLesson>& cached, const AskServer& ask);

/// How the device of `--device` is; `hangs` becomes true when its driver did not come back. Takes up to 3 s.
DeviceReadiness deviceReadiness(const StationOptions& options, bool steered, bool& hangs);

struct ExerciseRow {
  LessonChoice choice;  ///< its exercise, or the profile's file
  std::string name;     ///< for a person
  std::string description;
  std::string note;  ///< "assigned", "from the cache: the server is away", why it cannot be used
  bool usable = true;
};

/// Lists and choice; the person's choice stays while the lists change.
class StartChoice {
 public:
  /// New lists and the station's preselection. The person's own choice stays where possible.
  void update(const BoardState& state);

  /// Of the trainee that is chosen: assigned exercises first, then by name.
  [[nodiscard]] const std::vector<ExerciseRow>& exercises() const { return exercises_; }
  [[nodiscard]] const std::vector<std::string>& trainees() const { return trainees_; }
  [[nodiscard]] const std::string& trainee() const { return trainee_; }
  /// −1: none.
  [[nodiscard]] int exercise() const;
  void chooseTrainee(const std::string& name);
  void chooseExercise(int index);
  /// By one up or down, as the arrow keys do; nothing chosen: the first.
  void step(int by);
  /// The same for the list of trainees.
  void stepTrainee(int by);

  /// The lesson to begin, once it is clear.
  [[nodiscard]] std::optional<LessonChoice> choice() const;
  /// Why one cannot begin, for a person; empty when one can.
  [[nodiscard]] std::string missing() const;

 private:
  void list();

  StartLists lists_;
  bool server_ = false, server_away_ = false;
  LessonChoice preselected_;
  std::string trainee_;
  std::string exercise_;  // id; empty: the profile or none
  bool by_profile_ = false;
  std::vector<std::string> trainees_;
  std::vector<ExerciseRow> exercises_;
};

/// The exercise's name where the lists know it, else its id.
std::string exerciseName(const StartLists& lists, const std::string& id);

}  // namespace needlelab
