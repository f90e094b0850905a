/// The live plane: which stations are online, who watches them, and what goes to whom.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/gesture/sample.h"
#include "common/wire/live_frames.h"
#include "needlelab/control.pb.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// Fewer samples for a viewer that asked for a lower rate: keeps the first sample at or behind each point of
/// a time grid of the wanted rate, by the station's own times, so it does not depend on the loop's rate.
/// Thread: one.
class Decimator {
 public:
  /// rate_hz > 0
  explicit Decimator(double rate_hz);

  /// Those of `samples` that the viewer gets; none is a common answer.
  std::vector<GestureSample> keep(std::span<const GestureSample> samples);

 private:
  std::int64_t period_ns_;
  std::int64_t due_ns_ = 0;
  std::int64_t last_ns_ = 0;
  bool started_ = false;
};

/// Whom the hub can send to; a connection of the server, or a test.
class HubPeer {
 public:
  HubPeer() = default;
  HubPeer(const HubPeer&) = delete;
  HubPeer& operator=(const HubPeer&) = delete;
  virtual ~HubPeer() = default;
  virtual void sendControl(const pb::Envelope& envelope) = 0;
  /// Never waits: a peer that is slow drops its own oldest frames. `counted`: a LiveFrame.
  virtual void sendLive(Frame frame, bool counted) = 0;

 private:
  friend class Hub;
  void* station_ = nullptr;  // the hub's own note: which station this peer is, while it is attached
};

struct HubSettings {
  std::chrono::milliseconds status_period{100};  ///< of one station in an overview, at the most frequent
  double overview_lines_per_s = 500;             ///< of all stations together, for one viewer
  std::size_t max_subscriptions = 2000;          ///< of one viewer
  std::size_t max_frame_bytes = 64u << 10;       ///< of a live frame's data
  std::size_t max_frame_samples = 1000;          ///< of a live frame; stations send 20
  std::size_t max_status_bytes = 2048;           ///< of a station's status line
};

/// Peers attach and must detach before they go. Times: steady clock, ns, from the caller. Thread: one; no
/// locks.
class Hub {
 public:
  explicit Hub(HubSettings settings = {}) : settings_(settings) {}

  // --- stations
  /// The station is online by `peer`; gives the older connection of the same station, if any, which is
  /// attached no longer.
  HubPeer* attachStation(const std::string& name, HubPeer& peer);
  /// The connection by which the station is online; null when it is offline.
  [[nodiscard]] HubPeer* stationPeer(const std::string& name) const;
  /// Nothing happens when another connection of the station has taken over.
  void detachStation(const std::string& name, const HubPeer& peer);
  /// A refusal, and nothing is kept, when the status is too large or its session_id is not valid.
  std::optional<pb::Refusal> onStatus(const std::string& name, const pb::StationStatus& status,
                                      std::int64_t now_ns);
  /// A refusal when the frame is too large, claims too many samples or its session_id is not valid.
  std::optional<pb::Refusal> onLiveFrame(const HubPeer& from, const LiveFrameView& frame,
                                         std::int64_t now_ns);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const LiveFrameView& frame,
                                         std::int64_t now_ns);
  std::optional<pb::Refusal> onLiveFrame(const std::string& name, const pb::LiveFrame& frame,
                                         std::int64_t now_ns) {
    return onLiveFrame(name, viewOf(frame), now_ns);
  }
  /// The station's session changed; those who watch this session watch the station now.
  void onSession(const std::string& name, const std::string& session_id);
  /// False when the station is not online.
  bool sendToStation(const std::string& name, const pb::Envelope& envelope);

  // --- viewers
  /// Answers with Subscribed and the station's newest status (online or not), or gives the refusal.
  std::optional<pb::Refusal> subscribe(HubPeer& viewer, const pb::Subscribe& wanted, std::int64_t now_ns);
  std::optional<pb::Refusal> unsubscribe(HubPeer& viewer, std::uint32_t subscription);
  void detachViewer(const HubPeer& viewer);

  /// `online` and `status` of each station in a list from the database. Statuses end where the list would be
  /// more than a message.
  void fillStations(pb::Stations& stations) const;

  [[nodiscard]] std::size_t stationsOnline() const { return online_; }
  [[nodiscard]] bool isWatched(const std::string& station) const;
  [[nodiscard]] std::uint64_t framesIn() const { return frames_in_; }
  [[nodiscard]] std::uint64_t framesOut() const { return frames_out_; }

 private:
  struct Station;
  struct Subscription {
    HubPeer* viewer = nullptr;
    std::uint32_t number = 0;
    std::string station, session_id;  // both empty: the overview
    std::optional<Decimator> decimator;
    double rate_hz = 0;
    std::uint64_t frames = 0;  // decimated ones: renumbered, upstream gaps kept
    std::optional<std::uint64_t> last_upstream_seq;
    std::unordered_map<const Station*, std::int64_t>
        last_line_ns;  // overview: when each station's line was sent
  };
  struct Station {
    HubPeer* peer = nullptr;  // null: not online, but somebody waits for it
    bool told_watched = false;
    pb::StationStatus status;
    std::int64_t status_ns = 0;
    std::vector<Subscription*> watchers;
  };

  void refreshWatch(Station& station);
  void forgetIfUnused(const std::string& name);
  void announce(const std::string& name, Station& station);
  void sendOverview(const std::string& name, Station& station, std::int64_t now_ns);
  void sendDecimated(Subscription& subscription, const std::string& name, const LiveFrameView& frame,
                     std::span<const GestureSample> samples);
  void statusFromSamples(Station& station, const LiveFrameView& frame, const GestureSample& last);
  void remove(std::unique_ptr<Subscription> subscription);
  [[nodiscard]] std::vector<Subscription*> watchersOf(const Station& station) const;
  template <typename Act>
  void forEachWatcher(const Station& station, Act act) const;

  HubSettings settings_;
  std::unordered_map<std::string, Station> stations_;
  std::unordered_map<std::string, std::vector<Subscription*>> by_session_;
  std::unordered_map<const HubPeer*, std::map<std::uint32_t, std::unique_ptr<Subscription>>> viewers_;
  std::vector<Subscription*> overviews_;
  std::size_t online_ = 0;
  std::uint64_t frames_in_ = 0, frames_out_ = 0;
};

}  // namespace needlelab
