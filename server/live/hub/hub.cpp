#include "server/live/hub/hub.h"

#include <fmt/core.h>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <utility>

#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"
#include "db/people/person_refs.h"

namespace needlelab {
namespace {

pb::Envelope statusEnvelope(const pb::StationStatus& status) {
  pb::Envelope envelope;
  *envelope.mutable_station_status() = status;
  return envelope;
}

/// Limits the length of session ids, because they are stored and forwarded to viewers.
std::optional<pb::Refusal> checkSessionId(const char* message, std::string_view id) {
  if (id.empty() || id.size() == 16) return std::nullopt;
  return makeRefusal(pb::Refusal::INVALID,
                     fmt::format("{}.session_id has {} bytes, not 16 or none", message, id.size()));
}

/// For numbers from the network: a peak that is NaN or infinite would never go away.
double finite(double value) {
  return std::isfinite(value) ? value : 0;
}

}  // namespace

void HubPeer::onWatched(bool watched, double /*rate_hz*/) {
  pb::Envelope envelope;
  envelope.mutable_watch_state()->set_watched(watched);
  sendControl(envelope);
}

void Hub::sendStatus(HubPeer& viewer, const pb::StationStatus& status) {
  if (status.ByteSizeLong() <= kMaxStatusBytes) viewer.sendControl(statusEnvelope(status));
}

/// The station's entry. A new one gets the viewers that wait for this name.
Hub::Station& Hub::stationNamed(const std::string& name) {
  const auto [entry, is_new] = stations_.try_emplace(name);
  // the empty name stands for the viewers of all stations
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
  assert(status.session_id().empty() || stations_by_session_.contains(status.session_id()));
  if (const auto before = stations_by_session_.find(status.session_id());
      before != stations_by_session_.end()) {
    before->second.erase(&station);
    if (before->second.empty()) stations_by_session_.erase(before);
  }
  status.set_session_id(std::string(session_id));
  if (!session_id.empty()) stations_by_session_[status.session_id()].insert(&station);
  status.clear_peak_force_n();
  status.clear_hazards_touched();
  status.clear_alarms();
  status.clear_force_limit_n();
  status.clear_tissue();
  status.clear_started_unix_ns();
}

/// Updates the counts and resets the watch state sent to the last connection.
void Hub::switchPeer(Station& station, HubPeer* peer) {
  if (HubPeer* const before = station.peer; before != nullptr) {
    assert(online_ > 0 && (!before->isRemote() || remote_count_ > 0));
    before->station_ = nullptr;
    --online_;
    if (before->isRemote()) --remote_count_;
  }
  station.peer = peer;
  station.epoch = 0;
  station.watch_announced = false;
  station.announced_rate_hz = station.reduced_hz = 0;
  if (peer == nullptr) return;
  peer->station_ = &station;
  ++online_;
  if (peer->isRemote()) ++remote_count_;
  assert(remote_count_ <= online_ && online_ <= stations_.size());
}

HubPeer* Hub::attachStation(const std::string& name, HubPeer& peer, std::uint64_t epoch) {
  Station& station = stationNamed(name);
  HubPeer* const older = station.peer;
  if (!peer.isRemote()) {
    station.displaced = nullptr;
  } else if (older != nullptr && !older->isRemote()) {
    station.displaced = older;
    station.displaced_epoch = station.epoch;
    older->onDisplaced();
  }
  switchPeer(station, &peer);
  station.epoch = epoch;
  setSession(station, {});
  station.status.Clear();
  station.status.set_station(name);
  station.status.set_online(true);
  station.status.set_server(settings_.server_name);
  announce(station);
  refreshWatch(station);
  return older;
}

HubPeer* Hub::stationPeer(const std::string& name) const {
  const auto found = stations_.find(name);
  return found != stations_.end() ? found->second.peer : nullptr;
}

std::uint64_t Hub::epochOf(const std::string& name) const {
  const auto found = stations_.find(name);
  return found != stations_.end() ? found->second.epoch : 0;
}

void Hub::detachStation(const std::string& name, const HubPeer& peer) {
  const auto found = stations_.find(name);
  if (found == stations_.end()) return;
  Station& station = found->second;
  if (station.displaced == &peer) station.displaced = nullptr;
  if (station.peer != &peer) return;
  if (HubPeer* const back = std::exchange(station.displaced, nullptr); back != nullptr) {
    const std::uint64_t epoch = station.displaced_epoch;
    (void)attachStation(name, *back, epoch);
    return;
  }
  switchPeer(station, nullptr);
  station.status.set_online(false);
  // it may be connected to a server that is out of reach
  if (!live_trouble_.empty()) station.status.set_trouble(live_trouble_);
  announce(station);
  forgetIfUnused(name);
}

std::optional<pb::Refusal> Hub::checkStatusBytes(std::size_t bytes) const {
  if (bytes <= settings_.max_status_bytes) return std::nullopt;
  return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a status line of {} bytes: the limit is {}", bytes,
                                                         settings_.max_status_bytes));
}

