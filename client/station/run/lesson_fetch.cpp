#include "client/station/run/station_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "client/net/spool/lesson_cache.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/built_in.h"
#include "client/station/run/lesson/curriculum.h"
#include "common/base/secret.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr auto kLessonPatience = 10s;  // time limit for a lesson from the server
constexpr auto kCheckPatience = 3s;    // time limit for a check of the trainee alone, which a lesson does not
                                       // need

// what the server reports about the trainee, with a lesson or alone
const pb::Lesson& ofTrainee(const pb::Lesson& lesson) {
  return lesson;
}
const pb::TraineeChecked& ofTrainee(const pb::Reply& reply) {
  return reply.trainee_checked();
}

// removes what belongs to one trainee
pb::Lesson lessonOfAnyone(pb::Lesson lesson) {
  lesson.clear_person_ref();
  lesson.clear_code_checked();
  lesson.clear_attempt();
  lesson.clear_attempts_left();
  lesson.clear_due_unix_ns();
  return lesson;
}

const TraineeStanding* standingIn(const Curriculum& curriculum, const std::string& trainee) {
  const auto known = curriculum.standings.find(trainee);
  return known != curriculum.standings.end() ? &known->second : nullptr;
}

const ServerExercise* exerciseIn(const Curriculum& curriculum, const std::string& id) {
  for (const ServerExercise& exercise : curriculum.exercises)
    if (exercise.exercise_id == id) return &exercise;
  return nullptr;
}

// names of exercises that this trainee can practise without the server
std::vector<std::string> lessonsKept(const StationOptions& options) {
  const Curriculum curriculum = CurriculumCache(options.spool, options.key_file).find();
  const TraineeStanding* const standing = standingIn(curriculum, options.trainee);
  std::vector<std::string> names;
  if (practisesAlone(options))
    for (const ListedExercise& exercise : builtInExercises()) names.push_back(exercise.name);
  for (const CachedLesson& lesson : LessonCache(options.spool).list()) {
    const ServerExercise* const exercise = exerciseIn(curriculum, lesson.exercise_id);
    const bool may = exercise != nullptr ? canStart(*exercise, standing) : !lesson.assigned_only;
    if (lesson.trouble.empty() && may)
      names.push_back(lesson.name.empty() ? lesson.exercise_id : lesson.name);
  }
  return names;
}

class LessonFetch {
 public:
  LessonFetch(StationHome& home, const StationOptions& options, GivenCode& code,
              const std::function<bool()>& stopped)
      : home_(home), options_(options), code_(code), stopped_(stopped) {}

  Result<StationLesson> get();
  [[nodiscard]] bool codeChecked() const { return code_checked_; }
  [[nodiscard]] const std::string& person() const { return person_; }

 private:
  template <typename Ask>
  auto askWithCode(Ask&& ask);
  void keepAsksCode(bool asks) const;
  Status checkTrainee();
  Status mayBeginAlone(pb::Lesson& lesson) const;
  [[nodiscard]] Error needsServer() const;

  StationHome& home_;
  const StationOptions& options_;
  GivenCode& code_;
  const std::function<bool()>& stopped_;
  bool code_asked_ = false;    // by the server, for this lesson
  bool code_checked_ = false;  // the server accepted it
  std::string person_;         // as the server reports it
};

// Asks the server with the trainee's code; repeats while the code is missing or wrong and a person gives
// another. Also returns kCode if a reachable server does not check the code in time.
template <typename Ask>
auto LessonFetch::askWithCode(Ask&& ask) {
  for (;;) {
    auto reply = ask(code_.code);
    if (reply.ok()) {
      code_checked_ = ofTrainee(*reply).code_checked();
      person_ = ofTrainee(*reply).person_ref();
      keepAsksCode(code_checked_);
      return reply;
    }
    const bool silent = reply.error().code == ErrorCode::kUnavailable && home_.uplink()->state().connected;
    if (silent && (code_asked_ || !code_.code.empty()) && !stopped_())
      return decltype(reply)(Error{ErrorCode::kCode, "the server is busy: try again"});
    if (reply.error().code != ErrorCode::kCode) return reply;
    code_asked_ = true;
    keepAsksCode(true);
    if (!code_.ask) return reply;
    auto given = code_.ask(reply.error(), stopped_);
    if (!given.ok()) return decltype(reply)(given.error());
    wipe(code_.code);
    code_.code = std::move(*given);
  }
}

