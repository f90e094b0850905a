#include "server/live/hub.h"

#include <fmt/core.h>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

pb::Envelope statusEnvelope(const pb::StationStatus& status) {
  pb::Envelope envelope;
  *envelope.mutable_station_status() = status;
  return envelope;
}

/// Maximum size of the statuses in one message or one overview answer; leaves space for its other fields.
constexpr std::size_t kMostStatusBytes = kMaxFrameBytes - (64u << 10);

/// Skips a message that cannot be encoded: it must not cost the viewer its connection.
void sendStatus(HubPeer& viewer, const pb::StationStatus& status) {
  if (status.ByteSizeLong() <= kMostStatusBytes) viewer.sendControl(statusEnvelope(status));
}

/// Session ids are stored and forwarded to viewers: limits their length.
std::optional<pb::Refusal> checkSessionId(const char* message, std::string_view id) {
  if (id.empty() || id.size() == 16) return std::nullopt;
  return makeRefusal(pb::Refusal::INVALID,
                     fmt::format("{}.session_id has {} bytes, not 16 or none", message, id.size()));
}

/// A number from the network: a peak that is none would never end.
double finite(double value) {
  return std::isfinite(value) ? value : 0;
}

}  // namespace

/// The station's entry. A new one gets the viewers who wait for this name.
Hub::Station& Hub::known(const std::string& name) {
  const auto [entry, is_new] = stations_.try_emplace(name);
  // no station waits under the empty name: it stands for the viewers of all stations
  if (!is_new || name.empty()) return entry->second;
  for (const auto& [peer, viewer] : viewers_) {
    if (const auto waits = viewer.by_station.find(name); waits != viewer.by_station.end())
      entry->second.watchers.push_back(viewer.by_number.at(waits->second).get());
  }
  return entry->second;
}

/// Clears the fields that belong to another session.
void Hub::setSession(Station& station, std::string_view session_id) {
  pb::StationStatus& status = station.status;
  if (status.session_id() == session_id) return;
  if (const auto before = stations_by_session_.find(status.session_id());
      before != stations_by_session_.end()) {
    before->second.erase(&station);
    if (before->second.empty()) stations_by_session_.erase(before);
  }
  status.set_session_id(std::string(session_id));
  if (!session_id.empty()) stations_by_session_[status.session_id()].insert(&station);
  status.clear_peak_force_n();
  status.clear_peak_since_unix_ns();
  status.clear_hazards_touched();
  status.clear_force_limit_n();
  status.clear_tissue();
  status.clear_started_unix_ns();
}

template <typename Act>
void Hub::forEachOfSession(const std::string& session_id, Act act) {
  const auto found = stations_by_session_.find(session_id);
  if (found == stations_by_session_.end()) return;
  for (Station* station : found->second) {
    ++looked_at_;
    act(*station);
  }
}

HubPeer* Hub::attachStation(const std::string& name, HubPeer& peer) {
  Station& station = known(name);
  HubPeer* const older = std::exchange(station.peer, &peer);
  if (older != nullptr) older->station_ = nullptr;
  peer.station_ = &station;
  if (older == nullptr) ++online_;
  station.told_watched = false;
  setSession(station, {});
  station.status.Clear();
  station.status.set_station(name);
  station.status.set_online(true);
  announce(name, station);
  refreshWatch(station);
  return older;
}

HubPeer* Hub::stationPeer(const std::string& name) const {
  const auto found = stations_.find(name);
  return found != stations_.end() ? found->second.peer : nullptr;
}

void Hub::detachStation(const std::string& name, const HubPeer& peer) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer != &peer) return;
  Station& station = found->second;
  station.peer->station_ = nullptr;
  station.peer = nullptr;
  --online_;
  station.told_watched = false;
  station.status.set_online(false);
  announce(name, station);
  forgetIfUnused(name);
}

