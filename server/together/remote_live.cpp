// Message freshness, which server has which station, and expiry.
#include "server/together/remote_live.h"

#include <fmt/core.h>
#include <algorithm>
#include <utility>

#include "common/base/planted_bug.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kFormerInstances = 8;
constexpr std::chrono::milliseconds kExpiryEvery{250};
constexpr std::chrono::seconds kNameTakenFor{10};
constexpr std::chrono::seconds kStall{1};  // a longer gap between two steps: this server was paused
constexpr const char* kDownText = "the live connection between servers is down";

std::int64_t ns(std::chrono::nanoseconds time) {
  return time.count();
}

}  // namespace

RemoteLive::RemoteLive(Hub& hub, LiveCarrier& carrier, RemoteLiveSettings settings, TimeSource& time)
    : hub_(hub), carrier_(carrier), settings_(std::move(settings)), time_(time) {
  hub_.setLiveTrouble(kDownText);
}

RemoteLive::~RemoteLive() {
  alive_.reset();
  for (auto& [name, remote] : remotes_) hub_.detachStation(name, *remote);
}

/// Limits log lines, because any sender at the carrier can invent servers.
void RemoteLive::note(LogLevel level, std::string_view event, const std::string& server) {
  const std::int64_t now_ns = time_.nowNs();
  if (lines_.take(now_ns)) logEvent(level, event, {{"server", server}});
  if (const std::uint64_t count = lines_.takeOmittedCount(now_ns); count > 0)
    logEvent(LogLevel::kWarning, "lines_left_out", {{"of", event}, {"count", count}});
}

bool RemoteLive::malformed() {
  ++counters_.malformed;
  return false;
}

bool RemoteLive::stale() {
  ++counters_.stale;
  return false;
}

std::string RemoteLive::trouble() const {
  if (up_) return {};
  return why_down_.empty() ? kDownText : fmt::format("{}: {}", kDownText, why_down_);
}

std::string RemoteLive::duplicateName() const {
  if (duplicate_name_ns_ == 0 || time_.nowNs() - duplicate_name_ns_ > ns(kNameTakenFor)) return {};
  return fmt::format("another server of the lab is called '{}', too: give each a --live-name of its own",
                     settings_.server);
}

std::vector<std::string> RemoteLive::servers() const {
  std::vector<std::string> names;
  for (const auto& [name, server] : servers_)
    if (server.instance != 0) names.push_back(name);
  return names;
}

pb::Origin RemoteLive::origin(LivePlane plane) {
  pb::Origin origin;
  origin.set_lab(settings_.lab);
  origin.set_server(settings_.server);
  origin.set_instance(settings_.instance);
  origin.set_number(++numbers_[static_cast<std::size_t>(plane)]);
  return origin;
}

/// Checks a message's origin, and that it is new. For kLive checks only the origin, because its numbers are
/// compared per station. False: it was counted.
bool RemoteLive::isFresh(const pb::Origin& origin, LivePlane plane) {
  const std::string& name = origin.server();
  if (origin.lab() != settings_.lab || origin.instance() == 0 || !checkName("server", name))
    return malformed();
  const std::int64_t now_ns = time_.nowNs();
  if (name == settings_.server) {
    if (origin.instance() == settings_.instance) return stale();
    if (duplicateName().empty()) {
      duplicate_name_ns_ = now_ns;
      logEvent(LogLevel::kWarning, "live_name_taken", {{"text", duplicateName()}});
    }
    duplicate_name_ns_ = now_ns;
    return stale();
  }
  const auto found = servers_.find(name);
  if (found == servers_.end() && servers_.size() >= settings_.max_servers) return malformed();
  Server& server = found == servers_.end() ? servers_[name] : found->second;
  if (server.instance != origin.instance()) {
    if (std::find(server.ended.begin(), server.ended.end(), origin.instance()) != server.ended.end())
      return stale();
    endInstance(name, server);
    server.instance = origin.instance();
    std::fill(std::begin(server.last), std::end(server.last), 0);
    note(LogLevel::kInfo, "other_server_heard", name);
    // it does not know this server's stations yet
    said_.clear();
    next_presence_ns_ = now_ns;
  }
  server.last_message_ns = now_ns;
  if (plane == LivePlane::kLive) return true;
  std::uint64_t& last = server.last[static_cast<std::size_t>(plane)];
  if (origin.number() <= last) return stale();
  last = origin.number();
  return true;
}

