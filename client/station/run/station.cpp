#include "client/station/run/station.h"

#include <fmt/core.h>

#include <utility>

#include "client/station/run/io/station_key.h"
#include "client/station/run/io/terminal.h"
#include "common/base/program.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

namespace needlelab {

Status StationHome::openSpool() {
  ASSIGN_OR_RETURN(spool_, Spool::open(options_.spool));
  for (const std::string& note : spool_->notes()) logMessage(note);
  for (const std::string& note : spool_->cleanUp(options_.keep)) logMessage(note);
  guard_ = std::make_unique<SpoolGuard>(*spool_, options_.keep, options_.rate_hz, logMessage,
                                        SpoolThresholds{}, time_);
  guard_->report();
  return {};
}

UplinkEvents StationHome::events() {
  UplinkEvents events;
  events.report = logMessage;
  events.trainee_message = [this](const pb::TraineeMessage& message) {
    logMessage("message from " + message.from() + ": " + message.text());
    observer_.message(message.from(), message.text());
  };
  events.next_exercise = [this](const pb::NextExercise& next) {
    logMessage("next exercise, says " + next.from() + ": " + next.exercise_id() +
               " (start it with --exercise " + next.exercise_id() + ")");
    observer_.nextExercise(next.from(), next.exercise_id());
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
    // even without a server, for a later upload
    if (station_.empty()) station_ = key->station;
  }
  if (options_.servers.empty()) {
    if (const auto waiting = spool_->unfinished().size(); waiting > 0)
      logMessage(fmt::format(
          "{} earlier session(s) wait in the spool for a server; without --server they stay there", waiting));
    return {};
  }
  UplinkConfig config;
  ASSIGN_OR_RETURN(config.client.tls, makeClientTls(options_.ca_file));
  config.clock = std::make_shared<LinkClock>(time_);
  config.client.setServers(options_.servers);
  config.client.program = programText("station");
  config.client.login = stationLogin(station_, key->key);
  const auto waiting = spool_->unfinished(), not_safe = spool_->closedButNotSafe();
  uplink_ = std::make_unique<Uplink>(std::move(config), events());
  for (const auto& session : waiting) uplink_->add(session, false);
  for (const auto& session : not_safe) uplink_->add(session, false);
  if (!waiting.empty())
    logMessage(fmt::format("{} sessions of earlier runs are in the spool; they are uploaded beside this one",
                           waiting.size()));
  return {};
}

void StationHome::close() {
  if (uplink_) uplink_->stop();
}

}  // namespace needlelab
