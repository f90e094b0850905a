#include "client/station/run/lesson/ladder.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>

#include "client/station/run/io/terminal.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

// leaves a few working days; a longer time would mark every step of a one-week course
constexpr std::int64_t kSoon_ns = 3LL * 24 * 3600 * 1'000'000'000;

template <typename List>
bool holds(const List& list, const std::string& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

DueState dueOf(const StepStanding& standing, std::int64_t now_unix_ns) {
  if (standing.due_unix_ns == 0 || standing.done) return DueState::kNone;
  if (standing.due_unix_ns < now_unix_ns) return DueState::kOver;
  return standing.due_unix_ns - now_unix_ns <= kSoon_ns ? DueState::kSoon : DueState::kLater;
}

/// Makes the steps of one ladder.
class StepMaker {
 public:
  StepMaker(const Curriculum& curriculum, const TraineeStanding* standing, std::int64_t now_unix_ns)
      : now_unix_ns_(now_unix_ns) {
    std::map<std::string, int> lengths;
    for (const ServerExercise& exercise : curriculum.exercises)
      places_[exercise.exercise_id] = {&exercise, ++lengths[exercise.course_id]};
    if (standing != nullptr)
      for (const StepStanding& step : standing->steps) standings_[step.exercise_id] = &step;
  }

  LadderStep make(const ServerExercise& exercise, bool in_course) const {
    LadderStep step;
    step.exercise_id = exercise.exercise_id;
    step.name = exercise.name.empty() ? exercise.exercise_id : exercise.name;
    step.description = exercise.description;
    step.exam = exercise.exam;
    if (in_course) step.number = places_.at(exercise.exercise_id).number;
    const auto at = standings_.find(exercise.exercise_id);
    if (at == standings_.end()) return step;
    const StepStanding& standing = *at->second;
    for (const std::string& id : standing.locked_by)
      step.locked_by += (step.locked_by.empty() ? "" : ", ") + nameFor(id, exercise, in_course);
    step.attempts = standing.attempts;
    step.attempts_left = standing.attempts_left;
    step.due_unix_ns = standing.due_unix_ns;
    step.due = dueOf(standing, now_unix_ns_);
    step.may_begin = standing.locked_by.empty() && standing.attempts_left != 0u;
    step.state = standing.done                  ? StepState::kDone
                 : !standing.locked_by.empty()  ? StepState::kLocked
                 : standing.attempts_left == 0u ? StepState::kUsedUp
                                                : StepState::kOpen;
    return step;
  }

 private:
  struct Place {
    const ServerExercise* exercise = nullptr;
    int number = 0;
  };
  // "step 2" beside the steps of the same course, elsewhere the name in quotes
  [[nodiscard]] std::string nameFor(const std::string& id, const ServerExercise& beside,
                                    bool in_course) const {
    const auto at = places_.find(id);
    if (at == places_.end()) return "\"" + id + "\"";
    const ServerExercise& exercise = *at->second.exercise;
    if (in_course && exercise.course_id == beside.course_id) return fmt::format("step {}", at->second.number);
    return "\"" + (exercise.name.empty() ? id : exercise.name) + "\"";
  }

  const std::int64_t now_unix_ns_;
  std::map<std::string, Place> places_;
  std::map<std::string, const StepStanding*> standings_;
};

/// For a step that is not done. The console and `needlelab-admin results` use the same words.
std::string triedText(std::uint32_t attempts) {
  return attempts == 0   ? "not begun"
         : attempts == 1 ? "not passed, 1 attempt"
                         : fmt::format("not passed, {} attempts", attempts);
}

}  // namespace

std::string attemptsLeftText(std::uint32_t left) {
  return left == 0 ? "no attempt left" : left == 1 ? "1 attempt left" : fmt::format("{} attempts left", left);
}