// for times without the server, which alone knows who has a code
void LessonFetch::keepAsksCode(bool asks) const {
  if (const Status kept =
          CurriculumCache(options_.spool, options_.key_file).keepAsksCode(options_.trainee, asks);
      !kept.ok())
    logMessage("this station could not save whether the server asks for a code: " + kept.error().message);
}

// a profile from a file needs no server, but a reachable one says whether it knows the trainee
Status LessonFetch::checkTrainee() {
  Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return {};
  bool code_sent = false;
  std::chrono::seconds patience = kCheckPatience;
  const auto reply = askWithCode([&](const std::string& code) {
    pb::Request request;
    request.mutable_check_trainee()->set_trainee(options_.trainee);
    request.mutable_check_trainee()->set_code(code);
    // a person who typed a code waits for its check
    code_sent = !code.empty();
    patience = code_sent ? kLessonPatience : kCheckPatience;
    return uplink->ask(std::move(request), patience, true, stopped_);
  });
  if (reply.ok()) return {};
  if (stopped_()) return reply.error();
  const ErrorCode code = reply.error().code;
  if (code == ErrorCode::kUnavailable)
    logMessage(fmt::format("the server did not say within {} s whether it knows the trainee ({})",
                           patience.count(), reply.error().message));
  // kDenied may also mean that the server refuses the station; its lesson then continues without the server
  const bool is_refusal = code == ErrorCode::kNotFound ||
                          (code == ErrorCode::kDenied && !uplink->state().denied) ||
                          ((code_asked_ || code_sent) && code != ErrorCode::kUnavailable);
  return is_refusal ? Status(reply.error()) : Status();
}

// counts an exam's attempts as far as this station knows them; the server counts them all
Status LessonFetch::mayBeginAlone(pb::Lesson& lesson) const {
  const Curriculum kept = CurriculumCache(options_.spool, options_.key_file).find();
  const TraineeStanding* const standing = standingIn(kept, options_.trainee);
  const ServerExercise* const exercise = exerciseIn(kept, options_.exercise);
  // the server's last report may be newer than the lesson
  const bool exam = lesson.exam() || (exercise != nullptr && exercise->exam);
  const bool assigned_only = lesson.assigned_only() || (exercise != nullptr && exercise->assigned_only);
  if (!assigned_only) return {};
  const std::string name = "\"" + (exercise != nullptr ? exercise->name : options_.exercise) + "\"";
  if (exercise == nullptr || standing == nullptr || !canStart(*exercise, standing))
    return Error{ErrorCode::kDenied, name +
                                         " is only for those to whom it is assigned. The server cannot be "
                                         "reached, and this station does not know that it is assigned to "
                                         "you: ask the instructor"};
  for (const StepStanding& step : standing->steps) {
    if (step.exercise_id != options_.exercise || !exam) continue;
    if (step.attempts_left == 0u)
      return Error{ErrorCode::kDenied, name + ": no attempt is left; ask the instructor"};
    if (!step.locked_by.empty())
      return Error{ErrorCode::kDenied, name + " is still locked: others of the exam come first"};
    if (step.attempts_left) lesson.set_attempts_left(*step.attempts_left);
  }
  return {};
}

