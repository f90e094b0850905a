#include "client/instructor/terminal/words.h"

#include <cmath>
#include <utility>

#include "common/profile/aid_list.h"

namespace needlelab {

Words::Words(const InstructorOptions& options, Ask ask, Tell tell)
    : options_(options), ask_(std::move(ask)), tell_(std::move(tell)) {
  const auto add = [this](const char* what, When when, const char* done) -> pb::Request& {
    waiting_.push_back({what, when, {}, done});
    return waiting_.back().request;
  };
  if (!options.message.empty()) {
    auto& message = *add("message", When::kOnline, "message sent").mutable_trainee_message();
    message.set_station(options.station);
    message.set_text(options.message);
  }
  if (!options.next_exercise.empty()) {
    auto& next = *add("next exercise", When::kOnline, "next exercise set").mutable_next_exercise();
    next.set_station(options.station);
    next.set_exercise_id(options.next_exercise);
  }
  if (!options.aids.empty()) {
    auto& aids = *add("aids", When::kInLesson, "aids changed").mutable_set_aids();
    aids.set_station(options.station);
    aids.set_reset(options.aids == kResetAids);
    if (!aids.reset()) *aids.mutable_aids() = *parseAids(options.aids);
  }
  if (!options.annotate.empty()) {
    const When when = options.at_s ? When::kInLesson : When::kAtMoment;
    add("annotate", when, "noted").mutable_annotate()->set_text(options.annotate);
  }
  // last: it ends the lesson that the others are about
  if (options.stop) {
    const When when =
        waiting_.empty() || waiting_.back().when != When::kAtMoment ? When::kInLesson : When::kAtMoment;
    auto& stop = *add("stop", when, "lesson stopped").mutable_stop_lesson();
    stop.set_station(options.station);
    stop.set_reason(options.stop_reason);
  }
}

void Words::online() {
  sayAll(When::kOnline, [](pb::Request&) {});
}

void Words::lesson(const std::string& session_id) {
  sayAll(When::kInLesson, [&](pb::Request& request) {
    // the lesson that is seen now is the one that is meant
    if (request.has_set_aids()) request.mutable_set_aids()->set_session_id(session_id);
    if (request.has_stop_lesson()) request.mutable_stop_lesson()->set_session_id(session_id);
    if (request.has_annotate()) request.mutable_annotate()->set_session_id(session_id);
  });
}

void Words::moment(const std::string& session_id, std::uint64_t tick) {
  lesson(session_id);
  sayAll(When::kAtMoment, [&](pb::Request& request) {
    if (request.has_stop_lesson()) request.mutable_stop_lesson()->set_session_id(session_id);
    if (!request.has_annotate()) return;
    request.mutable_annotate()->set_session_id(session_id);
    request.mutable_annotate()->set_tick(tick);
  });
}

void Words::onStored() {
  if (!options_.session.empty() && options_.at_s) lesson(sessionBytes(options_));
}

void Words::sayAll(When when, const std::function<void(pb::Request&)>& complete) {
  std::vector<Word> left;
  for (Word& word : std::exchange(waiting_, {})) {
    if (word.when != when) {
      left.push_back(std::move(word));
      continue;
    }
    complete(word.request);
    say(std::move(word));
  }
  waiting_ = std::move(left);
}

void Words::say(Word word) {
  Result<pb::Reply> reply = [&]() -> Result<pb::Reply> {
    if (word.request.has_annotate() && options_.at_s) {
      const auto tick = tickAt(word.request.annotate().session_id(), *options_.at_s);
      if (!tick.ok()) return tick.error();
      word.request.mutable_annotate()->set_tick(*tick);
    }
    return ask_(word.request);
  }();
  if (!reply.ok() && !refused_) refused_ = reply.error();
  tell_(word.what, reply.ok(), reply.ok() ? word.done : reply.error().message);
}

/// Ticks of a session begin with that of its first sample.
Result<std::uint64_t> Words::tickAt(const std::string& session_id, double at_s) const {
  pb::Request request;
  request.mutable_get_session()->set_session_id(session_id);
  const auto info = ask_(request);
  if (!info.ok()) return info.error();
  std::uint64_t first = 0;
  request.mutable_seek_session()->set_session_id(session_id);
  request.mutable_seek_session()->set_seconds(0);
  // one that has just begun, or whose recording retention has deleted, has nothing to seek in
  if (const auto sought = ask_(request); sought.ok()) first = sought->sought().recording_first_tick();
  return first + static_cast<std::uint64_t>(std::llround(at_s * info->session().description().rate_hz()));
}

}  // namespace needlelab