Ladder ladderOf(const Curriculum& curriculum, const std::string& trainee, std::int64_t now_unix_ns) {
  const auto known = curriculum.standings.find(trainee);
  const TraineeStanding* const standing = known != curriculum.standings.end() ? &known->second : nullptr;
  const StepMaker steps(curriculum, standing, now_unix_ns);
  Ladder ladder;
  if (standing != nullptr) ladder.as_of_unix_ns = standing->as_of_unix_ns;

  std::vector<LadderSection> assigned, free;
  LadderSection single{"Assigned to you", {}};
  std::string course;  // of the section being filled
  for (const ServerExercise& exercise : curriculum.exercises) {
    if (!canStart(exercise, standing)) continue;
    const bool of_course = standing != nullptr && holds(standing->courses, exercise.course_id);
    auto& sections = of_course ? assigned : free;
    if (exercise.course_id != course || (assigned.empty() && free.empty())) {
      const bool freely = standing != nullptr && !of_course;
      sections.push_back({(freely ? "Practise freely: " : "") + exercise.course, {}});
      course = exercise.course_id;
    }
    if (!of_course && standing != nullptr && holds(standing->exercises, exercise.exercise_id))
      single.steps.push_back(steps.make(exercise, false));
    else
      sections.back().steps.push_back(steps.make(exercise, true));
  }
  for (LadderSection& section : assigned) ladder.sections.push_back(std::move(section));
  ladder.sections.push_back(std::move(single));

  // marks the first open step of the assigned ones
  for (LadderSection& section : ladder.sections)
    for (LadderStep& step : section.steps)
      if (ladder.next.empty() && step.state == StepState::kOpen) {
        step.state = StepState::kNext;
        ladder.next = step.exercise_id;
      }
  for (LadderSection& section : free) ladder.sections.push_back(std::move(section));
  std::erase_if(ladder.sections, [](const LadderSection& section) { return section.steps.empty(); });
  return ladder;
}

std::string stepText(const LadderStep& step) {
  std::vector<std::string> parts;
  if (step.exam) parts.emplace_back("exam");
  switch (step.state) {
    case StepState::kUnknown:
      break;
    case StepState::kDone:
      parts.emplace_back("done");
      break;
    case StepState::kNext:
      parts.emplace_back("Next");
      if (step.attempts > 0) parts.push_back(triedText(step.attempts));
      break;
    case StepState::kOpen:
      parts.push_back(triedText(step.attempts));
      break;
    case StepState::kLocked:
      parts.push_back("locked by " + step.locked_by);
      break;
    case StepState::kUsedUp:
      parts.push_back(attemptsLeftText(0) + ", ask your instructor");
      break;
  }
  if (step.due == DueState::kOver)
    parts.push_back("overdue since " + localTime(step.due_unix_ns, TimeForm::kMinute));
  if (step.due == DueState::kSoon)
    parts.push_back("due soon: " + localTime(step.due_unix_ns, TimeForm::kMinute));
  if (step.due == DueState::kLater) parts.push_back("due " + localTime(step.due_unix_ns, TimeForm::kMinute));
  if (step.attempts_left && step.state != StepState::kUsedUp)
    parts.push_back(attemptsLeftText(*step.attempts_left));
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : " · ") + part;
  return text;
}

std::string stepStateName(StepState state) {
  switch (state) {
    case StepState::kUnknown:
      return "unknown";
    case StepState::kDone:
      return "done";
    case StepState::kNext:
      return "next";
    case StepState::kOpen:
      return "open";
    case StepState::kLocked:
      return "locked";
    case StepState::kUsedUp:
      return "used up";
  }
  return "unknown";
}

std::string ladderText(const Ladder& ladder, const std::string& who, bool away) {
  std::string text = who;
  if (ladder.as_of_unix_ns == 0)
    text += ": this station does not know the assignments";
  else if (away)
    text += ", as of " + localTime(ladder.as_of_unix_ns, TimeForm::kMinute);
  text += "\n";
  std::size_t id_width = 0, name_width = 0;
  for (const LadderSection& section : ladder.sections)
    for (const LadderStep& step : section.steps) {
      id_width = std::max(id_width, countCharacters(step.exercise_id) + 2);
      name_width = std::max(name_width, countCharacters(step.name) + 2);
    }
  for (const LadderSection& section : ladder.sections) {
    text += "\n" + section.heading + "\n";
    for (const LadderStep& step : section.steps) {
      std::string line = fmt::format("{:>4}  ", step.number > 0 ? fmt::format("{}.", step.number) : "-") +
                         padded(step.exercise_id, id_width) + padded(step.name, name_width) + stepText(step);
      line.erase(line.find_last_not_of(' ') + 1);
      text += line + "\n";
    }
  }
  return text;
}

}  // namespace needlelab