// says what the trainee can do now
Error LessonFetch::needsServer() const {
  constexpr std::size_t kMaxNames = 8;
  const std::vector<std::string> kept = lessonsKept(options_);
  std::string names;
  for (std::size_t i = 0; i < std::min(kept.size(), kMaxNames); ++i)
    names += (i == 0 ? "\"" : ", \"") + kept[i] + "\"";
  if (kept.size() > kMaxNames) names += fmt::format(" and {} more", kept.size() - kMaxNames);
  const bool has_server = home_.uplink() != nullptr;
  const std::string why = has_server ? "The server cannot be reached" : "This station has no server";
  return {has_server ? ErrorCode::kUnavailable : ErrorCode::kInvalidInput,
          kept.empty()
              ? (has_server ? why + ", and no lessons are stored here" : why + " and no stored lessons") +
                    ": ask the instructor."
              : why + ". These lessons are stored here: " + names +
                    ". Others need the server: ask the instructor."};
}

Result<StationLesson> LessonFetch::get() {
  if (!options_.profile_file.empty()) {
    RETURN_IF_ERROR(checkTrainee());
    return lessonOfFile(options_);
  }
  const LessonCache cache(options_.spool);
  auto cached = cache.find(options_.exercise);
  if (!cached.ok() && cached.error().code == ErrorCode::kInvalidInput) return cached.error();  // invalid id
  if (Uplink* uplink = home_.uplink()) {
    const auto fetched = askWithCode([&](const std::string& code) {
      return uplink->getLesson(options_.exercise, options_.trainee, kLessonPatience, cached.ok(), stopped_,
                               code);
    });
    if (fetched.ok()) {
      if (auto kept = cache.keep(options_.exercise, lessonOfAnyone(*fetched)); !kept.ok())
        logMessage("the lesson is not cached: " + kept.error().message);
      return lessonOfMessage(options_, *fetched);
    }
    // accepts a refusal; does not wait for an absent server
    if (fetched.error().code != ErrorCode::kUnavailable) return fetched.error();
    logMessage("the server is away (" + fetched.error().message + ")" +
               (cached.ok() ? "; exercise " + options_.exercise +
                                  " comes from the cache, the samples wait in the spool"
                            : ""));
  }
  if (practisesAlone(options_)) {
    const auto built_in = builtInLesson(options_.exercise);
    if (!built_in.ok()) return needsServer();
    logMessage("exercise " + options_.exercise + " is built in; its recording stays in the spool");
    return lessonOfMessage(options_, *built_in);
  }
  if (!cached.ok()) {
    logMessage(cached.error().message);
    return needsServer();
  }
  RETURN_IF_ERROR(mayBeginAlone(*cached));
  auto usable = lessonOfMessage(options_, *cached);
  if (!usable.ok())
    return Error{usable.error().code, "exercise " + options_.exercise +
                                          " is kept here, but it cannot be used (" + usable.error().message +
                                          "): it needs the server once; ask the instructor"};
  logMessage(fmt::format("exercise {} from the cache: profile {}, revision {}", options_.exercise,
                         usable->profile.id(), usable->profile_revision));
  return usable;
}

}  // namespace

Result<FetchedLesson> fetchLesson(StationHome& home, const StationOptions& options, GivenCode& code,
                                  const std::function<bool()>& stopped) {
  LessonFetch fetch(home, options, code, stopped);
  FetchedLesson fetched;
  ASSIGN_OR_RETURN(fetched.lesson, fetch.get());
  for (const std::string& warning : fetched.lesson.warnings)
    logMessage("profile " + fetched.lesson.profile.id() + ": " + warning);
  // the lesson no longer needs it
  wipe(code.code);
  code.ask = nullptr;
  fetched.code_checked = fetch.codeChecked();
  const CurriculumCache kept(options.spool, options.key_file);
  fetched.code_unchecked = !fetched.code_checked && kept.asksCode(options.trainee);
  fetched.person = fetch.person().empty() ? personOf(kept.find().trainees, options.trainee) : fetch.person();
  if (fetched.code_unchecked) logMessage(kCodeUnchecked);
  return fetched;
}

}  // namespace needlelab