std::optional<pb::Refusal> Hub::onStatus(const std::string& name, const pb::StationStatus& status,
                                         std::int64_t now_ns) {
  if (auto wrong = checkSessionId("station_status", status.session_id())) return wrong;
  if (auto wrong = checkStatusBytes(status.ByteSizeLong())) return wrong;
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return std::nullopt;
  Station& station = found->second;
  const bool other_session = status.session_id() != station.status.session_id();
  setSession(station, status.session_id());
  const double seen_N = station.status.peak_force_n();
  station.status = status;
  if (isForgotten(station)) forgetTraineeOf(station.status);
  if (!status.session_id().empty())
    station.status.set_peak_force_n(
        std::max({finite(status.peak_force_n()), finite(status.force_n()), seen_N}));
  station.status.set_station(name);
  station.status.set_online(true);
  station.status.set_server(settings_.server_name);
  station.status_ns = now_ns;
  if (other_session) refreshWatch(station);
  notifyViewers(station, now_ns);
  return std::nullopt;
}

std::optional<pb::Refusal> Hub::onRemoteStatus(const HubPeer& from, const pb::StationStatus& status,
                                               std::int64_t now_ns, bool news) {
  if (auto wrong = checkSessionId("station_status", status.session_id())) return wrong;
  if (from.station_ == nullptr) return std::nullopt;
  Station& station = *static_cast<Station*>(from.station_);
  assert(station.peer == &from);
  const std::string name = station.status.station();
  const bool other_session = status.session_id() != station.status.session_id();
  setSession(station, status.session_id());
  // the other server has filled in everything except what only this one knows
  station.status = status;
  station.status.set_station(name);
  station.status.set_online(true);
  if (isForgotten(station)) forgetTraineeOf(station.status);
  station.status_ns = now_ns;
  if (other_session) refreshWatch(station);
  if (news)
    announce(station);
  else
    notifyViewers(station, now_ns);
  return std::nullopt;
}

/// Also sends a status line to this station's viewers, because samples may not arrive.
void Hub::notifyViewers(const Station& station, std::int64_t now_ns) {
  if (const auto watchers = watchersOf(station); !watchers.empty()) {
    if (const auto frame = encodeFrame(statusEnvelope(station.status)); frame.ok()) {
      for (Subscription* watcher : watchers) watcher->viewer->sendLive(*frame, false);
    }
  }
  sendOverview(station, now_ns);
}

std::optional<pb::Refusal> Hub::onLiveFrame(const std::string& name, const LiveFrameView& frame,
                                            std::int64_t now_ns) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return std::nullopt;
  return onLiveFrame(*found->second.peer, frame, now_ns);
}

