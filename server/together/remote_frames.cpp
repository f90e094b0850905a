// Frames between servers: which server watches which station, and the frames themselves.
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/text/text.h"
#include "server/live/hub/rate_reduction.h"
#include "server/together/remote_live.h"

namespace needlelab {
namespace {

bool isRate(double rate_hz) {
  return rate_hz == 0 ||
         std::find(kReducedRates_hz.begin(), kReducedRates_hz.end(), rate_hz) != kReducedRates_hz.end();
}

}  // namespace

void RemoteLive::onWatched(RemoteStation& remote) {
  carrier_.listenTo(remote.station, remote.watched);
  publishWatch(remote);
}

void RemoteLive::publishWatch(RemoteStation& remote) {
  if (!up_) return;
  pb::RemoteWatch watch;
  *watch.mutable_origin() = origin(LivePlane::kWatch);
  watch.set_station(remote.station);
  watch.set_watched(remote.watched);
  watch.set_rate_hz(remote.rate_hz);
  publish(LivePlane::kWatch, remote.station, watch);
  remote.watch_published_ns = time_.nowNs();
}

bool RemoteLive::onWatch(const std::string& name, std::string_view bytes) {
  pb::RemoteWatch watch;
  if (!watch.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || watch.station() != name ||
      !checkName("station", name) || !isRate(watch.rate_hz()))
    return malformed();
  if (!isFresh(watch.origin(), LivePlane::kWatch)) return false;
  watchedBy(watch.origin().server(), watch);
  return true;
}

/// Each server receives all watch messages and handles those for its own stations.
void RemoteLive::watchedBy(const std::string& server, const pb::RemoteWatch& watch) {
  const HubPeer* const peer = hub_.stationPeer(watch.station());
  const auto found = outlets_.find(watch.station());
  if (peer == nullptr || peer->isRemote()) {
    if (found != outlets_.end()) outlets_.erase(found);
    return;
  }
  if (!watch.watched() && found == outlets_.end()) return;
  auto& outlet = found != outlets_.end() ? found->second : outlets_[watch.station()];
  if (!outlet)
    outlet = std::make_unique<RemoteOutlet>(
        hub_, watch.station(),
        [this](RemoteOutlet& from, const std::string& frame) { publishFrame(from, frame); });
  if (watch.watched())
    outlet->watchers[server] = {watch.rate_hz(),
                                time_.nowNs() + std::chrono::nanoseconds(settings_.watch_lasts).count()};
  else
    outlet->watchers.erase(server);
  if (outlet->watchers.empty())
    outlets_.erase(watch.station());
  else
    refresh(*outlet);
}

/// Watches at the rate common to all watchers; without one, all samples.
void RemoteLive::refresh(RemoteOutlet& outlet) {
  if (outlet.watchers.empty()) return;
  const double first_hz = outlet.watchers.begin()->second.rate_hz;
  const bool all_same = std::all_of(outlet.watchers.begin(), outlet.watchers.end(),
                                    [&](const auto& each) { return each.second.rate_hz == first_hz; });
  const double rate_hz = all_same ? first_hz : 0;
  if (rate_hz == outlet.rate_hz) return;
  if (outlet.rate_hz >= 0) (void)hub_.unsubscribe(outlet, 1);
  outlet.rate_hz = rate_hz;
  pb::Subscribe wanted;
  wanted.set_subscription(1);
  wanted.set_station(outlet.station);
  wanted.set_rate_hz(rate_hz);
  (void)hub_.subscribe(outlet, wanted, time_.nowNs());
}

/// `frame`: an Envelope with the live frame, as sent to viewers.
void RemoteLive::publishFrame(RemoteOutlet& outlet, const std::string& frame) {
  if (!up_) return;
  pb::RemoteFrame head;
  *head.mutable_origin() = origin(LivePlane::kLive);
  head.set_epoch(hub_.epochOf(outlet.station));
  head.set_rate_hz(outlet.rate_hz);
  // Protobuf accepts fields in any order
  std::string bytes = head.SerializeAsString();
  bytes += frame;
  ++counters_.frames_out;
  carrier_.publish(LivePlane::kLive, outlet.station, std::move(bytes));
}

bool RemoteLive::onFrame(const std::string& name, std::string_view bytes) {
  pb::RemoteFrame message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || !message.has_live_frame() ||
      message.live_frame().station() != name || !isRate(message.rate_hz()))
    return malformed();
  const pb::Origin& origin = message.origin();
  if (!isFresh(origin, LivePlane::kLive)) return false;
  const auto found = remotes_.find(name);
  if (found == remotes_.end()) return stale();
  RemoteStation& remote = *found->second;
  if (remote.holder != origin.server() || remote.epoch != message.epoch() ||
      origin.number() <= remote.last_frame)
    return stale();
  remote.last_frame = origin.number();
  ++counters_.frames_in;
  if (hub_.onLiveFrame(remote, viewOf(message.live_frame()), time_.nowNs(), message.rate_hz()))
    return malformed();
  return true;
}

}  // namespace needlelab
