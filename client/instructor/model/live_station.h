/// Looking over a trainee's shoulder: the last minutes of one station, as they come, and a view of them that
/// can be stopped and scrolled back while the stream goes on.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/latency_meter.h"
#include "client/instructor/model/live_stats.h"
#include "client/instructor/model/session_scene.h"
#include "client/view/model/gesture_trace.h"

namespace needlelab {

inline constexpr double kLiveSpan_s = 300;

/// Thread: one. Never waits; costs about 1 µs a sample.
class LiveStation {
 public:
  explicit LiveStation(std::string station);

  // --- what comes in
  void feed(const LiveArrival& arrival);
  void onStatus(const pb::StationStatus& status);
  /// The session whose description is wanted (GetSession); empty: none is, or it was asked for a moment ago.
  /// Each call counts as asking; asked again after kAskAgain_s of `now_s`.
  [[nodiscard]] std::string sessionToAskFor(double now_s);
  /// Its description. Samples that came before it are taken in now.
  void setSession(const pb::SessionInfo& info, const ScenePreparer& prepare = {});
  void connectionLost();
  /// A remark at a tick of this session, for the time line.
  void addRemark(std::uint64_t tick, const std::string& text);

  // --- what there is
  [[nodiscard]] const std::string& station() const { return station_; }
  [[nodiscard]] const std::string& sessionId() const {
    return session_id_;
  }  ///< empty: idle, or not known yet
  [[nodiscard]] const pb::SessionInfo& info() const { return info_; }
  [[nodiscard]] const SessionScene& scene() const { return scene_; }
  [[nodiscard]] const pb::StationStatus& status() const { return status_; }
  [[nodiscard]] const GestureTrace& trace() const { return trace_; }
  [[nodiscard]] const LiveStats& stats() const { return stats_; }
  [[nodiscard]] LatencyMeter& latency() { return latency_; }
  /// The frame that shows it is on the screen now. Of a scene that is new the first pictures do not count for
  /// the latency: its shapes are made then, once.
  void presented(std::int64_t now_unix_ns);
  [[nodiscard]] std::uint64_t newestTick() const { return newest_tick_; }
  [[nodiscard]] double rate_hz() const { return rate_hz_; }
  [[nodiscard]] std::uint64_t unreadable() const { return unreadable_; }  ///< frames that were no chunks
  /// A stretch of the stream is missing: until the tip is outside again, forces by effect may be off.
  [[nodiscard]] bool approximate() const { return !trace_.empty() && trace_.last().approximate; }

  // --- the view of it
  void pause();
  void resume() { paused_at_s_.reset(); }
  [[nodiscard]] bool paused() const { return paused_at_s_.has_value(); }
  /// Shows what was at that time; pauses. Held to what is kept.
  void scrollTo(double end_s);
  /// Seconds that the plots show: 2 … kLiveSpan_s.
  void setSpan(double span_s);
  [[nodiscard]] double span_s() const { return span_s_; }
  /// Right edge of the plots: the newest time, or where it is paused (what is no longer kept shifts on).
  [[nodiscard]] double viewEnd_s() const;
  [[nodiscard]] double viewBegin_s() const { return viewEnd_s() - span_s_; }
  /// What the 3-D scene shows.
  [[nodiscard]] const Moment& shown() const;
  [[nodiscard]] std::uint64_t shownTick() const { return shown().tick; }

 private:
  static constexpr double kAskAgain_s = 2;
  static constexpr std::size_t kFramesKept = 3000;  // a minute, while the description is asked for
  void beginSession(const std::string& session_id);
  void take(const std::vector<GestureSample>& samples);

  std::string station_, session_id_;
  pb::SessionInfo info_;
  bool described_ = false;
  double asked_s_ = -1e9;
  SessionScene scene_;
  pb::StationStatus status_;
  double rate_hz_ = 1000;
  std::unique_ptr<GestureReplica> replica_;
  GestureTrace trace_;
  LiveStats stats_;
  LatencyMeter latency_;
  std::deque<std::vector<GestureSample>> undescribed_;
  std::optional<std::uint64_t> last_frame_;
  std::uint64_t newest_tick_ = 0, unreadable_ = 0;
  int new_scene_frames_ = 0;
  std::optional<double> paused_at_s_;
  double span_s_ = 20;
};

}  // namespace needlelab
