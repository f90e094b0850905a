#include "client/instructor/terminal/headless.h"

#include <set>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "client/instructor/terminal/update_line.h"
#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

/// Lists the server's stations, so that offline ones appear too.
Status listStations(const HeadlessRun& run, std::int64_t started_ns) {
  pb::Request request;
  request.mutable_list_stations();
  ASSIGN_OR_RETURN(auto reply, run.client.call(request));
  for (const pb::StationInfo& info : reply.stations().stations()) {
    if (info.revoked() || info.online()) continue;  // the subscription delivers the lines of the others
    pb::StationStatus status;
    status.set_station(info.name());
    Update update = updateOf(status);
    update.time_s = 1e-9 * static_cast<double>(steadyNowNs() - started_ns);
    run.line(run.options.json ? jsonLine(update) : textLine(update));
  }
  pb::Envelope envelope;
  envelope.mutable_subscribe()->set_subscription(1);
  envelope.mutable_subscribe()->set_rate_hz(run.options.rate_hz.value_or(1));
  return run.client.send(envelope);
}

/// Prints a line for each station status: online state and activity.
Status overview(const HeadlessRun& run) {
  const std::int64_t started_ns = steadyNowNs();
  RETURN_IF_ERROR(listStations(run, started_ns));
  std::uint64_t lines = 0;
  std::set<std::string> stations;
  Status result;
  while (!run.over()) {
    auto got = run.client.receive(std::chrono::milliseconds(100));
    if (!got.ok()) {
      if (got.error().code == ErrorCode::kNotFound) continue;
      if (result = run.recover(got.error()); !result.ok()) break;
      if (result = listStations(run, started_ns); !result.ok()) break;
      continue;
    }
    if (got->has_refusal()) return errorOf(got->refusal());
    if (!got->has_station_status()) continue;
    Update update = updateOf(got->station_status());
    update.time_s = 1e-9 * static_cast<double>(steadyNowNs() - started_ns);
    run.line(run.options.json ? jsonLine(update) : textLine(update));
    ++lines;
    stations.insert(update.station);
  }
  if (run.options.json) {
    const nlohmann::ordered_json json = {
        {"type", "summary"}, {"updates", lines}, {"stations", stations.size()}};
    run.line(json.dump());
  } else {
    run.line(fmt::format("updates {}  stations seen {}", lines, stations.size()));
  }
  if (!result.ok() && result.error().code == ErrorCode::kUnavailable && lines > 0) return {};
  return result;
}

}  // namespace

void HeadlessRun::line(const std::string& text) const {
  out << text << '\n' << std::flush;
}

void HeadlessRun::note(const std::string& text) const {
  line(noteLine(text, options.json));
}

bool HeadlessRun::several() const {
  return options.server.find(',') != std::string::npos;
}

Status HeadlessRun::recover(const Error& why) const {
  note(why.message + "; connecting again");
  auto status = client.reconnect(end_ns, stop);
  if (status.ok())
    note("connected again" + (several() ? ", to " + endpointText(client.server()) : std::string()));
  return status;
}

Status runHeadless(const HeadlessRun& run) {
  if (run.several()) run.note("connected to " + endpointText(run.client.server()));
  if (run.options.replay) return replaySession(run);
  if (!run.options.station.empty() || !run.options.session.empty()) return watchLive(run);
  return overview(run);
}

}  // namespace needlelab
