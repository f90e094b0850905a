// Who practises what: spool, server, lesson.
#include <utility>

#include "base/clock.h"
#include "net/spool_lessons.h"
#include "station/say.h"
#include "station/signals.h"
#include "station/station_key.h"
#include "station/station_run.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 10s;  // for a lesson from the server

}  // namespace

Status StationRun::openSpool() {
  auto spool = Spool::open(options_.spool);
  if (!spool.ok()) return spool.error();
  spool_ = std::move(*spool);
  for (const std::string& note : spool_->notes()) say(note);
  for (const std::string& note : spool_->cleanUp(options_.keep, wallNowNs())) say(note);
  spool_guard_ = std::make_unique<SpoolGuard>(*spool_, options_.keep, options_.rate_hz, say);
  spool_guard_->report();
  return {};
}

Status StationRun::connect() {
  Result<StationKey> key = StationKey{};
  if (!options_.key_file.empty()) {
    key = loadStationKey(options_.key_file);
    if (!key.ok()) return key.error();
    // without a server, too: what is recorded now is uploaded under this name later
    if (station_.empty()) station_ = key->station;
  }
  if (!options_.server) {
    if (const auto waiting = spool_->unfinished().size(); waiting > 0)
      say(std::to_string(waiting) +
          " session(s) of before wait in the spool for a server; without --server they go on waiting");
    return {};
  }
  UplinkConfig config;
  auto tls = makeClientTls(options_.ca_file);
  if (!tls.ok()) return tls.error();
  config.client.tls = std::move(*tls);
  config.client.server = *options_.server;
  config.client.program = programText("station");
  config.client.login = stationLogin(station_, key->key);
  UplinkEvents events;
  events.say = say;
  events.trainee_message = [](const pb::TraineeMessage& message) {
    say("message from " + message.from() + ": " + message.text());
  };
  events.next_exercise = [](const pb::NextExercise& next) {
    say("next exercise, says " + next.from() + ": " + next.exercise_id() + " (start it with --exercise " +
        next.exercise_id() + ")");
  };
  const auto waiting = spool_->unfinished(), not_safe = spool_->closedButNotSafe();
  uplink_ = std::make_unique<Uplink>(std::move(config), std::move(events));
  for (const auto& session : waiting) uplink_->add(session, false);
  for (const auto& session : not_safe) uplink_->add(session, false);
  if (!waiting.empty())
    say(std::to_string(waiting.size()) +
        " sessions of earlier runs are in the spool; they are uploaded beside this one");
  return {};
}

Status StationRun::getLesson() {
  auto lesson = [&]() -> Result<StationLesson> {
    if (!options_.profile_file.empty()) return lessonOfFile(options_);
    const LessonCache cache(options_.spool);
    auto cached = cache.find(options_.exercise);
    if (!cached.ok() && cached.error().code == ErrorCode::kInvalidInput)
      return cached.error();  // no id at all
    if (uplink_) {
      auto fetched = uplink_->getLesson(options_.exercise, options_.trainee, kPatience, cached.ok(),
                                        [this] { return signalWithin(signals_, 0ms) != 0; });
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
