/// The Start screen's logic: what is listed, what is chosen, whether one can begin. No drawing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/station/window/lesson_board.h"

namespace needlelab {

struct ExerciseOffer {
  LessonChoice choice;  ///< its exercise, or the profile's file
  std::string name;     ///< for a person
  std::string description;
  std::string note;  ///< "assigned", "from the cache: the server is away", why it cannot be used
  bool usable = true;
};

/// Lists and choice; keeps what the person chose while the lists change beneath it.
class StartChoice {
 public:
  /// New lists, and what the station preselects. The person's own choice stays where it can.
  void update(const BoardState& state);

  /// Of the trainee that is chosen: assigned exercises first, then by name.
  [[nodiscard]] const std::vector<ExerciseOffer>& exercises() const { return exercises_; }
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

  /// What is to be practised, once it is clear.
  [[nodiscard]] std::optional<LessonChoice> choice() const;
  /// Why one cannot begin, for a person; empty when one can.
  [[nodiscard]] std::string missing() const;

 private:
  void list();

  LessonOffers offers_;
  bool server_ = false, server_away_ = false;
  LessonChoice preselected_;
  std::string trainee_;
  std::string exercise_;  // id; empty: the profile or none
  bool by_profile_ = false;
  std::vector<std::string> trainees_;
  std::vector<ExerciseOffer> exercises_;
};

/// The exercise's name where the lists know it, else its id.
std::string exerciseName(const LessonOffers& offers, const std::string& id);

}  // namespace needlelab
