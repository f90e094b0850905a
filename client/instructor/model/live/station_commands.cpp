#include "client/instructor/model/live/station_commands.h"

#include <utility>

#include <fmt/core.h>

#include "client/view/model/scene_view.h"
#include "common/base/text/text.h"

namespace needlelab {

bool StationCommands::askEach(const std::vector<Addressee>& to, const Fill& fill, std::string done_words,
                              std::function<void()> done) {
  if (to.empty()) return false;
  if (connection_.state().phase != LinkPhase::kOnline) {
    notices_.trouble("not done: there is no connection to the server now");
    return false;
  }
  struct Answers {
    std::size_t left = 0, read = 0;
    std::string names, why;  // of those that did not take it
  };
  const auto answers = std::make_shared<Answers>();
  answers->left = to.size();
  *waiting_ += to.size();
  for (const Addressee& each : to) {
    pb::Request request;
    fill(each, request);
    connection_.ask(
        request,
        [this, alive = std::weak_ptr(waiting_), answers, station = each.station, all = to.size(), done_words,
         done](Result<pb::Reply> reply) {
          const auto waiting = alive.lock();
          if (!waiting) return;
          --*waiting;
          if (reply.ok()) {
            ++answers->read;
          } else {
            answers->names += (answers->names.empty() ? "" : ", ") + station;
            answers->why = reply.error().message;
          }
          if (--answers->left > 0) return;
          if (answers->read < all)
            notices_.trouble("not done" + (all > 1 ? " at " + answers->names : "") + ": " +
                             printable(answers->why));
          if (answers->read == 0) return;
          const std::string who = all == 1 ? station : fmt::format("{} stations", answers->read);
          notices_.good(who.empty() ? done_words : who + ": " + done_words);
          if (done) done();
        },
        OnLoss::kGiveUp);
  }
  return true;
}

bool StationCommands::message(const std::vector<Addressee>& to, const std::string& text) {
  if (const Status fine = checkNote("message", text, 1, kMaxNoteBytes); !fine.ok()) {
    notices_.trouble(fine.error().message);
    return false;
  }
  return askEach(
      to,
      [&](const Addressee& each, pb::Request& request) {
        request.mutable_trainee_message()->set_station(each.station);
        request.mutable_trainee_message()->set_text(text);
      },
      "message delivered");
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
  return askEach(
      {{"", session_id}},
      [&](const Addressee& each, pb::Request& request) {
        request.mutable_annotate()->set_session_id(each.session_id);
        request.mutable_annotate()->set_tick(tick);
        request.mutable_annotate()->set_text(text);
      },
      "remark kept with the session", std::move(done));
}

void StationCommands::nextExercise(const std::vector<Addressee>& to, const std::string& exercise_id,
                                   const std::string& exercise) {
  askEach(
      to,
      [&](const Addressee& each, pb::Request& request) {
        request.mutable_next_exercise()->set_station(each.station);
        request.mutable_next_exercise()->set_exercise_id(exercise_id);
      },
      "next exercise: " + exercise);
}

void StationCommands::setAids(const std::vector<Addressee>& to, const AidList& aids) {
  std::string words;
  for (const int number : aids)
    words += (words.empty() ? "" : ", ") + std::string(aidWord(static_cast<pb::Exercise::Aid>(number)));
  askEach(
      to,
      [&](const Addressee& each, pb::Request& request) {
        auto& asked = *request.mutable_set_aids();
        asked.set_station(each.station);
        asked.set_session_id(each.session_id);
        for (const int number : aids) asked.add_aids(static_cast<pb::Exercise::Aid>(number));
      },
      "shown now: " + (words.empty() ? "nothing" : words));
}

void StationCommands::resetAids(const std::vector<Addressee>& to) {
  askEach(
      to,
      [&](const Addressee& each, pb::Request& request) {
        request.mutable_set_aids()->set_station(each.station);
        request.mutable_set_aids()->set_session_id(each.session_id);
        request.mutable_set_aids()->set_reset(true);
      },
      "shown now: as the exercise sets it");
}

void StationCommands::stopLessons(const std::vector<Addressee>& lessons, const std::string& reason) {
  askEach(
      lessons,
      [&](const Addressee& each, pb::Request& request) {
        request.mutable_stop_lesson()->set_station(each.station);
        request.mutable_stop_lesson()->set_session_id(each.session_id);
        request.mutable_stop_lesson()->set_reason(reason);
      },
      lessons.size() == 1 ? "the lesson is stopped" : "the lessons are stopped");
}

}  // namespace needlelab
