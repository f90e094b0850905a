// Live lines: of one station, of one session on any station, or an overview of all stations.
#include "client/instructor/terminal/headless.h"

#include <map>
#include <optional>
#include <set>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "client/instructor/model/live/live_station.h"
#include "client/instructor/model/live/session_scene.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr double kWatchRateHz = 10, kOverviewRateHz = 1;  // lines per second: slow enough to read

bool several(const HeadlessRun& run) {
  return run.options.server.find(',') != std::string::npos;
}

Status subscribe(const HeadlessRun& run, double rate_hz) {
  pb::Envelope envelope;
  pb::Subscribe& wanted = *envelope.mutable_subscribe();
  wanted.set_subscription(1);
  wanted.set_station(run.options.station);
  wanted.set_session_id(sessionBytes(run.options));
  wanted.set_rate_hz(run.options.rate_hz.value_or(rate_hz));
  return run.client.send(envelope);
}

Result<pb::Reply> listStations(const HeadlessRun& run) {
  pb::Request request;
  request.mutable_list_stations();
  return run.client.call(request);
}

/// Passes each message to `lines`, reconnecting after a loss of the connection, until the time is over or
/// `lines` has enough; then prints the summary.
template <typename Lines>
Status listen(const HeadlessRun& run, Lines& lines) {
  RETURN_IF_ERROR(lines.begin());
  Status result;
  while (result.ok() && !run.over() && !lines.enough()) {
    const auto got = run.client.receive(std::chrono::milliseconds(100));
    if (got.ok()) {
      if (got->has_refusal()) return errorOf(got->refusal());
      lines.take(*got);
    } else if (got.error().code != ErrorCode::kNotFound) {
      if (result = recover(run, got.error()); result.ok()) result = lines.begin();
    }
  }
  const std::uint64_t came = lines.summary();
  // a connection lost just before the end of --seconds is not a failure if lines arrived before
  if (!result.ok() && result.error().code == ErrorCode::kUnavailable && came > 0) return {};
  return result;
}

/// A line for each station's status: online or not, and activity.
class Overview {
 public:
  explicit Overview(const HeadlessRun& run) : run_(run) {}

  /// Lists the server's stations, so that offline ones appear too.
  Status begin() {
    ASSIGN_OR_RETURN(const auto reply, listStations(run_));
    for (const pb::StationInfo& info : reply.stations().stations()) {
      if (info.revoked() || info.online()) continue;  // the subscription delivers the others
      pb::StationStatus status;
      status.set_station(info.name());
      print(status);
    }
    return subscribe(run_, kOverviewRateHz);
  }
  void take(const pb::Envelope& message) {
    if (!message.has_station_status()) return;
    print(message.station_status());
    ++lines_;
    stations_.insert(message.station_status().station());
  }
  [[nodiscard]] static bool enough() { return false; }
  [[nodiscard]] std::uint64_t summary() const {
    const nlohmann::ordered_json json = {
        {"type", "summary"}, {"updates", lines_}, {"stations", stations_.size()}};
    run_.line(run_.options.json ? json.dump()
                                : fmt::format("updates {}  stations seen {}", lines_, stations_.size()));
    return lines_;
  }

 private:
  void print(const pb::StationStatus& status) const {
    Update update = updateOf(status);
    update.time_s = 1e-9 * static_cast<double>(steadyNowNs() - started_ns_);
    run_.update(update);
  }

  const HeadlessRun& run_;
  const std::int64_t started_ns_ = steadyNowNs();
  std::uint64_t lines_ = 0;
  std::set<std::string> stations_;
};

/// Lines of --station or --session, and --message to that station.
class Watch {
 public:
  explicit Watch(const HeadlessRun& run) : run_(run) {}

  Status run() {
    RETURN_IF_ERROR(askForStation());
    RETURN_IF_ERROR(listen(run_, *this));
    if (refused_) return *refused_;
    if (!run_.options.once || said_) return {};
    return Error{ErrorCode::kUnavailable,
                 "time is up, and the message was not sent: the station was not online"};
  }

