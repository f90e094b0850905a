#include "client/station/run/station_home.h"

#include <utility>

#include "client/station/run/say.h"
#include "client/station/run/station_key.h"
#include "common/base/clock.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

namespace needlelab {

Status StationHome::openSpool() {
  auto spool = Spool::open(options_.spool);
  if (!spool.ok()) return spool.error();
  spool_ = std::move(*spool);
  for (const std::string& note : spool_->notes()) say(note);
  for (const std::string& note : spool_->cleanUp(options_.keep, wallNowNs())) say(note);
  guard_ = std::make_unique<SpoolGuard>(*spool_, options_.keep, options_.rate_hz, say);
  guard_->report();
  return {};
}

UplinkEvents StationHome::events() {
  UplinkEvents events;
  events.report = [this](const std::string& line) {
    say(line);
    audience_.said(line);
  };
  events.trainee_message = [this](const pb::TraineeMessage& message) {
    say("message from " + message.from() + ": " + message.text());
    audience_.message(message.from(), message.text());
  };
  events.next_exercise = [this](const pb::NextExercise& next) {
    say("next exercise, says " + next.from() + ": " + next.exercise_id() + " (start it with --exercise " +
        next.exercise_id() + ")");
    audience_.nextExercise(next.from(), next.exercise_id());
  };
  events.set_aids = [this](const pb::SetAids& set) {
    requests_.setAids({set.from(), set.aids(), set.reset()});
  };
  events.stop_lesson = [this](const pb::StopLesson& stop) { requests_.stop({stop.from(), stop.reason()}); };
  return events;
}

Status StationHome::connect() {
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
  const auto waiting = spool_->unfinished(), not_safe = spool_->closedButNotSafe();
  uplink_ = std::make_unique<Uplink>(std::move(config), events());
  for (const auto& session : waiting) uplink_->add(session, false);
  for (const auto& session : not_safe) uplink_->add(session, false);
  if (!waiting.empty())
    say(std::to_string(waiting.size()) +
        " sessions of earlier runs are in the spool; they are uploaded beside this one");
  return {};
}

void StationHome::close() {
  if (uplink_) uplink_->stop();
}

}  // namespace needlelab
