// Live lines of one station, or of one session on any station, and the commands to that station.
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "client/instructor/model/live_station.h"
#include "client/instructor/terminal/headless.h"
#include "client/instructor/terminal/update_line.h"
#include "common/base/clock.h"
#include "common/base/uuid.h"
#include "common/gesture/chunk.h"
#include "common/profile/aid_list.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/wire/protocol.h"
#include "needlelab/control.pb.h"

namespace needlelab {
namespace {

/// Sends each command of the command line once, as soon as possible.
class PendingCommands {
 public:
  /// Sends a request to the server.
  using Ask = std::function<Result<pb::Reply>(const pb::Request&)>;
  /// Reports the outcome of a command ("stop") to the person.
  using Report = std::function<void(const std::string& what, bool ok, const std::string& text)>;

  /// `options` must be checked and outlive it.
  PendingCommands(const InstructorOptions& options, Ask ask, Report report);

  /// Call when the station is online.
  void online();
  /// Call when this lesson runs there.
  void lesson(const std::string& session_id);
  /// Call with the lesson's newest tick.
  void moment(const std::string& session_id, std::uint64_t tick);
  /// Sends the remark on the moment and session in the options; the session need not be running.
  void onStored();

  [[nodiscard]] bool allSent() const { return waiting_.empty(); }
  /// The first refused command.
  [[nodiscard]] const std::optional<Error>& refused() const { return refused_; }

 private:
  enum class When { kOnline, kInLesson, kAtMoment };
  struct Command {
    std::string what;
    When when;
    pb::Request request;
    std::string done;
  };
  void sendAll(When when, const std::function<void(pb::Request&)>& complete);
  void send(Command command);
  Result<std::uint64_t> tickAt(const std::string& session_id, double at_s) const;

  const InstructorOptions& options_;
  const Ask ask_;
  const Report report_;
  std::vector<Command> waiting_;
  std::optional<Error> refused_;
};

PendingCommands::PendingCommands(const InstructorOptions& options, Ask ask, Report report)
    : options_(options), ask_(std::move(ask)), report_(std::move(report)) {
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
  // last, because it ends the lesson of the other commands
  if (options.stop) {
    const When when =
        waiting_.empty() || waiting_.back().when != When::kAtMoment ? When::kInLesson : When::kAtMoment;
    auto& stop = *add("stop", when, "lesson stopped").mutable_stop_lesson();
    stop.set_station(options.station);
    stop.set_reason(options.stop_reason);
  }
}

void PendingCommands::online() {
  sendAll(When::kOnline, [](pb::Request&) {});
}

void PendingCommands::lesson(const std::string& session_id) {
  sendAll(When::kInLesson, [&](pb::Request& request) {
    // the commands apply to the lesson that runs now
    if (request.has_set_aids()) request.mutable_set_aids()->set_session_id(session_id);
    if (request.has_stop_lesson()) request.mutable_stop_lesson()->set_session_id(session_id);
    if (request.has_annotate()) request.mutable_annotate()->set_session_id(session_id);
  });
}

void PendingCommands::moment(const std::string& session_id, std::uint64_t tick) {
  lesson(session_id);
  sendAll(When::kAtMoment, [&](pb::Request& request) {
    if (request.has_stop_lesson()) request.mutable_stop_lesson()->set_session_id(session_id);
    if (!request.has_annotate()) return;
    request.mutable_annotate()->set_session_id(session_id);
    request.mutable_annotate()->set_tick(tick);
  });
}

void PendingCommands::onStored() {
  if (!options_.session.empty() && options_.at_s) lesson(sessionBytes(options_));
}

void PendingCommands::sendAll(When when, const std::function<void(pb::Request&)>& complete) {
  std::vector<Command> left;
  for (Command& command : std::exchange(waiting_, {})) {
    if (command.when != when) {
      left.push_back(std::move(command));
      continue;
    }
    complete(command.request);
    send(std::move(command));
  }
  waiting_ = std::move(left);
}

void PendingCommands::send(Command command) {
  Result<pb::Reply> reply = [&]() -> Result<pb::Reply> {
    if (command.request.has_annotate() && options_.at_s) {
      ASSIGN_OR_RETURN(auto tick, tickAt(command.request.annotate().session_id(), *options_.at_s));
      command.request.mutable_annotate()->set_tick(tick);
    }
    return ask_(command.request);
  }();
  if (!reply.ok() && !refused_) refused_ = reply.error();
  report_(command.what, reply.ok(), reply.ok() ? command.done : reply.error().message);
}

/// A session's ticks start at its first sample.
Result<std::uint64_t> PendingCommands::tickAt(const std::string& session_id, double at_s) const {
  pb::Request request;
  request.mutable_get_session()->set_session_id(session_id);
  ASSIGN_OR_RETURN(auto info, ask_(request));
  std::uint64_t first = 0;
  request.mutable_seek_session()->set_session_id(session_id);
  request.mutable_seek_session()->set_seconds(0);
  // a new session, or one without a recording (deleted by retention), has nothing to seek
  if (const auto sought = ask_(request); sought.ok()) first = sought->sought().recording_first_tick();
  return first + static_cast<std::uint64_t>(std::llround(at_s * info.session().description().rate_hz()));
}

constexpr double kWatchRateHz = 10;  // readable number of lines per second

/// Facts about a session without its samples.
struct SessionFacts {
  std::string trainee;
  double rate_hz = 0;  // 0: the server has not yet said
  std::vector<std::string> layer_names;
};

class Watch {
 public:
  explicit Watch(const HeadlessRun& run) : run_(run) {}

