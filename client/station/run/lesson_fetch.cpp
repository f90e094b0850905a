#include "client/station/run/lesson_fetch.h"

#include <fmt/core.h>

#include <chrono>
#include <string>
#include <utility>

#include "client/net/lesson_cache.h"
#include "client/net/uplink.h"
#include "client/station/run/curriculum.h"
#include "client/station/run/terminal.h"
#include "common/base/secret.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr auto kLessonPatience = 10s;  // time limit for a lesson from the server
constexpr auto kCheckPatience = 3s;    // for its word on the trainee alone, which a lesson does not need

// what the server says of the trainee, with a lesson or alone
const pb::Lesson& ofTrainee(const pb::Lesson& lesson) {
  return lesson;
}
const pb::TraineeChecked& ofTrainee(const pb::Reply& reply) {
  return reply.trainee_checked();
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

  StationHome& home_;
  const StationOptions& options_;
  GivenCode& code_;
  const std::function<bool()>& stopped_;
  bool code_asked_ = false;    // by the server, for this lesson
  bool code_checked_ = false;  // it accepted it
  std::string person_;         // as the server says it
};

// asks the server with the trainee's code, and again while it is missing or wrong and somebody gives another;
// kCode, too, when a server that is there does not say in time whether it is right
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

// for the time without the server: it alone knows who has a code
void LessonFetch::keepAsksCode(bool asks) const {
  if (const Status kept =
          CurriculumCache(options_.spool, options_.key_file).keepAsksCode(options_.trainee, asks);
      !kept.ok())
    logMessage("it is not kept whether a code is asked for: " + kept.error().message);
}

// a profile from a file needs no server; but one that is there says whether it knows the trainee
Status LessonFetch::checkTrainee() {
  Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return {};
  bool code_sent = false;
  std::chrono::seconds patience = kCheckPatience;
  const auto reply = askWithCode([&](const std::string& code) {
    pb::Request request;
    request.mutable_check_trainee()->set_trainee(options_.trainee);
    request.mutable_check_trainee()->set_code(code);
    // whoever typed a code waits for its check
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
  // kDenied also comes when the server refuses the station itself, whose lesson goes on without it
  const bool said_no = code == ErrorCode::kNotFound ||
                       (code == ErrorCode::kDenied && !uplink->state().denied) ||
                       ((code_asked_ || code_sent) && code != ErrorCode::kUnavailable);
  return said_no ? Status(reply.error()) : Status();
}

Result<StationLesson> LessonFetch::get() {
  if (!options_.profile_file.empty()) {
    RETURN_IF_ERROR(checkTrainee());
    return lessonOfFile(options_);
  }
  const LessonCache cache(options_.spool);
  auto cached = cache.find(options_.exercise);
  if (!cached.ok() && cached.error().code == ErrorCode::kInvalidInput) return cached.error();  // no id at all
  if (Uplink* uplink = home_.uplink()) {
    const auto fetched = askWithCode([&](const std::string& code) {
      return uplink->getLesson(options_.exercise, options_.trainee, kLessonPatience, cached.ok(), stopped_,
                               code);
    });
    if (fetched.ok()) {
      pb::Lesson of_anyone = *fetched;
      of_anyone.clear_person_ref();
      if (auto kept = cache.keep(options_.exercise, of_anyone); !kept.ok())
        logMessage("the lesson is not cached: " + kept.error().message);
      return lessonOfMessage(options_, *fetched);
    }
    // accepts the server's refusal; does not wait for an absent server
    if (fetched.error().code != ErrorCode::kUnavailable) return fetched.error();
    if (!cached.ok())
      return Error{fetched.error().code, fetched.error().message + ", and " + cached.error().message};
    logMessage("the server is away (" + fetched.error().message + "); exercise " + options_.exercise +
               " comes from the cache, the samples wait in the spool");
  }
  if (!cached.ok())
    return Error{ErrorCode::kInvalidInput, cached.error().message + "; give --server, or --profile FILE"};
  auto usable = lessonOfMessage(options_, *cached);
  if (!usable.ok())
    return Error{usable.error().code, "the cached lesson " + options_.exercise +
                                          " cannot be used: " + usable.error().message +
                                          "; connect to the server once, which gives it anew"};
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
  // the lesson needs it no longer
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