/// The instance no longer has any stations, and its messages still in transit are ignored.
void RemoteLive::endInstance(const std::string& name, Server& server) {
  const std::uint64_t instance = std::exchange(server.instance, 0);
  if (instance == 0) return;
  server.ended.push_back(instance);
  if (server.ended.size() > kFormerInstances) server.ended.pop_front();
  forgetClaims(name);
}

/// Whether a claim with `epoch` takes precedence over a connection with `than`. False if either is unknown.
bool RemoteLive::isNewer(std::uint64_t epoch, std::uint64_t than) const {
  if (planted(PlantedBug::kEpochIgnored)) return false;
  return than > 0 && epoch > than;
}

/// The server whose claim counts; null if none does.
const std::string* RemoteLive::holderOf(const RemoteStation& remote) const {
  const std::pair<const std::string, RemoteClaim>* best = nullptr;
  for (const auto& each : remote.claims) {
    const RemoteClaim& claim = each.second;
    // an overtaken claim does not return when the newer one ends
    if (isNewer(remote.newest_epoch, claim.epoch)) continue;
    if (best == nullptr ||
        std::pair(claim.epoch, claim.first_ns) > std::pair(best->second.epoch, best->second.first_ns))
      best = &each;
  }
  return best == nullptr ? nullptr : &best->first;
}

/// Attaches the station to the hub, or detaches it, according to the claims.
void RemoteLive::settle(RemoteStation& remote) {
  HubPeer* const there = hub_.stationPeer(remote.station);
  const bool is_attached = there == &remote;
  const std::string* server = holderOf(remote);
  if (there != nullptr && !is_attached && server != nullptr &&
      !isNewer(remote.claims.at(*server).epoch, hub_.epochOf(remote.station)))
    server = nullptr;  // it is connected here
  if (server == nullptr) {
    remote.holder.clear();
    if (is_attached) hub_.detachStation(remote.station, remote);
    if (endWatch(remote)) publishWatch(remote);
    return;
  }
  const RemoteClaim& claim = remote.claims.at(*server);
  const bool moved = remote.holder != *server || remote.epoch != claim.epoch;
  if (moved) {
    remote.holder = *server;
    remote.epoch = claim.epoch;
    remote.last_frame = 0;
  }
  if (!is_attached) {
    outlets_.erase(remote.station);  // frames from another server are not published
    (void)endWatch(remote);
    hub_.attachStation(remote.station, remote, claim.epoch);
  } else if (moved && remote.watched) {
    publishWatch(remote);
  }
  (void)hub_.onRemoteStatus(remote, claim.status, time_.nowNs(), moved || !is_attached);
}

/// After the hub has detached it, possibly because a connection replaced it. False: it had no viewer.
bool RemoteLive::endWatch(RemoteStation& remote) {
  if (!std::exchange(remote.watched, false)) return false;
  carrier_.listenTo(remote.station, false);
  return true;
}

bool RemoteLive::isRemote(const std::string& station) const {
  const HubPeer* const there = hub_.stationPeer(station);
  return there != nullptr && there->isRemote();
}

void RemoteLive::forgetClaims(const std::string& server) {
  for (auto entry = remotes_.begin(); entry != remotes_.end();) {
    RemoteStation& remote = *entry->second;
    if (remote.claims.erase(server) > 0) settle(remote);
    entry = remote.claims.empty() ? remotes_.erase(entry) : std::next(entry);
  }
}