  Status begin() {
    stats_.streamRestarts();
    online_.reset();
    return subscribe(run_, kWatchRateHz);
  }
  void take(const pb::Envelope& message) {
    if (message.has_live_frame()) onFrame(message.live_frame());
    if (message.has_station_status()) onStatus(message.station_status());
  }
  [[nodiscard]] bool enough() const { return run_.options.once && said_; }
  [[nodiscard]] std::uint64_t summary() const {
    const double p50 = stats_.latencyMs(0.5), p99 = stats_.latencyMs(0.99);
    const nlohmann::ordered_json json = {{"type", "summary"},
                                         {"frames", stats_.frames()},
                                         {"samples", stats_.samples()},
                                         {"dropped", stats_.dropped()},
                                         {"live_p50_ms", p50},
                                         {"live_p99_ms", p99},
                                         {"clock", "wall clocks of station and viewer; true on one machine"}};
    run_.line(
        run_.options.json
            ? json.dump()
            : fmt::format(
                  "frames {}  samples {}  dropped {}  latency p50 {:.1f} ms  p99 {:.1f} ms (by the wall "
                  "clocks: true when station and viewer are one machine)",
                  stats_.frames(), stats_.samples(), stats_.dropped(), p50, p99));
    return stats_.frames();
  }

 private:
  /// Facts about a session, without its samples.
  struct Facts {
    std::string trainee;
    double rate_hz = 0;  // 0: not yet known
    std::vector<std::string> layer_names;
  };

  /// Prints a note with the known names if the server does not know this one, because waiting would not help.
  Status askForStation() {
    if (run_.options.station.empty()) return {};
    const auto reply = listStations(run_);
    // The connection was just lost: receive() returns the error again, and listen() recovers.
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
      run_.note("station " + status.station() + (words.empty() ? ": trouble over" : ": TROUBLE: " + words));
    }
    if (status.online() && !run_.options.message.empty() && !said_) sendMessage();
  }

  void sendMessage() {
    said_ = true;
    pb::Request request;
    request.mutable_trainee_message()->set_station(run_.options.station);
    request.mutable_trainee_message()->set_text(run_.options.message);
    const auto reply = run_.client.call(request);
    if (!reply.ok()) refused_ = reply.error();
    run_.note(reply.ok() ? "message sent" : "message: " + reply.error().message);
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
    const Facts& facts = factsOf(frame);
    Update update = updateOf(newest, facts.layer_names);
    // since the first sample, as in a replay; the lesson is announced about 0.2 s earlier
    if (facts.rate_hz > 0) update.time_s = static_cast<double>(newest.tick) / facts.rate_hz;
    update.station = frame.station();
    update.trainee = facts.trainee;
    update.session = sessionIdText(frame.session_id());
    update.latency_ms = stats_.lastLatencyMs();
    update.drops = stats_.dropped();
    run_.update(update);
  }

  /// Reads a session's trainee and rate from the server; repeats the request until the server knows the
  /// session.
  const Facts& factsOf(const pb::LiveFrame& frame) {
    Facts& facts = facts_[frame.session_id()];
    if (facts.rate_hz > 0) return facts;
    pb::Request request;
    request.mutable_get_session()->set_session_id(frame.session_id());
    if (const auto reply = run_.client.call(request, std::chrono::seconds(5)); reply.ok()) {
      const auto& d = reply->session().description();
      facts.trainee = d.trainee();
      facts.rate_hz = d.rate_hz();
      if (const auto profile = parseProfile(d.profile_json(), "profile"))
        facts.layer_names = layerNames(*profile);
    }
    return facts;
  }

  const HeadlessRun& run_;
  LiveStats stats_;
  std::map<std::string, Facts> facts_;  // by session
  std::optional<bool> online_;
  std::string trouble_;
  bool said_ = false;             // --message was sent, or refused
  std::optional<Error> refused_;  // of --message
};

}  // namespace

Status recover(const HeadlessRun& run, const Error& why) {
  run.note(why.message + "; connecting again");
  auto status = run.client.reconnect(run.end_ns, run.stop);
  if (status.ok())
    run.note("connected again" +
             (several(run) ? ", to " + endpointText(run.client.server()) : std::string()));
  return status;
}

Status runHeadless(const HeadlessRun& run) {
  if (several(run)) run.note("connected to " + endpointText(run.client.server()));
  if (run.options.replay) return replaySession(run);
  if (!run.options.station.empty() || !run.options.session.empty()) return Watch(run).run();
  Overview overview(run);
  return listen(run, overview);
}

}  // namespace needlelab