std::optional<pb::Refusal> Hub::onStatus(const std::string& name, const pb::StationStatus& status,
                                         std::int64_t now_ns) {
  if (auto wrong = checkSessionId("station_status", status.session_id())) return wrong;
  if (const std::size_t bytes = status.ByteSizeLong(); bytes > settings_.max_status_bytes) {
    return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a status line of {} bytes: the limit is {}",
                                                           bytes, settings_.max_status_bytes));
  }
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return std::nullopt;
  Station& station = found->second;
  const bool other_session = status.session_id() != station.status.session_id();
  setSession(station, status.session_id());
  const double seen_N = station.status.peak_force_n();
  const std::int64_t seen_since = station.status.peak_since_unix_ns();
  station.status = status;
  station.status.clear_peak_since_unix_ns();
  if (!status.session_id().empty()) {
    // the station's own peak, except that of minor 1, which sends neither the peak nor the session's
    // beginning
    station.status.set_peak_force_n(
        std::max({finite(status.peak_force_n()), finite(status.force_n()), seen_N}));
    if (status.peak_force_n() == 0 && status.started_unix_ns() == 0)
      station.status.set_peak_since_unix_ns(seen_since != 0 ? seen_since : settings_.unix_now());
  }
  station.status.set_station(name);
  station.status.set_online(true);
  station.status_ns = now_ns;
  if (other_session) refreshWatch(station);
  // also tell this station's viewers when no samples arrive
  if (const auto watchers = watchersOf(station); !watchers.empty()) {
    if (const auto frame = encodeFrame(statusEnvelope(station.status)); frame.ok()) {
      for (Subscription* watcher : watchers) watcher->viewer->sendLive(*frame, false);
    }
  }
  sendOverview(name, station, now_ns);
  return std::nullopt;
}

std::optional<pb::Refusal> Hub::onLiveFrame(const std::string& name, const LiveFrameView& frame,
                                            std::int64_t now_ns) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return std::nullopt;
  return onLiveFrame(*found->second.peer, frame, now_ns);
}

std::optional<pb::Refusal> Hub::onLiveFrame(const HubPeer& from, const LiveFrameView& frame,
                                            std::int64_t now_ns) {
  if (frame.data.size() > settings_.max_frame_bytes) {
    return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a live frame of {} bytes: the limit is {}",
                                                           frame.data.size(), settings_.max_frame_bytes));
  }
  if (auto wrong = checkSessionId("live_frame", frame.session_id)) return wrong;
  // constant columns take no bytes: a small frame could otherwise take a second to decode, here and in each
  // viewer
  if (const auto claimed = claimedSamples(viewOf(frame.data));
      claimed && *claimed > settings_.max_frame_samples) {
    return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a live frame of {} samples: the limit is {}",
                                                           *claimed, settings_.max_frame_samples));
  }
  // a reconnected station has taken over: ignore its older connection
  if (from.station_ == nullptr) return std::nullopt;
  Station& station = *static_cast<Station*>(from.station_);
  const std::string& name = station.status.station();
  ++frames_in_;
  if (frame.session_id != station.status.session_id()) {
    setSession(station, frame.session_id);
    refreshWatch(station);
  }

  // decode at most once, and only when needed
  std::optional<std::vector<GestureSample>> samples;
  const auto decoded = [&]() -> std::span<const GestureSample> {
    if (!samples) {
      auto result = decodeChunk(viewOf(frame.data));
      samples = result.ok() ? std::move(*result) : std::vector<GestureSample>{};
    }
    return *samples;
  };

  // all full-rate viewers share one encoded frame
  Frame shared;
  forEachWatcher(station, [&](Subscription& watcher) {
    if (watcher.decimator) {
      sendDecimated(watcher, name, frame, decoded());
      return;
    }
    if (!shared) shared = encodeLiveFrame(frame, name);
    if (!shared) return;
    watcher.viewer->sendLive(shared, true);
    ++frames_out_;
  });

  // a station that sends frames need not send status lines: build the overview's lines from the samples
  if (!overviews_.empty() &&
      now_ns - station.status_ns >= std::chrono::nanoseconds(settings_.status_period).count()) {
    if (const auto all = decoded(); !all.empty()) {
      statusFromSamples(station, frame, all.back());
      station.status_ns = now_ns;
      sendOverview(name, station, now_ns);
    }
  }
  return std::nullopt;
}

void Hub::onSession(const std::string& name, const std::string& session_id) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return;
  setSession(found->second, session_id);
  refreshWatch(found->second);
}

bool Hub::sendToStation(const std::string& name, const pb::Envelope& envelope) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return false;
  found->second.peer->sendControl(envelope);
  return true;
}