  Status run() {
    commands_.onStored();
    if (allCommandsSent()) return commandOutcome();
    RETURN_IF_ERROR(askForStation());
    RETURN_IF_ERROR(subscribe());
    Status result;
    while (!run_.over() && !allCommandsSent()) {
      auto got = run_.client.receive(std::chrono::milliseconds(100));
      if (!got.ok()) {
        if (got.error().code == ErrorCode::kNotFound) continue;
        if (result = run_.recover(got.error()); !result.ok()) break;
        if (result = subscribe(); !result.ok()) break;
        continue;
      }
      if (got->has_live_frame()) onFrame(got->live_frame());
      if (got->has_station_status()) onStatus(got->station_status());
      if (got->has_refusal()) return errorOf(got->refusal());
    }
    summary();
    // a lost connection just before the end of --seconds is not a failure if frames had arrived
    const bool cut_short =
        !result.ok() && result.error().code == ErrorCode::kUnavailable && stats_.frames() > 0;
    return result.ok() || cut_short ? commandOutcome() : result;
  }

 private:
  /// If the server does not know the name, waiting is useless: prints a note with the known names.
  Status askForStation() {
    if (run_.options.station.empty()) return {};
    pb::Request request;
    request.mutable_list_stations();
    const auto reply = run_.client.call(request);
    // the connection was just lost: receive() returns the error again, and run() recovers
    if (!reply.ok()) return reply.error().code == ErrorCode::kUnavailable ? Status{} : reply.error();
    std::string names;
    for (const pb::StationInfo& info : reply->stations().stations()) {
      const bool here = info.name() == run_.options.station;
      if (here && info.revoked())
        run_.note("the key of station " + info.name() + " is revoked: it cannot log in");
      if (here) return {};
      if (!info.revoked()) names += (names.empty() ? "" : ", ") + info.name();
    }
    run_.note("the server knows no station '" + run_.options.station + "'; it knows " +
              (names.empty() ? "none" : names) + ". Waiting in case it is added; Ctrl-C ends");
    return {};
  }

  /// Returns whether the commands were sent, or the error.
  [[nodiscard]] Status commandOutcome() const {
    if (commands_.refused()) return *commands_.refused();
    if (!run_.options.once || commands_.allSent()) return {};
    return Error{
        ErrorCode::kUnavailable,
        "the time is over, and not everything could be said: the station was not online, or no lesson "
        "ran there"};
  }
  [[nodiscard]] bool allCommandsSent() const { return run_.options.once && commands_.allSent(); }

  Status subscribe() {
    pb::Envelope envelope;
    pb::Subscribe& wanted = *envelope.mutable_subscribe();
    wanted.set_subscription(1);
    wanted.set_station(run_.options.station);
    wanted.set_session_id(sessionBytes(run_.options));
    wanted.set_rate_hz(run_.options.rate_hz.value_or(kWatchRateHz));
    stats_.streamRestarts();
    online_.reset();
    return run_.client.send(envelope);
  }

