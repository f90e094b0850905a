// Live lines of one station, or of one session wherever it runs.
#include <array>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "client/instructor/model/live_stats.h"
#include "client/instructor/terminal/headless.h"
#include "client/instructor/terminal/plunger_watch.h"
#include "client/instructor/terminal/update.h"
#include "client/instructor/terminal/words.h"
#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr double kDefaultRateHz = 10;  // lines per second that a person can follow

/// What is known of a session beside its samples.
struct SessionFacts {
  std::string trainee;
  std::int64_t started_ns = 0;  // station's steady clock
};

class Watch {
 public:
  explicit Watch(const HeadlessRun& run) : run_(run) {}

  Status run() {
    words_.onStored();
    if (saidEnough()) return saidOutcome();
    if (auto status = askForStation(); !status.ok()) return status;
    if (auto status = subscribe(); !status.ok()) return status;
    Status result;
    while (!run_.over() && !saidEnough()) {
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
    // a loss that the end of --seconds cut short is no failure when something was seen
    const bool cut_short =
        !result.ok() && result.error().code == ErrorCode::kUnavailable && stats_.frames() > 0;
    return result.ok() || cut_short ? saidOutcome() : result;
  }

 private:
  /// A name that the server does not know would be waited for in vain: say so, and which names there are.
  Status askForStation() {
    if (run_.options.station.empty()) return {};
    pb::Request request;
    request.mutable_list_stations();
    const auto reply = run_.client.call(request);
    // lost in this moment: receive() says so again, and recovers
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

  /// Who asked for something to be said wants to know that it was, or why not.
  [[nodiscard]] Status saidOutcome() const {
    if (words_.refused()) return *words_.refused();
    if (!run_.options.once || words_.allSaid()) return {};
    return Error{
        ErrorCode::kUnavailable,
        "the time is over, and not everything could be said: the station was not online, or no lesson "
        "ran there"};
  }
  [[nodiscard]] bool saidEnough() const { return run_.options.once && words_.allSaid(); }

  Status subscribe() {
    pb::Envelope envelope;
    pb::Subscribe& wanted = *envelope.mutable_subscribe();
    wanted.set_subscription(1);
    wanted.set_station(run_.options.station);
    wanted.set_session_id(sessionBytes(run_.options));
    wanted.set_rate_hz(run_.options.rate_hz.value_or(kDefaultRateHz));
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
    words_.online();
    if (!status.session_id().empty()) words_.lesson(status.session_id());
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
    words_.moment(frame.session_id(), newest.tick);
    const SessionFacts& facts = factsOf(frame, newest);
    if (frame.session_id() != plunger_of_) {
      plunger_ = {};
      plunger_of_ = frame.session_id();
    }
    for (const GestureSample& sample : *samples) plunger_.add(sample);
    Update update = updateOf(newest);
    update.syringe = plunger_.action();
    update.time_s = 1e-9 * static_cast<double>(newest.time_ns - facts.started_ns);
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

  /// Trainee and start, asked for once for each session; the server may not know it yet, then it is asked
  /// again.
  const SessionFacts& factsOf(const pb::LiveFrame& frame, const GestureSample& sample) {
    SessionFacts& facts = facts_[frame.session_id()];
    if (facts.started_ns != 0) return facts;
    pb::Request request;
    request.mutable_get_session()->set_session_id(frame.session_id());
    if (const auto reply = run_.client.call(request, std::chrono::seconds(5)); reply.ok()) {
      facts.trainee = reply->session().description().trainee();
      facts.started_ns = reply->session().description().started_steady_ns();
    }
    if (facts.started_ns == 0) facts.started_ns = sample.time_ns;
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
    std::array<char, 256> text{};
    std::snprintf(text.data(), text.size(),
                  "frames %llu  samples %llu  dropped %llu  latency p50 %.1f ms  p99 %.1f ms (by the wall "
                  "clocks: true when "
                  "station and viewer are one machine)",
                  static_cast<unsigned long long>(stats_.frames()),
                  static_cast<unsigned long long>(stats_.samples()),
                  static_cast<unsigned long long>(stats_.dropped()), p50, p99);
    run_.line(text.data());
  }

  const HeadlessRun& run_;
  LiveStats stats_;
  PlungerWatch plunger_;
  std::string plunger_of_;  // whose samples it has: a session's id
  std::map<std::string, SessionFacts> facts_;
  std::optional<bool> online_;
  std::string trouble_;
  Words words_{run_.options, [this](const pb::Request& request) { return run_.client.call(request); },
               [this](const std::string& what, bool ok, const std::string& text) {
                 run_.line(saidLine(what, ok, text, run_.options.json));
               }};
};

}  // namespace

Status watchLive(const HeadlessRun& run) {
  return Watch(run).run();
}

}  // namespace needlelab
