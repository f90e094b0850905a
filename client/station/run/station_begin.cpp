// Who practises what: the lesson, from the server, the cache or a file.
#include <utility>

#include "client/net/lesson_cache.h"
#include "client/station/run/say.h"
#include "client/station/run/signals.h"
#include "client/station/run/station_run.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 10s;  // for a lesson from the server

}  // namespace

// a signal ends the program, a person's word only this lesson
bool StationRun::isStopped() {
  if (signalWithin(signals_, 0ms) != 0) interrupted_ = true;
  if (auto stop = home_.requests().takeStop()) stopped_ = std::move(stop);
  return interrupted_ || stopped_;
}

Status StationRun::getLesson() {
  auto lesson = [&]() -> Result<StationLesson> {
    if (!options_.profile_file.empty()) return lessonOfFile(options_);
    const LessonCache cache(options_.spool);
    auto cached = cache.find(options_.exercise);
    if (!cached.ok() && cached.error().code == ErrorCode::kInvalidInput)
      return cached.error();  // no id at all
    if (Uplink* uplink = home_.uplink()) {
      auto fetched = uplink->getLesson(options_.exercise, options_.trainee, kPatience, cached.ok(),
                                       [this] { return isStopped(); });
      if (fetched.ok()) {
        if (auto kept = cache.keep(options_.exercise, *fetched); !kept.ok())
          say("the lesson is not cached: " + kept.error().message);
        return lessonOfMessage(options_, *fetched);
      }
      // a server that answers "no" is believed; one that is away is not waited for
      if (fetched.error().code != ErrorCode::kUnavailable) return fetched.error();
      if (!cached.ok())
        return Error{fetched.error().code, fetched.error().message + ", and " + cached.error().message};
      say("the server is away (" + fetched.error().message + "); exercise " + options_.exercise +
          " comes from the cache, the samples wait in the spool");
    }
    if (!cached.ok())
      return Error{ErrorCode::kInvalidInput, cached.error().message + "; give --server, or --profile FILE"};
    auto usable = lessonOfMessage(options_, *cached);
    if (!usable.ok())
      return Error{usable.error().code, "the cached lesson " + options_.exercise +
                                            " cannot be used: " + usable.error().message +
                                            "; connect to the server once, which gives it anew"};
    say("exercise " + options_.exercise + " from the cache: profile " + usable->profile.id() + ", revision " +
        std::to_string(usable->profile_revision));
    return usable;
  }();
  if (!lesson.ok()) return lesson.error();
  lesson_ = std::move(*lesson);
  for (const std::string& warning : lesson_.warnings) say("profile " + lesson_.profile.id() + ": " + warning);
  return {};
}

}  // namespace needlelab
