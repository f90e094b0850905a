#include "client/station/window/start_choice.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "client/station/run/list_devices.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr auto kDevicePatience = std::chrono::seconds(3);
constexpr int kMostPages = 50;

void addName(std::vector<std::string>& names, const std::string& name) {
  if (checkName("trainee", name).ok() && std::find(names.begin(), names.end(), name) == names.end())
    names.push_back(name);
}

// "virtuose" of "virtuose:host#1", "falcon" of "falcon@1-4.2"
std::string kindOf(const std::string& spec) {
  return spec.substr(0, spec.find_first_of(":@"));
}

bool isAssigned(const StartLists& lists, const std::string& trainee, const std::string& exercise) {
  return std::find(lists.assigned.begin(), lists.assigned.end(), std::pair(trainee, exercise)) !=
         lists.assigned.end();
}

}  // namespace

StartLists localLists(const StationOptions& options, const Spool& spool) {
  StartLists lists;
  lists.exercises = listExercises(LessonCache(options.spool).list(), std::nullopt);
  lists.profile_file = options.profile_file.string();
  if (options.trainee_given) addName(lists.trainees, options.trainee);
  for (const auto& sessions : {spool.unfinished(), spool.closedButNotSafe()})
    for (const auto& session : sessions) addName(lists.trainees, session->description().trainee());
  return lists;
}

Status addServerLists(StartLists& lists, const std::vector<CachedLesson>& cached, const AskServer& ask) {
  ASSIGN_OR_RETURN(auto exercises, exercisesBy(ask));
  std::vector<std::string> trainees = lists.trainees;
  std::vector<std::pair<std::string, std::string>> assigned;
  pb::Request request;
  request.mutable_list_assignments();
  for (int page = 0; page < kMostPages; ++page) {
    ASSIGN_OR_RETURN(auto reply, ask(request));
    for (const pb::Assignment& assignment : reply.assignments().assignments()) {
      addName(trainees, assignment.trainee());
      if (!assignment.exercise_id().empty())
        assigned.emplace_back(printable(assignment.trainee()), printable(assignment.exercise_id()));
    }
    if (reply.assignments().next_page().empty()) break;
    request.mutable_list_assignments()->set_page(reply.assignments().next_page());
  }
  std::sort(trainees.begin(), trainees.end());
  lists.exercises = listExercises(cached, exercises);
  lists.descriptions = std::move(exercises);
  lists.trainees = std::move(trainees);
  lists.assigned = std::move(assigned);
  return {};
}

DeviceReadiness deviceReadiness(const StationOptions& options, bool steered, bool& hangs) {
  const std::string kind = kindOf(options.device);
  if (kind == "simulated")
    return {"simulated Virtuose 6D Desktop",
            steered ? "you move it with mouse and keys"
                    : "a simulated hand moves it (plan " + options.hand.plan + ")",
            true, true};
  if (kind == "recording") {
    const std::string file = options.device.substr(options.device.find(':') + 1);
    std::error_code error;
    const bool there = std::filesystem::is_regular_file(file, error);
    return {"recorded motion", there ? file + "; the hand feels nothing" : file + " is not there", there,
            true};
  }
  std::vector<DeviceLister> listers;
  for (DeviceLister& lister : deviceListers())
    if (kindOf(lister.spec) == kind) listers.push_back(std::move(lister));
  const DeviceList list = listDevices(listers, kDevicePatience);
  hangs = hangs || !list.all_answered;
  const FoundDevice* best = nullptr;
  for (const FoundDevice& found : list.devices)
    if (found.spec == options.device) best = &found;
  for (const FoundDevice& found : list.devices)
    if (best == nullptr || (found.ready && !best->ready && best->spec != options.device)) best = &found;
  if (best == nullptr) return {options.device, "there is none: plug it in and switch it on", false, true};
  return {best->name, best->state, best->ready, true};
}

std::string exerciseName(const StartLists& lists, const std::string& id) {
  for (const ListedExercise& exercise : lists.exercises)
    if (exercise.exercise_id == id && !exercise.name.empty()) return exercise.name;
  return id;
}

void StartChoice::update(const BoardState& state) {
  lists_ = state.lists;
  server_ = !state.server.empty();
  server_away_ = state.server_away;
  // a new preselection of the station replaces the person's choice
  if (state.choice != preselected_) {
    preselected_ = state.choice;
    if (!state.choice.trainee.empty()) trainee_ = state.choice.trainee;
    by_profile_ = state.choice.by_profile;
    exercise_ = state.choice.exercise;
  }
  list();
}

void StartChoice::list() {
  trainees_ = lists_.trainees;
  exercises_.clear();
  if (!lists_.profile_file.empty())
    exercises_.push_back({{trainee_, "", true},
                          std::filesystem::path(lists_.profile_file).filename().string(),
                          "Practice with a profile of your own: " + lists_.profile_file,
                          "",
                          true});
  for (const ListedExercise& listed : lists_.exercises) {
    ExerciseRow row{
        {trainee_, listed.exercise_id, false}, exerciseName(lists_, listed.exercise_id), "", "", true};
    for (const ServerExercise& exercise : lists_.descriptions)
      if (exercise.exercise_id == listed.exercise_id) row.description = exercise.description;
    if (isAssigned(lists_, trainee_, listed.exercise_id)) row.note = "assigned";
    const bool cached = listed.cached_revision.has_value();
    if (!cached && (!server_ || server_away_)) {
      row.usable = false;
      row.note = listed.trouble.empty() ? "needs the server, which is away" : listed.trouble;
    }
    exercises_.push_back(std::move(row));
  }
  // the command line's exercise may be missing from all lists
  if (!exercise_.empty() && exercise() < 0)
    exercises_.push_back({{trainee_, exercise_, false}, exercise_, "", "", true});
  std::stable_sort(exercises_.begin(), exercises_.end(), [](const ExerciseRow& a, const ExerciseRow& b) {
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
  const ExerciseRow& chosen = exercises_[static_cast<std::size_t>(index)];
  return chosen.usable ? std::string() : chosen.name + ": " + chosen.note;
}

}  // namespace needlelab
