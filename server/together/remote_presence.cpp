// Presence: which stations are connected to which server.
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/text/text.h"
#include "server/together/remote_live.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxHazards = 256, kMaxAlarms = 8;  // as max_items of StationStatus

/// Numbers from another program: replaces NaN and infinity by 0.
void makeFinite(pb::StationStatus& status) {
  const auto mend = [](double value) { return std::isfinite(value) ? value : 0; };
  status.set_insertion_m(mend(status.insertion_m()));
  status.set_force_n(mend(status.force_n()));
  status.set_peak_force_n(mend(status.peak_force_n()));
  status.set_force_limit_n(mend(status.force_limit_n()));
}

}  // namespace

/// Sends what has changed since the last message, and what was not sent for whole_every.
void RemoteLive::publishPresence(std::int64_t now_ns) {
  if (now_ns < next_presence_ns_) return;
  const bool is_alone = servers().empty();
  hub_.keepStatusesFresh(!is_alone);
  const std::int64_t every_ns =
      std::chrono::nanoseconds(is_alone ? settings_.solo_presence_every : settings_.presence_every).count();
  // after a stall, do not send a burst to catch up
  next_presence_ns_ = std::max(next_presence_ns_ + every_ns, now_ns + every_ns / 2);
  const std::int64_t whole_ns = std::chrono::nanoseconds(settings_.whole_every).count();
  ++round_;

  pb::Presence message;
  std::size_t bytes = 0;
  const auto send = [&] {
    *message.mutable_origin() = origin(LivePlane::kPresence);
    publish(LivePlane::kPresence, settings_.server, message);
    message.Clear();
    bytes = 0;
  };
  const auto add = [&](pb::PresentStation entry, std::size_t size) {
    if (bytes > 0 && bytes + size + 8 > settings_.presence_bytes) send();
    *message.add_stations() = std::move(entry);
    bytes += size + 8;
  };
  if (!is_alone) {
    hub_.forEachLocal([&](const std::string& name, const pb::StationStatus& status, std::uint64_t epoch) {
      pb::PresentStation entry;
      entry.set_station(name);
      entry.set_epoch(epoch);
      *entry.mutable_status() = status;
      std::string text = entry.SerializeAsString();
      Said& said = said_[name];
      said.round = round_;
      said.epoch = epoch;
      if (said.entry == text && now_ns - said.said_ns < whole_ns) return;
      add(std::move(entry), text.size());
      said.entry = std::move(text);
      said.said_ns = now_ns;
    });
    std::erase_if(said_, [&](const auto& entry) {
      const Said& said = entry.second;
      if (said.round == round_) return false;
      pb::PresentStation gone;
      gone.set_station(entry.first);
      gone.set_epoch(said.epoch);
      gone.set_gone(true);
      const std::size_t size = gone.ByteSizeLong();
      add(std::move(gone), size);
      return true;
    });
  }
  send();
}

bool RemoteLive::onPresence(const std::string& name, std::string_view bytes) {
  pb::Presence message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) ||
      message.origin().server() != name)
    return malformed();
  if (!isFresh(message.origin(), LivePlane::kPresence)) return false;
  if (message.ends()) {
    endInstance(name, servers_.at(name));
    return true;
  }
  for (const pb::PresentStation& entry : message.stations()) onPresent(name, entry);
  return true;
}

void RemoteLive::onPresent(const std::string& server, const pb::PresentStation& entry) {
  const std::string& station = entry.station();
  const pb::StationStatus& status = entry.status();
  if (!checkName("station", station) || status.ByteSizeLong() > settings_.max_status_bytes ||
      static_cast<std::size_t>(status.hazards_touched_size()) > kMaxHazards ||
      static_cast<std::size_t>(status.alarms_size()) > kMaxAlarms ||
      (!status.session_id().empty() && status.session_id().size() != 16)) {
    (void)malformed();
    return;
  }
  auto found = remotes_.find(station);
  if (entry.gone()) {
    if (found == remotes_.end()) return;
    RemoteStation& remote = *found->second;
    const auto claim = remote.claims.find(server);
    if (claim == remote.claims.end() || entry.epoch() < claim->second.epoch) return;
    remote.claims.erase(claim);
    settle(remote);
    if (remote.claims.empty()) remotes_.erase(found);
    return;
  }
  if (found == remotes_.end()) {
    if (remotes_.size() >= settings_.max_stations) {
      (void)malformed();
      return;
    }
    found = remotes_
                .emplace(station, std::make_unique<RemoteStation>(
                                      station, [this](RemoteStation& remote) { onWatched(remote); }))
                .first;
  }
  RemoteStation& remote = *found->second;
  RemoteClaim& claim = remote.claims[server];
  if (entry.epoch() < claim.epoch) {
    (void)stale();
    return;
  }
  const std::int64_t now_ns = time_.nowNs();
  if (claim.first_ns == 0 || entry.epoch() != claim.epoch) claim.first_ns = now_ns;
  claim.epoch = entry.epoch();
  claim.last_ns = now_ns;
  claim.status = status;
  claim.status.set_server(server);
  makeFinite(claim.status);
  if (claim.epoch >= remote.newest_epoch) {
    remote.newest_epoch = claim.epoch;
    remote.newest_ns = now_ns;
  }
  settle(remote);
}

}  // namespace needlelab
