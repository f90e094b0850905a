// Messages to stations at another server: requests to that server, and its answers.
#include <fmt/core.h>
#include <utility>

#include "common/base/text/text.h"
#include "common/wire/protocol.h"
#include "server/together/remote_live.h"

namespace needlelab {
namespace {

constexpr unsigned kMaxServersAsked = 4;

std::string stationText(const std::string& station) {
  return "station '" + printable(station) + "'";
}

RemoteLive::Asked refusedOutcome(pb::Refusal::Reason reason, std::string text) {
  return {RemoteLive::Asked::Kind::kRefused, makeRefusal(reason, std::move(text))};
}

bool isSession(const std::string& id) {
  return id.empty() || id.size() == 16;
}

/// The message as the station gets it. Nothing: people may not send this kind, or it has values that the
/// asker's server would have refused.
std::optional<pb::Envelope> messageIn(const pb::StationAsk& ask) {
  pb::Envelope envelope;
  const auto fits = [&](const auto& message) {
    return message.station() == ask.station() && checkName("from", message.from()).ok();
  };
  switch (ask.message_case()) {
    case pb::StationAsk::kTraineeMessage: {
      const pb::TraineeMessage& message = ask.trainee_message();
      if (!fits(message) || !checkNote("text", message.text(), 1, kMaxNoteBytes)) return std::nullopt;
      *envelope.mutable_trainee_message() = message;
      return envelope;
    }
    case pb::StationAsk::kNextExercise: {
      const pb::NextExercise& message = ask.next_exercise();
      if (!fits(message) || !checkName("exercise_id", message.exercise_id())) return std::nullopt;
      *envelope.mutable_next_exercise() = message;
      return envelope;
    }
    case pb::StationAsk::kSetAids: {
      constexpr int kMaxAids = 64;  // as max_items
      const pb::SetAids& message = ask.set_aids();
      if (!fits(message) || message.aids_size() > kMaxAids || !isSession(message.session_id()) ||
          (message.reset() && message.aids_size() > 0))
        return std::nullopt;
      for (const int aid : message.aids())
        if (aid == 0 || !pb::Exercise::Aid_IsValid(aid)) return std::nullopt;
      *envelope.mutable_set_aids() = message;
      return envelope;
    }
    case pb::StationAsk::kStopLesson: {
      const pb::StopLesson& message = ask.stop_lesson();
      if (!fits(message) || !checkNote("reason", message.reason(), 0, kMaxNoteBytes) ||
          !isSession(message.session_id()))
        return std::nullopt;
      *envelope.mutable_stop_lesson() = message;
      return envelope;
    }
    case pb::StationAsk::MESSAGE_NOT_SET:
      break;
  }
  return std::nullopt;
}

/// False: people may not send this to a station.
bool putMessage(pb::StationAsk& ask, const pb::Envelope& message) {
  switch (message.body_case()) {
    case pb::Envelope::kTraineeMessage:
      *ask.mutable_trainee_message() = message.trainee_message();
      return true;
    case pb::Envelope::kNextExercise:
      *ask.mutable_next_exercise() = message.next_exercise();
      return true;
    case pb::Envelope::kSetAids:
      *ask.mutable_set_aids() = message.set_aids();
      return true;
    case pb::Envelope::kStopLesson:
      *ask.mutable_stop_lesson() = message.stop_lesson();
      return true;
    default:
      return false;
  }
}

}  // namespace

void RemoteLive::ask(const std::string& station, const pb::Envelope& message, AskDone done) {
  const auto found = remotes_.find(station);
  if (found == remotes_.end() || !isRemote(station)) {
    if (hub_.stationPeer(station) != nullptr) return done({Asked::Kind::kLocal, {}});
    return done(refusedOutcome(pb::Refusal::NOT_FOUND, stationText(station) + " is not online"));
  }
  const RemoteStation& remote = *found->second;
  if (!up_)
    return done(
        refusedOutcome(pb::Refusal::TIMEOUT,
                       fmt::format("{} is at server '{}', and {}: nothing was sent; try again when it is "
                                   "back",
                                   stationText(station), printable(remote.holder), trouble())));
  if (has_left_) return done(refusedOutcome(pb::Refusal::SHUTTING_DOWN, "the server is shutting down"));
  if (questions_.size() >= settings_.max_asked)
    return done(refusedOutcome(pb::Refusal::RATE_LIMITED,
                               "too many messages to stations of other servers are under way: try again"));
  Question question;
  question.station = station;
  question.ends_ns = time_.nowNs() + std::chrono::nanoseconds(settings_.ask_lasts).count();
  question.done = std::move(done);
  question.message.set_station(station);
  if (!putMessage(question.message, message))
    return question.done(
        refusedOutcome(pb::Refusal::INTERNAL, "this message is not sent to stations elsewhere"));
  // a number not used for any message; askAgain assigns the one that is answered
  const std::uint64_t number = ++numbers_[static_cast<std::size_t>(LivePlane::kAsk)];
  questions_.emplace(number, std::move(question));
  askAgain(number, remote.holder, remote.epoch);
}

/// Asks `server`, which has not been asked yet or did not have the station.
void RemoteLive::askAgain(std::uint64_t number, const std::string& server, std::uint64_t epoch) {
  auto node = questions_.extract(number);
  Question& question = node.mapped();
  pb::StationAsk& message = question.message;
  *message.mutable_origin() = origin(LivePlane::kAsk);
  message.set_server(server);
  message.set_epoch(epoch);
  question.server = server;
  question.epoch = epoch;
  question.is_asked = true;
  ++question.asked;
  ++counters_.asked;
  publish(LivePlane::kAsk, question.station, message);
  node.key() = message.origin().number();
  questions_.insert(std::move(node));
}

void RemoteLive::end(std::uint64_t number, Asked asked) {
  auto node = questions_.extract(number);
  if (!node.empty()) node.mapped().done(std::move(asked));
}

/// Ends all unanswered questions.
void RemoteLive::endQuestions(pb::Refusal::Reason reason, const std::string& why) {
  while (!questions_.empty())
    end(questions_.begin()->first,
        refusedOutcome(reason, why + ": it may not have arrived; send it again when the station is back"));
}

/// For stations that were not where they were sought, asks the servers now known to have them.
void RemoteLive::redirectQuestions(std::int64_t now_ns) {
  std::vector<std::uint64_t> numbers;
  for (const auto& [number, question] : questions_) numbers.push_back(number);
  for (const std::uint64_t number : numbers) {
    const auto found = questions_.find(number);
    if (found == questions_.end()) continue;
    const Question& question = found->second;
    const std::string name = stationText(question.station);
    if (question.is_asked) {
      if (now_ns < question.ends_ns) continue;
      ++counters_.unanswered;
      end(number, refusedOutcome(
                      pb::Refusal::TIMEOUT,
                      fmt::format("server '{}', which has {}, did not answer within {} ms: it may not have "
                                  "arrived; send it again when the station is back",
                                  printable(question.server), name, settings_.ask_lasts.count())));
      continue;
    }
    const auto remote = remotes_.find(question.station);
    if (!isRemote(question.station)) {
      if (hub_.stationPeer(question.station) != nullptr) {
        end(number, {Asked::Kind::kLocal, {}});
        continue;
      }
    } else if (remote != remotes_.end() && question.asked < kMaxServersAsked &&
               (remote->second->holder != question.server || remote->second->epoch != question.epoch)) {
      askAgain(number, remote->second->holder, remote->second->epoch);
      continue;
    }
    if (now_ns >= question.find_until_ns)
      end(number,
          refusedOutcome(pb::Refusal::NOT_FOUND, fmt::format("{} is not online: server '{}' has it no more",
                                                             name, printable(question.server))));
  }
}

bool RemoteLive::onAsk(const std::string& name, std::string_view bytes) {
  pb::StationAsk ask;
  if (bytes.size() > settings_.max_ask_bytes ||
      !ask.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || ask.station() != name ||
      !checkName("station", name))
    return malformed();
  if (!isFresh(ask.origin(), LivePlane::kAsk)) return false;
  if (ask.server() != settings_.server) return true;  // for another server
  const auto message = messageIn(ask);
  if (!message) return malformed();
  ++counters_.asked_here;
  pb::StationAnswer reply;
  const HubPeer* const peer = hub_.stationPeer(name);
  if (peer == nullptr || peer->isRemote() || isNewer(ask.epoch(), hub_.epochOf(name))) {
    pb::NotHere& not_here = *reply.mutable_not_here();
    if (const auto remote = remotes_.find(name); remote != remotes_.end()) {
      not_here.set_server(remote->second->holder);
      not_here.set_epoch(remote->second->epoch);
    }
    answer(ask, std::move(reply));
    return true;
  }
  if (!deliver_ || asked_here_ >= settings_.max_asked) {
    *reply.mutable_refused() = makeRefusal(
        pb::Refusal::RATE_LIMITED, "server '" + settings_.server + "' has too much under way: try again");
    answer(ask, std::move(reply));
    return true;
  }
  ++asked_here_;
  deliver_(name, *message,
           [this, here = std::weak_ptr<int>(alive_), ask](std::optional<pb::Refusal> refusal) {
             if (here.expired()) return;
             --asked_here_;
             pb::StationAnswer done;
             if (refusal)
               *done.mutable_refused() = *std::move(refusal);
             else
               done.set_delivered(true);
             answer(ask, std::move(done));
           });
  return true;
}

void RemoteLive::answer(const pb::StationAsk& ask, pb::StationAnswer answer) {
  *answer.mutable_origin() = origin(LivePlane::kAnswer);
  answer.set_server(ask.origin().server());
  answer.set_instance(ask.origin().instance());
  answer.set_number(ask.origin().number());
  publish(LivePlane::kAnswer, ask.origin().server(), answer);
}

bool RemoteLive::onAnswer(std::string_view bytes) {
  pb::StationAnswer answer;
  if (bytes.size() > settings_.max_ask_bytes ||
      !answer.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return malformed();
  if (!isFresh(answer.origin(), LivePlane::kAnswer)) return false;
  if (answer.server() != settings_.server || answer.instance() != settings_.instance) return stale();
  const auto found = questions_.find(answer.number());
  if (found == questions_.end()) return stale();
  Question& question = found->second;
  if (!question.is_asked || question.server != answer.origin().server()) return stale();
  ++counters_.answered;
  switch (answer.result_case()) {
    case pb::StationAnswer::kDelivered:
      end(answer.number(), {Asked::Kind::kDelivered, {}});
      return true;
    case pb::StationAnswer::kRefused: {
      pb::Refusal refusal = makeRefusal(answer.refused().reason(), answer.refused().text());
      if (answer.refused().has_ours()) *refusal.mutable_ours() = answer.refused().ours();
      if (answer.refused().has_theirs()) *refusal.mutable_theirs() = answer.refused().theirs();
      end(answer.number(), {Asked::Kind::kRefused, std::move(refusal)});
      return true;
    }
    case pb::StationAnswer::kNotHere: {
      ++counters_.not_here;
      question.is_asked = false;
      question.find_until_ns = time_.nowNs() + std::chrono::nanoseconds(settings_.find_again).count();
      const pb::NotHere& there = answer.not_here();
      // its information may be newer than ours
      if (checkName("server", there.server()).ok() && there.server() != settings_.server &&
          there.epoch() > question.epoch && question.asked < kMaxServersAsked)
        askAgain(answer.number(), there.server(), there.epoch());
      return true;
    }
    case pb::StationAnswer::RESULT_NOT_SET:
      break;
  }
  return malformed();
}

}  // namespace needlelab
