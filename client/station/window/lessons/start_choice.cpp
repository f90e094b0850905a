#include "client/station/window/lessons/start_choice.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "client/station/run/checks/list_devices.h"
#include "client/station/run/lesson/built_in.h"
#include "client/station/run/lesson/trainee_code.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

constexpr auto kDevicePatience = std::chrono::seconds(3);
constexpr int kMaxPages = 50;
// Others change a standing: an instructor assigns or returns an attempt, a score comes late. So it is
// requested again after this time (one request per course), and shown with its time when much older.
constexpr std::int64_t kStandingRefresh_ns = 120'000'000'000, kStandingOld_ns = 300'000'000'000;

void addName(std::vector<std::string>& names, const std::string& name) {
  if (checkName("trainee", name).ok() && std::find(names.begin(), names.end(), name) == names.end())
    names.push_back(name);
}

// "virtuose" of "virtuose:host#1", "falcon" of "falcon@1-4.2"
std::string kindOf(const std::string& spec) {
  return spec.substr(0, spec.find_first_of(":@"));
}

constexpr std::uint64_t kOwnQuestions = 1u << 30;  // the numbers of the station's own questions begin here

const std::string kNeedsServer = "needs the server, which is unreachable";

bool isAssigned(const StartLists& lists, const std::string& trainee, const std::string& exercise) {
  return std::find(lists.assigned.begin(), lists.assigned.end(), std::pair(trainee, exercise)) !=
         lists.assigned.end();
}

// adds all trainees of the courses, in the order of the shown names
void addTrainees(std::vector<std::string>& names, const std::vector<KnownTrainee>& trainees) {
  if (trainees.empty()) return;
  for (const KnownTrainee& trainee : trainees) addName(names, trainee.name);
  std::sort(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return std::pair(shownName(trainees, a), a) < std::pair(shownName(trainees, b), b);
  });
}

}  // namespace

StartLists localLists(const StationOptions& options, const Spool& spool) {
  StartLists lists;
  lists.exercises = listExercises(LessonCache(options.spool).list(), std::nullopt);
  lists.profile_file = options.profile_file.string();
  const CurriculumCache cache(options.spool, options.key_file);
  lists.asks_code = cache.allTraineesWithCode();
  if (options.trainee_given) addName(lists.trainees, options.trainee);
  for (const auto& sessions : {spool.unfinished(), spool.closedButNotSafe()})
    for (const auto& session : sessions)  // names as typed
      if (!session->description().trainee().starts_with('@'))
        addName(lists.trainees, session->description().trainee());
  if (Curriculum kept = cache.find(); !kept.exercises.empty()) {
    addTrainees(lists.trainees, kept.trainees);
    lists.descriptions = kept.exercises;
    lists.curriculum = std::make_shared<const Curriculum>(std::move(kept));
  }
  if (practisesAlone(options)) {
    lists.exercises = builtInExercises();
    lists.curriculum = std::make_shared<const Curriculum>(builtInCurriculum());
    lists.descriptions = lists.curriculum->exercises;
  }
  return lists;
}

Status addServerLists(StartLists& lists, const std::vector<CachedLesson>& cached, const std::string& trainee,
                      const AskServer& ask, std::int64_t now_unix_ns) {
  Curriculum curriculum = lists.curriculum ? *lists.curriculum : Curriculum{};
  RETURN_IF_ERROR(updateCurriculum(curriculum, ask, trainee, now_unix_ns));
  std::vector<std::string> trainees = lists.trainees;
  // removes trainees whom the server no longer lists
  if (lists.curriculum)
    for (const KnownTrainee& before : lists.curriculum->trainees) std::erase(trainees, before.name);
  std::vector<std::pair<std::string, std::string>> assigned;
  std::set<std::string> courses, exercises;
  std::string all;
  pb::Request request;
  request.mutable_list_assignments();
  for (int page = 0; page < kMaxPages; ++page) {
    ASSIGN_OR_RETURN(auto reply, ask(request));
    for (const pb::Assignment& assignment : reply.assignments().assignments()) {
      addName(trainees, assignment.trainee());
      if (!assignment.exercise_id().empty())
        assigned.emplace_back(printable(assignment.trainee()), printable(assignment.exercise_id()));
      (assignment.exercise_id().empty() ? courses : exercises)
          .insert(printable(assignment.exercise_id() + assignment.course_id()));
      all += assignment.SerializeAsString();
    }
    if (reply.assignments().next_page().empty()) break;
    request.mutable_list_assignments()->set_page(reply.assignments().next_page());
  }
  std::sort(trainees.begin(), trainees.end());
  addTrainees(trainees, curriculum.trainees);
  lists.exercises = listExercises(cached, curriculum.exercises);
  lists.descriptions = curriculum.exercises;
  lists.trainees = std::move(trainees);
  lists.assigned = std::move(assigned);
  lists.assigned_courses = std::move(courses);
  lists.assigned_exercises = std::move(exercises);
  lists.assignments = std::hash<std::string>{}(all) | 1U;
  lists.curriculum = std::make_shared<const Curriculum>(std::move(curriculum));
  return {};
}

