// A line for each station's news: who is online, who does what.
#include <nlohmann/json.hpp>
#include <set>

#include "client/instructor/terminal/headless.h"
#include "client/instructor/terminal/update.h"
#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

/// Stations that the server knows, so that those who are not online show up too.
Status listStations(const HeadlessRun& run, std::int64_t started_ns) {
  pb::Request request;
  request.mutable_list_stations();
  auto reply = run.client.call(request);
  if (!reply.ok()) return reply.error();
  for (const pb::StationInfo& info : reply->stations().stations()) {
    if (info.revoked() || info.online()) continue;  // the others' lines come by the subscription
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

}  // namespace

Status overview(const HeadlessRun& run) {
  const std::int64_t started_ns = steadyNowNs();
  if (auto status = listStations(run, started_ns); !status.ok()) return status;
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
    run.line("updates " + std::to_string(lines) + "  stations seen " + std::to_string(stations.size()));
  }
  if (!result.ok() && result.error().code == ErrorCode::kUnavailable && lines > 0) return {};
  return result;
}

}  // namespace needlelab
