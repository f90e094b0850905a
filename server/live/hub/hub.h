/// The live plane: online stations, their viewers, and the forwarding of live data.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/gesture/sample.h"
#include "common/wire/live_frames.h"
#include "common/wire/protocol.h"
#include "needlelab/control.pb.h"
#include "needlelab/envelope.pb.h"
#include "server/live/hub/rate_reduction.h"

namespace needlelab {

/// For an erased person, or one whom the server does not know.
inline void forgetTraineeOf(pb::StationStatus& status) {
  status.clear_trainee();
  status.clear_trainee_full_name();
}

/// A receiver of the hub's messages: a connection of the server, or a test.
class HubPeer {
 public:
  HubPeer() = default;
  HubPeer(const HubPeer&) = delete;
  HubPeer& operator=(const HubPeer&) = delete;
  virtual ~HubPeer() = default;
  virtual void sendControl(const pb::Envelope& envelope) = 0;
  /// Never blocks: a slow peer drops its own oldest frames. `counted`: a LiveFrame.
  virtual void sendLive(Frame frame, bool counted) = 0;
  /// The account that subscriptions count for; empty: only this peer. Constant once the peer subscribes.
  [[nodiscard]] virtual std::string account() const { return {}; }
  /// For a station: true if it is connected to another server and this peer represents it.
  [[nodiscard]] virtual bool isRemote() const { return false; }
  /// Another server claims the station with a newer log-in. The hub believes it until that claim ends.
  virtual void onDisplaced() {}
  /// For a station: whether it has viewers. `rate_hz`: the reduced rate if all viewers use the same one; 0:
  /// the rates differ, or a viewer wants all samples. Passed only for a station on another server. Sends a
  /// WatchState.
  virtual void onWatched(bool watched, double rate_hz);

 private:
  friend class Hub;
  void* station_ = nullptr;  // set by the hub: this peer's station while attached
};

struct HubSettings {
  /// Minimum interval between lines of one station in an overview.
  std::chrono::milliseconds status_period{100};
  double overview_lines_per_s = 500;        ///< over all stations, for one viewer
  std::size_t max_subscriptions = 2000;     ///< of one account over all its connections
  std::size_t max_frame_bytes = 64u << 10;  ///< of a live frame's data
  std::size_t max_frame_samples = 1000;     ///< of a live frame; stations send 20
  std::size_t max_cut_memory_bytes = 4096;  ///< of a live frame; stations send 3,300 at most
  std::size_t max_paths_bytes = 32'768;     ///< of a live frame; stations send a few hundred
  std::size_t max_status_bytes = 2048;      ///< of a station's status line
  std::string server_name{};                ///< for StationStatus.server; empty: the only server of the lab
};

/// Peers must detach before their destruction. Times: steady clock, ns, from the caller. Thread: one; no
/// locks.
class Hub {
 public:
  explicit Hub(HubSettings settings = {}) : settings_(settings) {}