std::optional<pb::Refusal> Hub::subscribe(HubPeer& viewer, const pb::Subscribe& wanted, std::int64_t now_ns) {
  const auto refuse = [](pb::Refusal::Reason reason, std::string text) {
    return makeRefusal(reason, std::move(text));
  };
  if (!std::isfinite(wanted.rate_hz()) || wanted.rate_hz() < 0 || wanted.rate_hz() > 1e6) {
    return refuse(pb::Refusal::INVALID,
                  fmt::format("subscribe.rate_hz {:f} is not in [0, 1e6]", wanted.rate_hz()));
  }
  if (wanted.station().size() > 256 || (!wanted.session_id().empty() && wanted.session_id().size() != 16)) {
    return refuse(pb::Refusal::INVALID, "subscribe.station is at most 256 bytes, session_id 16 or none");
  }
  if (!wanted.station().empty() && !wanted.session_id().empty()) {
    return refuse(pb::Refusal::INVALID, "subscribe: either a station or a session, not both");
  }
  const auto known_viewer = viewers_.find(&viewer);
  const std::string account = viewer.account();
  const auto counted = subscriptions_of_.find(account);
  std::size_t held = counted == subscriptions_of_.end() ? 0 : counted->second;
  if (known_viewer != viewers_.end()) {
    const Viewer& mine = known_viewer->second;
    if (mine.by_number.contains(wanted.subscription())) {
      return refuse(pb::Refusal::CONFLICT,
                    fmt::format("subscription {} exists already", wanted.subscription()));
    }
    const auto& same_kind = wanted.session_id().empty() ? mine.by_station : mine.by_session;
    const auto same = same_kind.find(wanted.session_id().empty() ? wanted.station() : wanted.session_id());
    if (same != same_kind.end()) {
      return refuse(pb::Refusal::CONFLICT,
                    fmt::format("subscription {} watches the same already", same->second));
    }
    if (account.empty()) held = mine.by_number.size();
  }
  if (held >= settings_.max_subscriptions) {
    return refuse(pb::Refusal::TOO_LARGE, fmt::format("an account has at most {} subscriptions, by all of "
                                                      "its connections together: end one of them first",
                                                      settings_.max_subscriptions));
  }

  auto owned = std::make_unique<Subscription>();
  Subscription& subscription = *owned;
  subscription.viewer = &viewer;
  subscription.number = wanted.subscription();
  subscription.station = wanted.station();
  subscription.session_id = wanted.session_id();
  subscription.rate_hz = wanted.rate_hz();
  Viewer& mine = viewers_[&viewer];
  mine.account = account;
  mine.by_number.emplace(subscription.number, std::move(owned));
  if (subscription.session_id.empty())
    mine.by_station.emplace(subscription.station, subscription.number);
  else
    mine.by_session.emplace(subscription.session_id, subscription.number);
  if (!account.empty()) ++subscriptions_of_[account];

  pb::Envelope answer;
  answer.mutable_subscribed()->set_subscription(wanted.subscription());
  viewer.sendControl(answer);

  if (subscription.station.empty() && subscription.session_id.empty()) {
    overviews_.push_back(&subscription);
    std::size_t bytes = 0;
    for (auto& [name, station] : stations_) {
      ++looked_at_;
      if (station.peer == nullptr) continue;
      // not more at once than a viewer's queue can take; the other statuses follow with their next lines
      if ((bytes += station.status.ByteSizeLong()) > kMostStatusBytes) break;
      sendStatus(viewer, station.status);
      subscription.last_line_ns[&station] = now_ns;
    }
    return std::nullopt;
  }
  if (wanted.rate_hz() > 0) subscription.decimator.emplace(wanted.rate_hz());
  if (!subscription.session_id.empty()) {
    by_session_[subscription.session_id].push_back(&subscription);
    forEachOfSession(subscription.session_id, [&](Station& station) {
      sendStatus(viewer, station.status);
      refreshWatch(station);
    });
    return std::nullopt;
  }
  const auto found = stations_.find(subscription.station);
  if (found == stations_.end()) {
    pb::StationStatus offline;
    offline.set_station(subscription.station);
    sendStatus(viewer, offline);
    return std::nullopt;
  }
  Station& station = found->second;
  ++looked_at_;
  station.watchers.push_back(&subscription);
  sendStatus(viewer, station.status);
  refreshWatch(station);
  return std::nullopt;
}

