#include "client/instructor/model/live/station_commands.h"

#include <utility>

#include "client/view/model/scene_view.h"
#include "common/base/text/text.h"

namespace needlelab {

bool StationCommands::ask(const pb::Request& request, std::string done_words, std::function<void()> done) {
  if (connection_.state().phase != LinkPhase::kOnline) {
    notices_.trouble("not done: there is no connection to the server now");
    return false;
  }
  ++*waiting_;
  connection_.ask(
      request,
      [this, alive = std::weak_ptr(waiting_), done_words = std::move(done_words),
       done = std::move(done)](Result<pb::Reply> reply) {
        const auto waiting = alive.lock();
        if (!waiting) return;
        --*waiting;
        if (!reply.ok()) {
          notices_.trouble("not done: " + printable(reply.error().message));
          return;
        }
        notices_.good(done_words);
        if (done) done();
      },
      OnLoss::kGiveUp);
  return true;
}

bool StationCommands::message(const std::string& station, const std::string& text) {
  if (const Status fine = checkNote("message", text, 1, kMaxNoteBytes); !fine.ok()) {
    notices_.trouble(fine.error().message);
    return false;
  }
  pb::Request request;
  request.mutable_trainee_message()->set_station(station);
  request.mutable_trainee_message()->set_text(text);
  return ask(request, "message delivered to " + station);
}

bool StationCommands::annotate(const std::string& session_id, std::uint64_t tick, const std::string& text,
                               std::function<void()> done) {
  if (session_id.empty()) {
    notices_.trouble("there is no session to annotate: the station is idle");
    return false;
  }
  if (const Status fine = checkNote("remark", text, 1, kMaxNoteBytes); !fine.ok()) {
    notices_.trouble(fine.error().message);
    return false;
  }
  pb::Request request;
  request.mutable_annotate()->set_session_id(session_id);
  request.mutable_annotate()->set_tick(tick);
  request.mutable_annotate()->set_text(text);
  return ask(request, "remark kept with the session", std::move(done));
}

void StationCommands::nextExercise(const std::string& station, const std::string& exercise_id,
                                   const std::string& exercise) {
  pb::Request request;
  request.mutable_next_exercise()->set_station(station);
  request.mutable_next_exercise()->set_exercise_id(exercise_id);
  ask(request, "next exercise of " + station + ": " + exercise);
}

void StationCommands::setAids(const std::string& station, const std::string& session_id,
                              const AidList& aids) {
  pb::Request request;
  request.mutable_set_aids()->set_station(station);
  request.mutable_set_aids()->set_session_id(session_id);
  std::string words;
  for (const int number : aids) {
    const auto aid = static_cast<pb::Exercise::Aid>(number);
    request.mutable_set_aids()->add_aids(aid);
    words += (words.empty() ? "" : ", ") + std::string(aidWord(aid));
  }
  ask(request, "shown at " + station + ": " + (words.empty() ? "nothing" : words));
}

void StationCommands::resetAids(const std::string& station, const std::string& session_id) {
  pb::Request request;
  request.mutable_set_aids()->set_station(station);
  request.mutable_set_aids()->set_session_id(session_id);
  request.mutable_set_aids()->set_reset(true);
  ask(request, "shown at " + station + ": as the exercise sets it");
}

void StationCommands::stopLesson(const std::string& station, const std::string& session_id,
                                 const std::string& reason) {
  pb::Request request;
  request.mutable_stop_lesson()->set_station(station);
  request.mutable_stop_lesson()->set_session_id(session_id);
  request.mutable_stop_lesson()->set_reason(reason);
  ask(request, "the lesson at " + station + " is stopped");
}

}  // namespace needlelab
