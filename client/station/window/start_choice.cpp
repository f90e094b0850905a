#include "client/station/window/start_choice.h"

#include <algorithm>
#include <filesystem>
#include <tuple>
#include <utility>

#include "common/base/text.h"

namespace needlelab {
namespace {

bool isAssigned(const LessonOffers& offers, const std::string& trainee, const std::string& exercise) {
  return std::find(offers.assigned.begin(), offers.assigned.end(), std::pair(trainee, exercise)) !=
         offers.assigned.end();
}

}  // namespace

std::string exerciseName(const LessonOffers& offers, const std::string& id) {
  for (const ListedExercise& exercise : offers.exercises)
    if (exercise.exercise_id == id && !exercise.name.empty()) return exercise.name;
  return id;
}

void StartChoice::update(const BoardState& state) {
  offers_ = state.offers;
  server_ = !state.server.empty();
  server_away_ = state.server_away;
  // what the station proposes anew goes before what was chosen
  if (state.choice != preselected_) {
    preselected_ = state.choice;
    if (!state.choice.trainee.empty()) trainee_ = state.choice.trainee;
    by_profile_ = state.choice.by_profile;
    exercise_ = state.choice.exercise;
  }
  list();
}

void StartChoice::list() {
  trainees_ = offers_.trainees;
  exercises_.clear();
  if (!offers_.profile_file.empty())
    exercises_.push_back({{trainee_, "", true},
                          std::filesystem::path(offers_.profile_file).filename().string(),
                          "Practice with a profile of your own: " + offers_.profile_file,
                          "",
                          true});
  for (const ListedExercise& listed : offers_.exercises) {
    ExerciseOffer row{
        {trainee_, listed.exercise_id, false}, exerciseName(offers_, listed.exercise_id), "", "", true};
    for (const ServerExercise& exercise : offers_.descriptions)
      if (exercise.exercise_id == listed.exercise_id) row.description = exercise.description;
    if (isAssigned(offers_, trainee_, listed.exercise_id)) row.note = "assigned";
    const bool cached = listed.cached_revision.has_value();
    if (!cached && (!server_ || server_away_)) {
      row.usable = false;
      row.note = listed.trouble.empty() ? "needs the server, which is away" : listed.trouble;
    }
    exercises_.push_back(std::move(row));
  }
  // the command line's exercise may be one that no list knows
  if (!exercise_.empty() && exercise() < 0)
    exercises_.push_back({{trainee_, exercise_, false}, exercise_, "", "", true});
  std::stable_sort(exercises_.begin(), exercises_.end(), [](const ExerciseOffer& a, const ExerciseOffer& b) {
    return std::tuple(!a.choice.by_profile, a.note != "assigned", !a.usable) <
           std::tuple(!b.choice.by_profile, b.note != "assigned", !b.usable);
  });
}

int StartChoice::exercise() const {
  for (std::size_t i = 0; i < exercises_.size(); ++i)
    if (by_profile_ ? exercises_[i].choice.by_profile
                    : !exercise_.empty() && exercises_[i].choice.exercise == exercise_)
      return static_cast<int>(i);
  return -1;
}

void StartChoice::chooseTrainee(const std::string& name) {
  trainee_ = name;
  list();
}

void StartChoice::chooseExercise(int index) {
  if (index < 0 || index >= static_cast<int>(exercises_.size())) return;
  const LessonChoice& chosen = exercises_[static_cast<std::size_t>(index)].choice;
  exercise_ = chosen.exercise;
  by_profile_ = chosen.by_profile;
}

void StartChoice::step(int by) {
  if (exercises_.empty()) return;
  const int now = exercise();
  chooseExercise(now < 0 ? 0 : std::clamp(now + by, 0, static_cast<int>(exercises_.size()) - 1));
}

void StartChoice::stepTrainee(int by) {
  if (trainees_.empty()) return;
  const auto at = std::find(trainees_.begin(), trainees_.end(), trainee_);
  const int last = static_cast<int>(trainees_.size()) - 1;
  const int next =
      at == trainees_.end() ? 0 : std::clamp(static_cast<int>(at - trainees_.begin()) + by, 0, last);
  chooseTrainee(std::string(trainees_[static_cast<std::size_t>(next)]));
}

std::optional<LessonChoice> StartChoice::choice() const {
  if (!missing().empty()) return std::nullopt;
  LessonChoice choice = exercises_[static_cast<std::size_t>(exercise())].choice;
  choice.trainee = trainee_;
  return choice;
}

std::string StartChoice::missing() const {
  if (trainee_.empty() && server_) return "Who practises? Choose or write a name.";
  if (!trainee_.empty())
    if (const Status valid = checkName("this name", trainee_); !valid.ok()) return valid.error().message;
  if (exercises_.empty())
    return server_ ? "There is no exercise here yet: wait for the server, or start with --profile FILE."
                   : "There is no exercise here: start with --profile FILE, or with a server.";
  const int index = exercise();
  if (index < 0) return "What is to be practised? Choose an exercise.";
  const ExerciseOffer& chosen = exercises_[static_cast<std::size_t>(index)];
  return chosen.usable ? std::string() : chosen.name + ": " + chosen.note;
}

}  // namespace needlelab