std::optional<pb::Refusal> Hub::unsubscribe(HubPeer& viewer, std::uint32_t subscription) {
  const auto mine = viewers_.find(&viewer);
  if (mine == viewers_.end() || !mine->second.by_number.contains(subscription)) {
    return makeRefusal(pb::Refusal::NOT_FOUND, fmt::format("no subscription {}", subscription));
  }
  Viewer& all = mine->second;
  auto owned = std::move(all.by_number.extract(subscription).mapped());
  if (owned->session_id.empty())
    all.by_station.erase(owned->station);
  else
    all.by_session.erase(owned->session_id);
  remove(all, std::move(owned));
  if (all.by_number.empty()) viewers_.erase(mine);
  return std::nullopt;
}

void Hub::detachViewer(const HubPeer& viewer) {
  const auto mine = viewers_.find(&viewer);
  if (mine == viewers_.end()) return;
  Viewer all = std::move(mine->second);
  viewers_.erase(mine);
  for (auto& [number, subscription] : all.by_number) remove(all, std::move(subscription));
}

void Hub::remove(const Viewer& of, std::unique_ptr<Subscription> subscription) {
  Subscription* const gone = subscription.get();
  if (const auto counted = subscriptions_of_.find(of.account); counted != subscriptions_of_.end()) {
    if (--counted->second == 0) subscriptions_of_.erase(counted);
  }
  if (!gone->session_id.empty()) {
    const auto found = by_session_.find(gone->session_id);
    std::erase(found->second, gone);
    if (found->second.empty()) by_session_.erase(found);
    forEachOfSession(gone->session_id, [this](Station& station) { refreshWatch(station); });
    return;
  }
  if (gone->station.empty()) {
    std::erase(overviews_, gone);
    return;
  }
  const auto found = stations_.find(gone->station);
  if (found == stations_.end()) return;  // it has not been online meanwhile
  ++looked_at_;
  std::erase(found->second.watchers, gone);
  refreshWatch(found->second);
  forgetIfUnused(gone->station);
}

std::size_t Hub::subscriptions() const {
  std::size_t sum = 0;
  for (const auto& [peer, viewer] : viewers_) sum += viewer.by_number.size();
  return sum;
}

void Hub::fillStations(pb::Stations& stations) const {
  std::size_t bytes = stations.ByteSizeLong();
  for (pb::StationInfo& info : *stations.mutable_stations()) {
    const auto found = stations_.find(info.name());
    const bool online = found != stations_.end() && found->second.peer != nullptr;
    info.set_online(online);
    if (!online) continue;
    bytes += found->second.status.ByteSizeLong() + 16;
    if (bytes <= kMostStatusBytes) *info.mutable_status() = found->second.status;
  }
}

bool Hub::isWatched(const std::string& name) const {
  const auto found = stations_.find(name);
  return found != stations_.end() && found->second.told_watched;
}

std::vector<Hub::Subscription*> Hub::watchersOf(const Station& station) const {
  std::vector<Subscription*> all = station.watchers;
  if (by_session_.empty() || station.status.session_id().empty()) return all;
  if (const auto found = by_session_.find(station.status.session_id()); found != by_session_.end()) {
    for (Subscription* watcher : found->second) {
      // send each frame once to a viewer of both the station and its session
      const auto same = [&](const Subscription* other) { return other->viewer == watcher->viewer; };
      if (std::none_of(all.begin(), all.end(), same)) all.push_back(watcher);
    }
  }
  return all;
}

template <typename Act>
void Hub::forEachWatcher(const Station& station, Act act) const {
  if (by_session_.empty()) {  // the usual case: avoids building a list
    for (Subscription* watcher : station.watchers) act(*watcher);
    return;
  }
  for (Subscription* watcher : watchersOf(station)) act(*watcher);
}

void Hub::refreshWatch(Station& station) {
  if (station.peer == nullptr) return;
  const bool watched = !station.watchers.empty() || by_session_.contains(station.status.session_id());
  if (watched == station.told_watched) return;
  station.told_watched = watched;
  pb::Envelope envelope;
  envelope.mutable_watch_state()->set_watched(watched);
  station.peer->sendControl(envelope);
}

void Hub::forgetIfUnused(const std::string& name) {
  const auto found = stations_.find(name);
  Station& station = found->second;
  if (station.peer != nullptr || !station.watchers.empty()) return;
  setSession(station, {});
  for (Subscription* overview : overviews_) overview->last_line_ns.erase(&station);
  stations_.erase(found);
}