  void onStatus(const pb::StationStatus& status) {
    if (!status.trainee().empty()) facts_[status.session_id()].trainee = status.trainee();
    if (online_ != status.online()) {
      const char* const news = status.online() ? " is online"
                               : online_       ? " went offline: waiting for it"
                                               : " is not online: waiting for it";
      online_ = status.online();
      run_.note("station " + status.station() + news);
      stats_.streamRestarts();
    }
    if (status.trouble() != trouble_) {
      trouble_ = status.trouble();
      const std::string words = updateOf(status).trouble;
      run_.note("station " + status.station() +
                (words.empty() ? ": no trouble any more" : ": TROUBLE: " + words));
    }
    if (!status.online()) return;
    commands_.online();
    if (!status.session_id().empty()) commands_.lesson(status.session_id());
  }

  void onFrame(const pb::LiveFrame& frame) {
    const std::int64_t received = wallNowNs();
    const auto samples = decodeChunk(viewOf(frame.data()));
    if (!samples.ok()) {
      run_.note("a live frame cannot be read: " + samples.error().message);
      return;
    }
    stats_.add(frame, samples->size(), received);
    const GestureSample& newest = samples->back();
    commands_.moment(frame.session_id(), newest.tick);
    const SessionFacts& facts = factsOf(frame);
    if (frame.session_id() != plunger_of_) {
      plunger_ = {};
      plunger_of_ = frame.session_id();
    }
    for (const GestureSample& sample : *samples) plunger_.add(sample);
    Update update = updateOf(newest, facts.layer_names);
    update.syringe = plunger_.action();
    // since the first sample, as in a replay and in --at; the lesson was announced some 0.2 s before it
    if (facts.rate_hz > 0) update.time_s = static_cast<double>(newest.tick) / facts.rate_hz;
    update.station = frame.station();
    update.trainee = facts.trainee;
    update.session = run_.options.session;
    if (Uuid id{}; frame.session_id().size() == id.size()) {
      std::copy(frame.session_id().begin(), frame.session_id().end(), id.begin());
      update.session = uuidText(id);
    }
    update.latency_ms = stats_.lastLatencyMs();
    update.drops = stats_.dropped();
    run_.line(run_.options.json ? jsonLine(update) : textLine(update));
  }

  /// Reads a session's trainee and rate from the server; repeats the request until the server knows the
  /// session.
  const SessionFacts& factsOf(const pb::LiveFrame& frame) {
    SessionFacts& facts = facts_[frame.session_id()];
    if (facts.rate_hz > 0) return facts;
    pb::Request request;
    request.mutable_get_session()->set_session_id(frame.session_id());
    if (const auto reply = run_.client.call(request, std::chrono::seconds(5)); reply.ok()) {
      facts.trainee = reply->session().description().trainee();
      facts.rate_hz = reply->session().description().rate_hz();
      if (const auto profile = parseProfile(reply->session().description().profile_json(), "profile"))
        facts.layer_names = layerNames(*profile);
    }
    return facts;
  }

  void summary() const {
    const double p50 = stats_.latencyMs(0.5), p99 = stats_.latencyMs(0.99);
    if (run_.options.json) {
      const nlohmann::ordered_json json = {
          {"type", "summary"},
          {"frames", stats_.frames()},
          {"samples", stats_.samples()},
          {"dropped", stats_.dropped()},
          {"live_p50_ms", p50},
          {"live_p99_ms", p99},
          {"clock", "wall clocks of station and viewer; true on one machine"}};
      run_.line(json.dump());
      return;
    }
    run_.line(
        fmt::format("frames {}  samples {}  dropped {}  latency p50 {:.1f} ms  p99 {:.1f} ms (by the wall "
                    "clocks: true when "
                    "station and viewer are one machine)",
                    stats_.frames(), stats_.samples(), stats_.dropped(), p50, p99));
  }

  const HeadlessRun& run_;
  LiveStats stats_;
  PlungerWatch plunger_;
  std::string plunger_of_;  // session of its samples
  std::map<std::string, SessionFacts> facts_;
  std::optional<bool> online_;
  std::string trouble_;
  PendingCommands commands_{run_.options,
                            [this](const pb::Request& request) { return run_.client.call(request); },
                            [this](const std::string& what, bool ok, const std::string& text) {
                              run_.line(outcomeLine(what, ok, text, run_.options.json));
                            }};
};

}  // namespace

Status watchLive(const HeadlessRun& run) {
  return Watch(run).run();
}

}  // namespace needlelab
