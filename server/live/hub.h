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
#include "server/live/live_thinning.h"

namespace needlelab {

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
  /// Whose subscriptions these are; empty: the peer's alone. Does not change once the peer subscribes.
  [[nodiscard]] virtual std::string account() const { return {}; }
  /// Of a station: whether it is connected to another server, for which this peer stands.
  [[nodiscard]] virtual bool isElsewhere() const { return false; }
  /// Another server says that it has the station by a newer log-in, and the hub believes that until it ends.
  virtual void onDisplaced() {}
  /// Of a station: whether somebody watches it. `rate_hz`: at which all who watch it do (a thinned rate); 0:
  /// they differ, or want all samples; said to a station elsewhere only. Sends a WatchState.
  virtual void onWatched(bool watched, double rate_hz);

 private:
  friend class Hub;
  void* station_ = nullptr;  // for the hub: the station of this peer while attached
};

struct HubSettings {
  /// Minimum interval between lines of one station in an overview.
  std::chrono::milliseconds status_period{100};
  double overview_lines_per_s = 500;        ///< of all stations together, for one viewer
  std::size_t max_subscriptions = 2000;     ///< of one account, by all of its connections together
  std::size_t max_frame_bytes = 64u << 10;  ///< of a live frame's data
  std::size_t max_frame_samples = 1000;     ///< of a live frame; stations send 20
  std::size_t max_cut_memory_bytes = 1024;  ///< of a live frame; stations send 980 at most
  std::size_t max_status_bytes = 2048;      ///< of a station's status line
  std::string server_name{};                ///< for StationStatus.server; empty: the lab has one server
};

/// Peers must detach before their destruction. Times: steady clock, ns, from the caller. Thread: one; no
/// locks.
class Hub {
 public:
  explicit Hub(HubSettings settings = {}) : settings_(settings) {}