Status addStanding(StartLists& lists, const std::string& trainee, const AskServer& ask,
                   std::int64_t now_unix_ns) {
  if (!lists.curriculum) return {};
  ASSIGN_OR_RETURN(auto standing, standingBy(ask, lists.curriculum->exercises, trainee, now_unix_ns));
  auto curriculum = std::make_shared<Curriculum>(*lists.curriculum);
  curriculum->standings[trainee] = std::move(standing);
  lists.curriculum = std::move(curriculum);
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
    return {"recorded motion", there ? file + "; the hand feels nothing" : file + " does not exist", there,
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
  if (best == nullptr) return {options.device, "not found: plug it in and switch it on", false, true};
  return {best->name, best->state, best->ready, true};
}

std::string exerciseName(const StartLists& lists, const std::string& id) {
  for (const ListedExercise& exercise : lists.exercises)
    if (exercise.exercise_id == id && !exercise.name.empty()) return exercise.name;
  return id;
}

void StartChoice::update(const BoardState& state, std::int64_t now_unix_ns) {
  lists_ = state.lists;
  server_ = !state.server.empty();
  server_away_ = state.server_away;
  now_unix_ns_ = now_unix_ns;
  if (std::exchange(lesson_, state.lesson) != state.lesson) chosen_.reset();
  // a new preselection of the station replaces the person's choice
  if (state.choice != preselected_) {
    chosen_.reset();
    preselected_ = state.choice;
    if (!state.choice.trainee.empty()) trainee_ = state.choice.trainee;
    by_profile_ = state.choice.by_profile;
    exercise_ = state.choice.exercise;
    by_person_ = by_profile_ || !exercise_.empty();
  }
  takeQuestion(state.code_question);
  list();
}

void StartChoice::takeQuestion(const std::optional<CodeQuestion>& question) {
  if ((!question && !asksWithoutServer()) || (question_ && question_->trainee != trainee_)) forgetCode();
  if (question && question->number != last_question_) {
    last_question_ = question->number;
    forgetCode();  // the answer to the question before
    if (question->trainee == trainee_) question_ = question;
  }
  askInAdvance();
}

bool StartChoice::asksWithoutServer() const {
  return question_ && question_->number >= kOwnQuestions;
}

// asks at once, so that a badge held to the reader goes into the code's field
void StartChoice::askInAdvance() {
  const bool asks = lists_.asks_code.contains(trainee_);
  if (asksWithoutServer() && !asks) forgetCode();
  if (!question_ && asks)
    question_ = CodeQuestion{trainee_, "Type the PIN or hold the badge to the reader.", false,
                             kOwnQuestions + ++own_questions_};
}

void StartChoice::forgetCode() {
  question_.reset();
  wipe(code_);
}

const CodeQuestion* StartChoice::codeQuestion() const {
  return question_ && server_ && !server_away_ ? &*question_ : nullptr;
}

void StartChoice::typeCode(std::string code) {
  wipe(code_);
  code_ = asciiDigits(code);
  wipe(code);
}

std::string StartChoice::takeCode() {
  std::string code = codeQuestion() != nullptr ? code_ : std::string();
  wipe(code_);
  if (asksWithoutServer()) question_.reset();  // answered; the next person at the Start screen is asked again
  return code;
}

const TraineeStanding* StartChoice::standing() const {
  if (!lists_.curriculum) return nullptr;
  const auto at = lists_.curriculum->standings.find(trainee_);
  return at != lists_.curriculum->standings.end() ? &at->second : nullptr;
}

std::string StartChoice::shown(const std::string& account) const {
  return lists_.curriculum ? shownName(lists_.curriculum->trainees, account) : account;
}

std::string StartChoice::asOf() const {
  const TraineeStanding* const known = standing();
  if (known == nullptr) return {};
  const bool of_now = server_ && !server_away_ && now_unix_ns_ - known->as_of_unix_ns < kStandingOld_ns;
  return of_now ? std::string() : "as of " + localTime(known->as_of_unix_ns, TimeForm::kMinute);
}

std::string StartChoice::standingWanted() const {
  if (!server_ || server_away_ || !lists_.curriculum || lists_.curriculum->exercises.empty()) return {};
  if (trainee_.empty() || !checkName("this name", trainee_).ok()) return {};
  const TraineeStanding* const known = standing();
  return known == nullptr || now_unix_ns_ - known->as_of_unix_ns >= kStandingRefresh_ns ? trainee_
                                                                                        : std::string();
}

void StartChoice::list() {
  trainees_.clear();
  const std::string typed = lowerCase(typed_name_);
  for (const std::string& name : lists_.trainees)
    if (lowerCase(name).find(typed) != std::string::npos ||
        lowerCase(shown(name)).find(typed) != std::string::npos)
      trainees_.push_back(name);
  exercises_.clear();
  if (!lists_.profile_file.empty())
    exercises_.push_back({{trainee_, "", true},
                          std::filesystem::path(lists_.profile_file).filename().string(),
                          "Practice with your own profile: " + lists_.profile_file,
                          "",
                          true});
  addLadder();
  addOthers();
  // alone, Enter begins at once
  if (exercise_.empty() && !lists_.exercises.empty() && lists_.exercises.front().built_in)
    exercise_ = lists_.exercises.front().exercise_id;
  if (exercise_.empty() || exercise() >= 0) return;
  // the command line's exercise may be in no list; drops one that is not for this trainee
  const bool not_theirs = std::any_of(
      lists_.exercises.begin(), lists_.exercises.end(),
      [&](const ListedExercise& listed) { return listed.assigned_only && listed.exercise_id == exercise_; });
  if (not_theirs)
    exercise_.clear();
  else
    exercises_.push_back({{trainee_, exercise_, false}, exercise_, "", "", true});
}

void StartChoice::addLadder() {
  if (!lists_.curriculum) return;
  const Ladder ladder = ladderOf(*lists_.curriculum, trainee_, now_unix_ns_);
  for (const LadderSection& section : ladder.sections) {
    std::string heading = section.heading;
    for (const LadderStep& step : section.steps) {
      ExerciseRow row{
          {trainee_, step.exercise_id, false}, step.name, step.description, stepText(step), step.may_begin};
      row.heading = std::exchange(heading, "");
      row.number = step.number;
      row.state = step.state;
      row.due = step.due;
      if (row.note.empty() && isAssigned(lists_, trainee_, step.exercise_id)) row.note = "assigned";
      if (!server_ || server_away_) {
        // the standing is old, so everything in the cache may be practised
        const auto listed =
            std::find_if(lists_.exercises.begin(), lists_.exercises.end(),
                         [&](const ListedExercise& one) { return one.exercise_id == step.exercise_id; });
        const bool there = listed != lists_.exercises.end();
        const bool kept = there && listed->cached_revision;
        const bool exam = std::any_of(
            lists_.curriculum->exercises.begin(), lists_.curriculum->exercises.end(),
            [&](const ServerExercise& one) { return one.exam && one.exercise_id == step.exercise_id; });
        row.usable = kept && (!exam || step.may_begin);
        if (!kept)
          row.note += (row.note.empty() ? "" : " · ") +
                      (there && !listed->trouble.empty() ? listed->trouble : kNeedsServer);
      }
      exercises_.push_back(std::move(row));
    }
  }
  if (!by_person_ && !ladder.next.empty()) {
    exercise_ = ladder.next;
    by_profile_ = false;
  }
}

// adds what the ladder lacks: without the server's courses, the whole cache
void StartChoice::addOthers() {
  std::vector<ExerciseRow> others;
  for (const ListedExercise& listed : lists_.exercises) {
    const bool shown_already = std::any_of(exercises_.begin(), exercises_.end(), [&](const ExerciseRow& row) {
      return row.choice.exercise == listed.exercise_id;
    });
    // the ladder has this trainee's assigned exercises
    if (shown_already || listed.assigned_only) continue;
    ExerciseRow row{
        {trainee_, listed.exercise_id, false}, exerciseName(lists_, listed.exercise_id), "", "", true};
    for (const ServerExercise& exercise : lists_.descriptions)
      if (exercise.exercise_id == listed.exercise_id) row.description = exercise.description;
    if (isAssigned(lists_, trainee_, listed.exercise_id)) row.note = "assigned";
    const bool cached = listed.cached_revision.has_value();
    if (!cached && (!server_ || server_away_)) {
      row.usable = false;
      row.note = listed.trouble.empty() ? kNeedsServer : listed.trouble;
    }
    others.push_back(std::move(row));
  }
  std::stable_sort(others.begin(), others.end(), [](const ExerciseRow& a, const ExerciseRow& b) {
    return std::pair(a.note != "assigned", !a.usable) < std::pair(b.note != "assigned", !b.usable);
  });
  if (lists_.curriculum && !others.empty()) others.front().heading = "Kept on this station";
  std::move(others.begin(), others.end(), std::back_inserter(exercises_));
}

int StartChoice::exercise() const {
  for (std::size_t i = 0; i < exercises_.size(); ++i)
    if (by_profile_ ? exercises_[i].choice.by_profile
                    : !exercise_.empty() && exercises_[i].choice.exercise == exercise_)
      return static_cast<int>(i);
  return -1;
}

void StartChoice::chooseTrainee(const std::string& name) {
  const std::string account = lists_.curriculum ? accountOf(lists_.curriculum->trainees, name) : name;
  // keeps what a person chose here; otherwise selects this trainee's next step
  if (account != trainee_) {
    if (chosen_)
      exercise_ = *chosen_;
    else if (!by_person_)
      exercise_.clear();
    by_person_ = by_profile_ || chosen_;
    forgetCode();
  }
  trainee_ = account;
  typed_by_key_ = false;
  askInAdvance();
  list();
}

void StartChoice::typeTrainee(const std::string& text, bool by_key) {
  typed_name_ = text;
  const std::string typed = lowerCase(text);
  const auto named = std::find_if(
      lists_.trainees.begin(), lists_.trainees.end(),
      [&](const std::string& name) { return lowerCase(name) == typed || lowerCase(shown(name)) == typed; });
  // the very same letters come first
  const bool same = std::find(lists_.trainees.begin(), lists_.trainees.end(), text) != lists_.trainees.end();
  chooseTrainee(same || named == lists_.trainees.end() ? text : *named);
  typed_by_key_ = by_key;
}

void StartChoice::showAllTrainees() {
  typed_name_.clear();
  list();
}

bool StartChoice::mayBeBadge() const {
  return typed_by_key_ && !trainee_.empty() && !lists_.asks_code.empty() &&
         std::find(lists_.trainees.begin(), lists_.trainees.end(), trainee_) == lists_.trainees.end();
}

void StartChoice::chooseExercise(int index) {
  if (index < 0 || index >= static_cast<int>(exercises_.size())) return;
  const LessonChoice& chosen = exercises_[static_cast<std::size_t>(index)].choice;
  exercise_ = chosen.exercise;
  by_profile_ = chosen.by_profile;
  by_person_ = true;
  chosen_ = by_profile_ ? std::nullopt : std::optional(exercise_);
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
  if (trainee_.empty() && server_) return "Who is practising? Choose or type a name.";
  if (!trainee_.empty())
    if (const Status valid = checkName("this name", trainee_); !valid.ok()) return valid.error().message;
  if (mayBeBadge())
    return "No trainee here has this name. Backspace corrects it; to type a new name, click the field first.";
  if (exercises_.empty())
    return !server_ ? "This station has no server and no stored lessons: ask the instructor."
           : server_away_
               ? "The server cannot be reached, and no lessons are stored here: ask the instructor."
               : "No lessons here yet: wait for the server.";
  const int index = exercise();
  if (index < 0) return "Choose an exercise to practise.";
  const ExerciseRow& chosen = exercises_[static_cast<std::size_t>(index)];
  if (!chosen.usable) return chosen.name + ": " + chosen.note;
  // if the station's own question is unanswered, the server asks, if it still needs to
  if (codeQuestion() == nullptr || (asksWithoutServer() && code_.empty())) return {};
  const Status valid = checkCode(code_);
  if (valid.ok()) return {};
  if (code_.size() >= kMinCodeBytes) return valid.error().message;
  return fmt::format(
      "The server asks for a code: type it, {} characters or more, or hold the badge to the reader.",
      kMinCodeBytes);
}

}  // namespace needlelab
