/// The Start screen's logic: lists of exercises and trainees, device state, choice, and readiness for a
/// lesson. No drawing.
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

/// Returns the lists without a server: exercises from the cache, names from the command line and the spool's
/// sessions.
StartLists localLists(const StationOptions& options, const Spool& spool);
/// Adds the server's exercises and trainees. Errors: from `ask`; `lists` stays unchanged then.
Status addServerLists(StartLists& lists, const std::vector<CachedLesson>& cached, const AskServer& ask);

/// Returns the state of the `--device` device. Sets `hangs` if its driver does not return. Takes up to 3 s.
DeviceReadiness deviceReadiness(const StationOptions& options, bool steered, bool& hangs);

struct ExerciseRow {
  LessonChoice choice;  ///< the exercise, or the profile's file
  std::string name;     ///< display name
  std::string description;
  std::string note;  ///< "assigned", "from the cache: the server is away", or why it is unusable
  bool usable = true;
};

/// Lists and choice. The person's choice survives changes of the lists.
class StartChoice {
 public:
  /// Takes new lists and the station's preselection. Keeps the person's choice if possible.
  void update(const BoardState& state);

  /// Exercises for the chosen trainee: assigned ones first, then by name.
  [[nodiscard]] const std::vector<ExerciseRow>& exercises() const { return exercises_; }
  [[nodiscard]] const std::vector<std::string>& trainees() const { return trainees_; }
  [[nodiscard]] const std::string& trainee() const { return trainee_; }
  /// −1: none.
  [[nodiscard]] int exercise() const;
  void chooseTrainee(const std::string& name);
  void chooseExercise(int index);
  /// Moves the choice by one, as the arrow keys do; without a choice, selects the first.
  void step(int by);
  /// The same for the list of trainees.
  void stepTrainee(int by);

  /// Returns the lesson to begin; none while the choice is incomplete.
  [[nodiscard]] std::optional<LessonChoice> choice() const;
  /// Returns why no lesson can begin, for a person; empty if one can.
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

/// Returns the exercise's name if the lists have it, otherwise its id.
std::string exerciseName(const StartLists& lists, const std::string& id);

}  // namespace needlelab