std::optional<pb::Refusal> Hub::onLiveFrame(const HubPeer& from, const LiveFrameView& frame,
                                            std::int64_t now_ns, double reduced_hz) {
  if (frame.data.size() > settings_.max_frame_bytes) {
    return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a live frame of {} bytes: the limit is {}",
                                                           frame.data.size(), settings_.max_frame_bytes));
  }
  if (frame.cut_memory.size() > settings_.max_cut_memory_bytes) {
    return makeRefusal(pb::Refusal::TOO_LARGE,
                       fmt::format("a live frame's cut_memory of {} bytes: the limit is {}",
                                   frame.cut_memory.size(), settings_.max_cut_memory_bytes));
  }
  if (frame.paths.size() > settings_.max_paths_bytes) {
    return makeRefusal(pb::Refusal::TOO_LARGE,
                       fmt::format("a live frame's paths of {} bytes: the limit is {}", frame.paths.size(),
                                   settings_.max_paths_bytes));
  }
  if (auto wrong = checkSessionId("live_frame", frame.session_id)) return wrong;
  // constant columns take no bytes, so a small frame could take a second to decode, here and in each viewer
  if (const auto claimed = claimedSamples(viewOf(frame.data));
      claimed && *claimed > settings_.max_frame_samples) {
    return makeRefusal(pb::Refusal::TOO_LARGE, fmt::format("a live frame of {} samples: the limit is {}",
                                                           *claimed, settings_.max_frame_samples));
  }
  // a newer connection of the station has taken over: ignore frames from the older one
  if (from.station_ == nullptr) return std::nullopt;
  Station& station = *static_cast<Station*>(from.station_);
  assert(station.peer == &from);
  const std::string& name = station.status.station();
  ++frames_in_;
  if (frame.session_id != station.status.session_id()) {
    setSession(station, frame.session_id);
    refreshWatch(station);
  }

  // another server starts or stops reducing the rate, so the frame numbers change
  if (std::exchange(station.reduced_hz, reduced_hz) != reduced_hz)
    for (auto& [rate_hz, frames] : station.reduced) frames.otherNumbers();

  // all full-rate viewers share one encoded frame; so do all viewers of each lower rate
  LiveSamples samples(frame.data);
  Frame full;
  std::map<double, Frame> reduced;
  forEachWatcher(station, [&](Subscription& watcher) {
    Frame* to_send = &full;
    if (watcher.rate_hz > 0) {
      const auto [made, is_new] = reduced.try_emplace(watcher.rate_hz);
      if (is_new)
        made->second = reduce(station, watcher.rate_hz, frame, samples, watcher.rate_hz == reduced_hz);
      to_send = &made->second;
    } else if (!full && reduced_hz == 0) {
      full = encodeLiveFrame(frame, name);
    }
    if (!*to_send) return;
    watcher.viewer->sendLive(*to_send, true);
    ++frames_out_;
  });
  // drop rates that have no viewer any more
  std::erase_if(station.reduced, [&](const auto& entry) { return !reduced.contains(entry.first); });

  // a station that sends frames need not send status lines: build overview lines from the samples
  if ((!overviews_.empty() || keep_fresh_) && !from.isRemote() &&
      now_ns - station.status_ns >= std::chrono::nanoseconds(settings_.status_period).count()) {
    if (const auto all = samples.all(); !all.empty()) {
      statusFromSamples(station, all.back());
      station.status_ns = now_ns;
      sendOverview(station, now_ns);
    }
  }
  if (samples.decoded()) ++frames_decoded_;
  return std::nullopt;
}

void Hub::onSession(const std::string& name, const std::string& session_id, const std::string& trainee_ref) {
  const auto found = stations_.find(name);
  if (found == stations_.end() || found->second.peer == nullptr) return;
  found->second.kept_session = session_id;
  found->second.trainee_ref = trainee_ref;
  setSession(found->second, session_id);
  refreshWatch(found->second);
}

void Hub::forgetTrainee(const std::string& ref) {
  if (!isPersonRef(ref)) return;
  erased_.insert(ref);
  for (auto& [name, station] : stations_) {
    if (station.trainee_ref != ref || station.status.trainee().empty()) continue;
    forgetTraineeOf(station.status);
    announce(station);
  }
}

std::vector<std::string> Hub::shownTrainees() const {
  std::vector<std::string> refs;
  for (const auto& [name, station] : stations_)
    if (isPersonRef(station.trainee_ref) && !station.status.trainee().empty())
      refs.push_back(station.trainee_ref);
  return refs;
}

/// Whether the trainee of its session was erased.
bool Hub::isForgotten(const Station& station) const {
  return station.kept_session == station.status.session_id() && erased_.contains(station.trainee_ref);
}

void Hub::fillStations(pb::Stations& stations) const {
  std::size_t bytes = stations.ByteSizeLong();
  for (pb::StationInfo& info : *stations.mutable_stations()) {
    const auto found = stations_.find(info.name());
    const bool online = found != stations_.end() && found->second.peer != nullptr;
    info.set_online(online);
    if (!online) continue;
    bytes += found->second.status.ByteSizeLong() + 16;
    if (bytes <= kMaxStatusBytes) *info.mutable_status() = found->second.status;
  }
  stations.set_live_trouble(live_trouble_);
}