void Hub::announce(const std::string& name, Station& station) {
  station.status.set_station(name);
  for (Subscription* watcher : watchersOf(station)) sendStatus(*watcher->viewer, station.status);
  for (Subscription* overview : overviews_) sendStatus(*overview->viewer, station.status);
}

void Hub::sendOverview(const std::string& name, Station& station, std::int64_t now_ns) {
  if (overviews_.empty()) return;
  station.status.set_station(name);
  // with many stations, send fewer lines of each, so that a viewer gets a readable number
  const double many_ns = 1e9 * static_cast<double>(online_) / settings_.overview_lines_per_s;
  const double least_ns =
      std::max(many_ns, static_cast<double>(std::chrono::nanoseconds(settings_.status_period).count()));
  Frame shared;
  for (Subscription* overview : overviews_) {
    const double period_ns = overview->rate_hz > 0 ? std::max(least_ns, 1e9 / overview->rate_hz) : least_ns;
    const auto [last, first_time] = overview->last_line_ns.try_emplace(&station, 0);
    // accept a line up to a tenth of the period early: lines come at 10 Hz with some jitter
    if (!first_time && static_cast<double>(now_ns - last->second) < 0.9 * period_ns) continue;
    last->second = now_ns;
    if (!shared) {
      auto encoded = encodeFrame(statusEnvelope(station.status));
      if (!encoded.ok()) return;
      shared = std::move(*encoded);
    }
    overview->viewer->sendLive(shared, false);
  }
}

void Hub::sendDecimated(Subscription& subscription, const std::string& name, const LiveFrameView& frame,
                        std::span<const GestureSample> samples) {
  // show frames that the station's queue dropped as a gap in this subscription's numbers
  if (subscription.last_upstream_seq && frame.frame_seq > *subscription.last_upstream_seq + 1) {
    subscription.frames += frame.frame_seq - *subscription.last_upstream_seq - 1;
  }
  subscription.last_upstream_seq = frame.frame_seq;
  const auto kept = subscription.decimator->keep(samples);
  if (kept.empty()) return;
  const auto info = inspectChunk(viewOf(frame.data));
  if (!info.ok()) return;
  const Bytes data = encodeChunk(info->resolution, kept);
  LiveFrameView thinned = frame;
  thinned.frame_seq = subscription.frames++;
  thinned.data = textOf(data);
  if (Frame encoded = encodeLiveFrame(thinned, name)) {
    subscription.viewer->sendLive(std::move(encoded), true);
    ++frames_out_;
  }
}

void Hub::statusFromSamples(Station& station, const LiveFrameView& frame, const GestureSample& last) {
  setSession(station, frame.session_id);
  pb::StationStatus& status = station.status;
  status.set_phase(last.phase);
  status.set_layer(last.layer);
  status.set_insertion_m(last.insertion_m);
  status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
  // the station's own peak covers every sample; until its next line, at least this value
  status.set_peak_force_n(std::max(status.peak_force_n(), finite(status.force_n())));
  status.set_fault(last.fault);
  status.set_samples(last.tick + 1);
}

Decimator::Decimator(double rate_hz)
    : period_ns_(std::max<std::int64_t>(
          1, static_cast<std::int64_t>(std::llround(1e9 / std::max(rate_hz, 1e-3))))) {}

std::vector<GestureSample> Decimator::keep(std::span<const GestureSample> samples) {
  std::vector<GestureSample> kept;
  for (const GestureSample& sample : samples) {
    // a new session or a restarted station: its clock has another origin
    const bool jumped = started_ && sample.time_ns < last_ns_;
    if (!started_ || jumped) {
      started_ = true;
      due_ns_ = sample.time_ns;
    }
    last_ns_ = sample.time_ns;
    if (sample.time_ns < due_ns_) continue;
    kept.push_back(sample);
    // the next grid point in the future
    const auto periods = (static_cast<std::uint64_t>(sample.time_ns) - static_cast<std::uint64_t>(due_ns_)) /
                             static_cast<std::uint64_t>(period_ns_) +
                         1;
    due_ns_ = static_cast<std::int64_t>(static_cast<std::uint64_t>(due_ns_) +
                                        periods * static_cast<std::uint64_t>(period_ns_));
  }
  return kept;
}

}  // namespace needlelab