  // --- stations
  /// Marks the station as online through `peer`. Returns the station's older connection, if any, which is now
  /// detached. `epoch`: of its claim; 0: unknown.
  HubPeer* attachStation(const std::string& name, HubPeer& peer, std::uint64_t epoch = 0);
  /// The station's connection, or its representative when the station is on another server; null when it is
  /// offline.
  [[nodiscard]] HubPeer* stationPeer(const std::string& name) const;
  /// The epoch of the station's current connection; 0: unknown or no connection.
  [[nodiscard]] std::uint64_t epochOf(const std::string& name) const;
  /// Does nothing when another connection of the station has taken over.
  void detachStation(const std::string& name, const HubPeer& peer);
  /// The refusal for a status line of `bytes` bytes; nothing if the size is allowed.
  [[nodiscard]] std::optional<pb::Refusal> checkStatusBytes(std::size_t bytes) const;
  /// Returns a refusal and discards the status when it is too large or its session_id is invalid. Keeps the
  /// trainee's name only if the server stores the session under that name: the server does not know whom it
  /// erased before it started.
  std::optional<pb::Refusal> onStatus(const std::string& name, const pb::StationStatus& status,
                                      std::int64_t now_ns);
  /// Returns a refusal when the frame is too large, claims too many samples or its session_id is invalid.
  /// `reduced_hz`: the rate to which another server has reduced it; 0: it has all samples.
  std::optional<pb::Refusal> onLiveFrame(const HubPeer& from, const LiveFrameView& frame, std::int64_t now_ns,
                                         double reduced_hz = 0);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const LiveFrameView& frame,
                                         std::int64_t now_ns);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const pb::LiveFrame& frame,
                                         std::int64_t now_ns) {
    return onLiveFrame(name, viewOf(frame), now_ns);
  }
  /// The station's session changed; viewers of this session now watch this station. `trainee_ref`: the
  /// session's trainee (people.ref), may be empty.
  void onSession(const std::string& name, const std::string& session_id, const std::string& trainee_ref = {});
  /// This person was erased. No status contains the name from now on, even if stations keep sending it.
  /// Notifies the viewers.
  void forgetTrainee(const std::string& ref);
  /// Whether forgetTrainee() had this ref.
  [[nodiscard]] bool isErased(const std::string& ref) const { return erased_.contains(ref); }
  /// The refs of all trainees named in statuses.
  [[nodiscard]] std::vector<std::string> shownTrainees() const;
  /// A status from another server for a station that `from` represents; ignored if it no longer does. `news`:
  /// sent to all viewers of the station at once, regardless of their rate. Returns a refusal and discards the
  /// status like onStatus.
  std::optional<pb::Refusal> onRemoteStatus(const HubPeer& from, const pb::StationStatus& status,
                                            std::int64_t now_ns, bool news);
  /// Calls `act(name, status, epoch)` for each station that is connected to this server.
  template <typename Act>
  void forEachLocal(Act act) const {
    for (const auto& [name, station] : stations_)
      if (station.peer != nullptr && !station.peer->isRemote()) act(name, station.status, station.epoch);
  }
  /// If set, updates statuses from frames even without an overview here, because other servers may have one.
  void keepStatusesFresh(bool wanted) { keep_fresh_ = wanted; }
  /// Why nothing is known about stations on other servers; empty if it is known. Notifies the viewers of
  /// stations that are offline here.
  void setLiveTrouble(const std::string& why);

  // --- viewers
  /// Sends Subscribed and the station's newest status (online or not), or returns the refusal. Samples of a
  /// station or session are sent at reducedRateOf the requested rate.
  std::optional<pb::Refusal> subscribe(HubPeer& viewer, const pb::Subscribe& wanted, std::int64_t now_ns);
  std::optional<pb::Refusal> unsubscribe(HubPeer& viewer, std::uint32_t subscription);
  void detachViewer(const HubPeer& viewer);

  /// Fills in `online` and `status` of each station in a list from the database. Omits the remaining statuses
  /// when the list would exceed a message.
  void fillStations(pb::Stations& stations) const;

  /// Including those on other servers.
  [[nodiscard]] std::size_t stationsOnline() const { return online_; }
  [[nodiscard]] std::size_t remoteStations() const { return remote_count_; }
  [[nodiscard]] bool isWatched(const std::string& station) const;
  /// Stations that are online, and offline ones that were online and still have viewers.
  [[nodiscard]] std::size_t stationsKnown() const { return stations_.size(); }
  [[nodiscard]] std::size_t subscriptions() const;
  /// Stations visited when subscriptions begin or end, since the start; a measure of their cost.
  [[nodiscard]] std::uint64_t stationsLookedAt() const { return looked_at_; }
  [[nodiscard]] std::uint64_t framesIn() const { return frames_in_; }
  [[nodiscard]] std::uint64_t framesOut() const { return frames_out_; }
  /// Received frames whose samples were needed here.
  [[nodiscard]] std::uint64_t framesDecoded() const { return frames_decoded_; }
  /// Frames made for viewers with a rate: one per station and rate of kReducedRates_hz, for all its viewers.
  [[nodiscard]] std::uint64_t framesReduced() const { return frames_reduced_; }

 private:
  struct Station;
  struct Subscription {
    HubPeer* viewer = nullptr;
    std::uint32_t number = 0;
    std::string station, session_id;  // both empty: the overview
    double rate_hz = 0;  // 0: all samples; overview: lines per second; otherwise a rate of reducedRateOf
    std::unordered_map<const Station*, std::int64_t>
        last_line_ns;  // overview: time of the last line for each station
  };
  /// A viewer's subscriptions, by number and by what they watch (a station's name or a session's id).
  struct Viewer {
    std::string account;
    std::map<std::uint32_t, std::unique_ptr<Subscription>> by_number;
    std::map<std::string, std::uint32_t> by_station, by_session;  // the overview has an empty station name
  };
  struct Station {
    HubPeer* peer = nullptr;  // null: offline, but a viewer watches it
    std::uint64_t epoch = 0;
    // the connection here that one on another server displaced, until that one ends: the database decides,
    // not the hub
    HubPeer* displaced = nullptr;
    std::uint64_t displaced_epoch = 0;
    bool watch_announced = false;
    double announced_rate_hz = 0;  // with watch_announced, for a station on another server
    double reduced_hz = 0;         // of the last frame
    pb::StationStatus status;
    std::int64_t status_ns = 0;
    std::string kept_session, trainee_ref;  // the last session that the server stores, and its trainee
    std::vector<Subscription*> watchers;
    std::map<double, ReducedFrames> reduced;  // by rate: those with a viewer at the last frame
  };
  /// Maximum size of the statuses in one message or one overview answer; leaves space for its other fields.
  static constexpr std::size_t kMaxStatusBytes = kMaxFrameBytes - (64u << 10);

  /// Skips a message that cannot be encoded, so that the viewer keeps its connection.
  static void sendStatus(HubPeer& viewer, const pb::StationStatus& status);
  Station& stationNamed(const std::string& name);
  void setSession(Station& station, std::string_view session_id);
  template <typename Act>
  void forEachOfSession(const std::string& session_id, Act act);
  void refreshWatch(Station& station);
  [[nodiscard]] bool isForgotten(const Station& station) const;
  void forgetIfUnused(const std::string& name);
  void announce(const Station& station) const;
  void sendOverview(const Station& station, std::int64_t now_ns);
  Frame reduce(Station& station, double rate_hz, const LiveFrameView& frame, LiveSamples& samples,
               bool is_reduced);
  void switchPeer(Station& station, HubPeer* peer);
  void notifyViewers(const Station& station, std::int64_t now_ns);
  [[nodiscard]] pb::StationStatus offlineStatus(const std::string& name);
  [[nodiscard]] double commonRate(const Station& station) const;
  static void statusFromSamples(Station& station, const GestureSample& last);
  void remove(const Viewer& of, std::unique_ptr<Subscription> subscription);
  [[nodiscard]] std::vector<Subscription*> watchersOf(const Station& station) const;
  template <typename Act>
  void forEachWatcher(const Station& station, Act act) const;

  HubSettings settings_;
  /// Stations that are online, or were while watched. Other subscriptions are kept with their viewer only.
  std::unordered_map<std::string, Station> stations_;
  // ordered: viewers choose these ids, and could choose them to collide in a hash table
  std::map<std::string, std::set<Station*>> stations_by_session_;  // as in their statuses
  std::map<std::string, std::vector<Subscription*>> by_session_;
  std::unordered_map<const HubPeer*, Viewer> viewers_;
  std::unordered_map<std::string, std::size_t> subscriptions_of_;  // by account; zeros are removed
  std::vector<Subscription*> overviews_;
  std::set<std::string> erased_;  // refs, from forgetTrainee()
  std::string live_trouble_;      // from setLiveTrouble()
  bool keep_fresh_ = false;
  std::size_t online_ = 0, remote_count_ = 0;  // online_ includes remote_count_
  std::uint64_t looked_at_ = 0;
  std::uint64_t frames_in_ = 0, frames_out_ = 0, frames_decoded_ = 0, frames_reduced_ = 0;
};

}  // namespace needlelab