void Hub::setLiveTrouble(const std::string& why) {
  if (std::exchange(live_trouble_, why) == why) return;
  for (auto& [peer, viewer] : viewers_) {
    for (const auto& [name, number] : viewer.by_station) {
      const auto found = stations_.find(name);
      if (name.empty() || (found != stations_.end() && found->second.peer != nullptr)) continue;
      sendStatus(*viewer.by_number.at(number)->viewer, offlineStatus(name));
    }
  }
}

/// For a station that, as far as this server knows, is not connected anywhere.
pb::StationStatus Hub::offlineStatus(const std::string& name) {
  pb::StationStatus status;
  const auto found = stations_.find(name);
  if (found != stations_.end()) {
    found->second.status.set_trouble(live_trouble_);
    status = found->second.status;
  }
  status.set_station(name);
  status.set_trouble(live_trouble_);
  return status;
}

bool Hub::isWatched(const std::string& name) const {
  const auto found = stations_.find(name);
  return found != stations_.end() && found->second.watch_announced;
}

std::vector<Hub::Subscription*> Hub::watchersOf(const Station& station) const {
  std::vector<Subscription*> all = station.watchers;
  if (by_session_.empty() || station.status.session_id().empty()) return all;
  if (const auto found = by_session_.find(station.status.session_id()); found != by_session_.end()) {
    for (Subscription* watcher : found->second) {
      // send each frame only once to a viewer of both the station and its session
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
  const double rate_hz = watched && station.peer->isRemote() ? commonRate(station) : 0;
  if (watched == station.watch_announced && rate_hz == station.announced_rate_hz) return;
  station.watch_announced = watched;
  station.announced_rate_hz = rate_hz;
  station.peer->onWatched(watched, rate_hz);
}

/// The lower rate that all viewers of the station use; 0: they have no common one.
double Hub::commonRate(const Station& station) const {
  const std::vector<Subscription*> all = watchersOf(station);
  const auto other = [&](const Subscription* each) { return each->rate_hz != all.front()->rate_hz; };
  return all.empty() || std::any_of(all.begin(), all.end(), other) ? 0 : all.front()->rate_hz;
}

void Hub::forgetIfUnused(const std::string& name) {
  const auto found = stations_.find(name);
  assert(found != stations_.end());
  Station& station = found->second;
  if (station.peer != nullptr || !station.watchers.empty()) return;
  setSession(station, {});
  for (Subscription* overview : overviews_) overview->last_line_ns.erase(&station);
  stations_.erase(found);
}

void Hub::announce(const Station& station) const {
  for (Subscription* watcher : watchersOf(station)) sendStatus(*watcher->viewer, station.status);
  for (Subscription* overview : overviews_) sendStatus(*overview->viewer, station.status);
}

void Hub::sendOverview(const Station& station, std::int64_t now_ns) {
  if (overviews_.empty()) return;
  // with many stations, send fewer lines of each so that the overview stays readable
  const double many_ns = 1e9 * static_cast<double>(online_) / settings_.overview_lines_per_s;
  const double min_ns =
      std::max(many_ns, static_cast<double>(std::chrono::nanoseconds(settings_.status_period).count()));
  Frame shared;
  for (Subscription* overview : overviews_) {
    const double period_ns = overview->rate_hz > 0 ? std::max(min_ns, 1e9 / overview->rate_hz) : min_ns;
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

/// `is_reduced`: another server has already reduced it to this rate.
Frame Hub::reduce(Station& station, double rate_hz, const LiveFrameView& frame, LiveSamples& samples,
                  bool is_reduced) {
  assert(rate_hz > 0);
  ReducedFrames& frames = station.reduced.try_emplace(rate_hz, rate_hz).first->second;
  Frame made = is_reduced ? frames.asItIs(frame, station.status.station())
                          : frames.next(frame, samples, station.status.station());
  if (made) ++frames_reduced_;
  return made;
}

void Hub::statusFromSamples(Station& station, const GestureSample& last) {
  pb::StationStatus& status = station.status;
  status.set_phase(last.phase);
  status.set_layer(last.layer);
  status.set_insertion_m(last.insertion_m);
  status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
  // the station's own peak covers every sample; until its next line, use at least this value
  status.set_peak_force_n(std::max(status.peak_force_n(), finite(status.force_n())));
  status.set_fault(last.fault);
  status.set_samples(last.tick + 1);
}

}  // namespace needlelab