  // --- stations
  /// Marks the station as online through `peer`. Returns the station's older connection, if any, now
  /// detached. `epoch`: of its claim; 0: unknown.
  HubPeer* attachStation(const std::string& name, HubPeer& peer, std::uint64_t epoch = 0);
  /// The station's connection, or what stands for it when it is elsewhere; null when it is offline.
  [[nodiscard]] HubPeer* stationPeer(const std::string& name) const;
  /// Of the connection that the station has; 0: unknown, or none.
  [[nodiscard]] std::uint64_t epochOf(const std::string& name) const;
  /// Does nothing when another connection of the station has taken over.
  void detachStation(const std::string& name, const HubPeer& peer);
  /// The refusal of a status line of `bytes` bytes; nothing: it is not too long.
  [[nodiscard]] std::optional<pb::Refusal> checkStatusBytes(std::size_t bytes) const;
  /// Returns a refusal, and discards the status, when it is too large or its session_id is not valid.
  /// `status` names a trainee only in a session that the server keeps in this name: it cannot tell whom it
  /// erased before it started.
  std::optional<pb::Refusal> onStatus(const std::string& name, const pb::StationStatus& status,
                                      std::int64_t now_ns);
  /// Returns a refusal when the frame is too large, claims too many samples or its session_id is not valid.
  /// `thinned_hz`: the rate that another server has thinned it to; 0: it has all samples.
  std::optional<pb::Refusal> onLiveFrame(const HubPeer& from, const LiveFrameView& frame, std::int64_t now_ns,
                                         double thinned_hz = 0);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const LiveFrameView& frame,
                                         std::int64_t now_ns);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const pb::LiveFrame& frame,
                                         std::int64_t now_ns) {
    return onLiveFrame(name, viewOf(frame), now_ns);
  }
  /// The station's session changed; viewers of this session now watch this station. `trainee_ref`: whose
  /// session it is (people.ref); empty: nobody's.
  void onSession(const std::string& name, const std::string& session_id, const std::string& trainee_ref = {});
  /// This person was erased: no status has the name from now on, whatever stations go on to say. Tells the
  /// viewers.
  void forgetTrainee(const std::string& ref);
  /// Whether forgetTrainee() had this ref.
  [[nodiscard]] bool isErased(const std::string& ref) const { return erased_.contains(ref); }
  /// The refs of those whom statuses name.
  [[nodiscard]] std::vector<std::string> shownTrainees() const;
  /// What another server says of a station that `from` stands for; does nothing if it does not any more.
  /// `news`: all who see the station are told, however often they want lines. Returns a refusal, and discards
  /// the status, as onStatus.
  std::optional<pb::Refusal> onStatusElsewhere(const HubPeer& from, const pb::StationStatus& status,
                                               std::int64_t now_ns, bool news);
  /// Calls `act(name, status, epoch)` for each station that is connected to this server.
  template <typename Act>
  void forEachHere(Act act) const {
    for (const auto& [name, station] : stations_)
      if (station.peer != nullptr && !station.peer->isElsewhere()) act(name, station.status, station.epoch);
  }
  /// Statuses are kept fresh from frames, too, though nobody has an overview here: other servers may.
  void keepStatusesFresh(bool wanted) { keep_fresh_ = wanted; }
  /// Why nothing is known of stations elsewhere; empty: it is known. Tells those who watch a station that is
  /// offline here.
  void setLiveTrouble(const std::string& why);

  // --- viewers
  /// Sends Subscribed and the station's newest status (online or not), or returns the refusal. The samples of
  /// a station or session come at thinnedRateOf the wanted rate.
  std::optional<pb::Refusal> subscribe(HubPeer& viewer, const pb::Subscribe& wanted, std::int64_t now_ns);
  std::optional<pb::Refusal> unsubscribe(HubPeer& viewer, std::uint32_t subscription);
  void detachViewer(const HubPeer& viewer);

  /// Fills in `online` and `status` of each station in a list from the database. Omits further statuses when
  /// the list would exceed a message.
  void fillStations(pb::Stations& stations) const;

  /// At this server, and elsewhere.
  [[nodiscard]] std::size_t stationsOnline() const { return online_; }
  [[nodiscard]] std::size_t stationsElsewhere() const { return elsewhere_; }
  [[nodiscard]] bool isWatched(const std::string& station) const;
  /// Stations that are online, and those that went offline while somebody watches them.
  [[nodiscard]] std::size_t stationsKnown() const { return stations_.size(); }
  [[nodiscard]] std::size_t subscriptions() const;
  /// Stations looked at for the beginnings and ends of subscriptions, since the start: what they cost.
  [[nodiscard]] std::uint64_t stationsLookedAt() const { return looked_at_; }
  [[nodiscard]] std::uint64_t framesIn() const { return frames_in_; }
  [[nodiscard]] std::uint64_t framesOut() const { return frames_out_; }
  /// Of the received frames: those whose samples were needed here.
  [[nodiscard]] std::uint64_t framesDecoded() const { return frames_decoded_; }
  /// Frames made for viewers with a rate: one for all viewers of a station and a rate of kThinnedRates_hz.
  [[nodiscard]] std::uint64_t framesThinned() const { return frames_thinned_; }

 private:
  struct Station;
  struct Subscription {
    HubPeer* viewer = nullptr;
    std::uint32_t number = 0;
    std::string station, session_id;  // both empty: the overview
    double rate_hz = 0;               // 0: the station's; of an overview: lines a second; else thinnedRateOf
    std::unordered_map<const Station*, std::int64_t>
        last_line_ns;  // overview: time of the last line for each station
  };
  /// A viewer's subscriptions, by number and by what they watch: a station's name, or a session's id.
  struct Viewer {
    std::string account;
    std::map<std::uint32_t, std::unique_ptr<Subscription>> by_number;
    std::map<std::string, std::uint32_t> by_station, by_session;  // an overview: a station without a name
  };
  struct Station {
    HubPeer* peer = nullptr;  // null: offline, but a viewer watches it
    std::uint64_t epoch = 0;
    // a connection here that one elsewhere has displaced, until that ends: the database decides, not the hub
    HubPeer* displaced = nullptr;
    std::uint64_t displaced_epoch = 0;
    bool told_watched = false;
    double told_rate_hz = 0;  // with told_watched, of a station elsewhere
    double thinned_hz = 0;    // of the last frame
    pb::StationStatus status;
    std::int64_t status_ns = 0;
    std::string kept_session, trainee_ref;  // the last session that the server keeps, and whose it is
    std::vector<Subscription*> watchers;
    std::map<double, ThinnedFrames> thinned;  // by rate: those at which somebody watched the last frame
  };
  /// Maximum size of the statuses in one message or one overview answer; leaves space for its other fields.
  static constexpr std::size_t kMostStatusBytes = kMaxFrameBytes - (64u << 10);

  /// Skips a message that cannot be encoded: it must not cost the viewer its connection.
  static void sendStatus(HubPeer& viewer, const pb::StationStatus& status);
  Station& known(const std::string& name);
  void setSession(Station& station, std::string_view session_id);
  template <typename Act>
  void forEachOfSession(const std::string& session_id, Act act);
  void refreshWatch(Station& station);
  [[nodiscard]] bool isForgotten(const Station& station) const;
  void forgetIfUnused(const std::string& name);
  void announce(const Station& station) const;
  void sendOverview(const Station& station, std::int64_t now_ns);
  Frame thin(Station& station, double rate_hz, const LiveFrameView& frame, LiveSamples& samples,
             bool is_thinned);
  void setPeer(Station& station, HubPeer* peer);
  void tellViewers(const Station& station, std::int64_t now_ns);
  [[nodiscard]] pb::StationStatus offlineStatus(const std::string& name);
  [[nodiscard]] double commonRate(const Station& station) const;
  static void statusFromSamples(Station& station, const GestureSample& last);
  void remove(const Viewer& of, std::unique_ptr<Subscription> subscription);
  [[nodiscard]] std::vector<Subscription*> watchersOf(const Station& station) const;
  template <typename Act>
  void forEachWatcher(const Station& station, Act act) const;

  HubSettings settings_;
  /// A name that somebody only waits for has no entry: it lies with its viewer, until that station connects.
  std::unordered_map<std::string, Station> stations_;
  // ordered: viewers choose these ids, and could choose them to be slow in a hash table
  std::map<std::string, std::set<Station*>> stations_by_session_;  // as in their statuses
  std::map<std::string, std::vector<Subscription*>> by_session_;
  std::unordered_map<const HubPeer*, Viewer> viewers_;
  std::unordered_map<std::string, std::size_t> subscriptions_of_;  // by account; without zeros
  std::vector<Subscription*> overviews_;
  std::set<std::string> erased_;  // refs, of forgetTrainee()
  std::string live_trouble_;      // of setLiveTrouble()
  bool keep_fresh_ = false;
  std::size_t online_ = 0, elsewhere_ = 0;  // online_: with those elsewhere
  std::uint64_t looked_at_ = 0;
  std::uint64_t frames_in_ = 0, frames_out_ = 0, frames_decoded_ = 0, frames_thinned_ = 0;
};

}  // namespace needlelab