/// Forgets what has not been repeated for too long.
void RemoteLive::expire(std::int64_t now_ns) {
  const std::int64_t oldest_ns = now_ns - ns(settings_.presence_lasts);
  if (!planted(PlantedBug::kPresenceForEver)) {
    for (auto entry = remotes_.begin(); entry != remotes_.end();) {
      RemoteStation& remote = *entry->second;
      bool changed = std::erase_if(remote.claims,
                                   [&](const auto& claim) { return claim.second.last_ns < oldest_ns; }) > 0;
      // a database restored to an older state has lower epochs from then on
      if (remote.newest_ns < now_ns - ns(settings_.overtaken_lasts)) {
        const std::uint64_t before = std::exchange(remote.newest_epoch, 0);
        for (const auto& [server, claim] : remote.claims)
          remote.newest_epoch = std::max(remote.newest_epoch, claim.epoch);
        changed = changed || remote.newest_epoch != before;
      }
      if (changed) settle(remote);
      entry = remote.claims.empty() ? remotes_.erase(entry) : std::next(entry);
    }
  }
  std::erase_if(servers_, [&](const auto& entry) {
    const bool is_silent = entry.second.last_message_ns < oldest_ns;
    if (is_silent && entry.second.instance != 0) note(LogLevel::kWarning, "other_server_silent", entry.first);
    return is_silent;
  });
  for (auto entry = outlets_.begin(); entry != outlets_.end();) {
    RemoteOutlet& outlet = *entry->second;
    std::erase_if(outlet.watchers, [&](const auto& each) { return each.second.until_ns <= now_ns; });
    refresh(outlet);
    entry = outlet.watchers.empty() ? outlets_.erase(entry) : std::next(entry);
  }
}

/// After a gap in hearing: restarts the expiry times of everything heard before.
void RemoteLive::countFrom(std::int64_t now_ns) {
  for (auto& [name, server] : servers_) server.last_message_ns = now_ns;
  for (auto& [name, remote] : remotes_)
    for (auto& [server, claim] : remote->claims) claim.last_ns = now_ns;
}

void RemoteLive::step() {
  if (has_left_) return;
  const std::int64_t now_ns = time_.nowNs();
  redirectQuestions(now_ns);
  const std::int64_t last_ns = std::exchange(last_step_ns_, now_ns);
  // while no server can be heard, silent ones are not forgotten
  if (!up_) return;
  if (now_ns - last_ns > ns(kStall)) countFrom(now_ns);
  if (now_ns >= next_expiry_ns_) {
    next_expiry_ns_ = now_ns + ns(kExpiryEvery);
    expire(now_ns);
  }
  for (auto& [name, remote] : remotes_) {
    // a connection here may have replaced it, or ended
    if ((hub_.stationPeer(name) == remote.get()) != !remote->holder.empty() ||
        hub_.stationPeer(name) == nullptr)
      settle(*remote);
    if (remote->watched && now_ns - remote->watch_published_ns >= ns(settings_.watch_every))
      publishWatch(*remote);
  }
  publishPresence(now_ns);
}

void RemoteLive::leave() {
  pb::Presence last;
  *last.mutable_origin() = origin(LivePlane::kPresence);
  last.set_ends(true);
  publish(LivePlane::kPresence, settings_.server, last);
  has_left_ = true;
  endQuestions(pb::Refusal::SHUTTING_DOWN, "the server is shutting down since it was sent");
}

void RemoteLive::onLink(bool up, const std::string& why) {
  const std::int64_t now_ns = time_.nowNs();
  why_down_ = up ? std::string() : why;
  if (std::exchange(up_, up) == up) return;
  hub_.setLiveTrouble(up ? "" : kDownText);
  if (up) {
    countFrom(now_ns);
    for (auto& [name, remote] : remotes_)
      if (remote->watched) publishWatch(*remote);
    said_.clear();
    next_presence_ns_ = now_ns;
    return;
  }
  for (auto& [name, remote] : remotes_) {
    if (remote->holder.empty()) continue;
    pb::StationStatus status = remote->claims.at(remote->holder).status;
    status.set_trouble(kDownText);
    status.clear_force_n();
    (void)hub_.onRemoteStatus(*remote, status, now_ns, true);
  }
  endQuestions(pb::Refusal::TIMEOUT, fmt::format("{} since it was sent", kDownText));
}

void RemoteLive::onMessage(LivePlane plane, const std::string& name, std::string_view message) {
  if (has_left_) return;
  switch (plane) {
    case LivePlane::kPresence:
      (void)onPresence(name, message);
      break;
    case LivePlane::kWatch:
      (void)onWatch(name, message);
      break;
    case LivePlane::kLive:
      (void)onFrame(name, message);
      break;
    case LivePlane::kAsk:
      (void)onAsk(name, message);
      break;
    case LivePlane::kAnswer:
      (void)onAnswer(message);
      break;
  }
}

}  // namespace needlelab
