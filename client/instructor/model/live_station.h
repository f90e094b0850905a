/// Looks over a trainee's shoulder: the last minutes of one station, its losses, its latency, and a view that
/// can be stopped and scrolled back while the stream goes on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/session_scene.h"
#include "client/view/model/gesture_trace.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// Counts what a viewer received of a live stream, the losses and the latency.
class LiveStats {
 public:
  /// A frame with so many samples, received at this wall-clock time.
  void add(const pb::LiveFrame& frame, std::size_t samples, std::int64_t received_unix_ns);
  /// The stream restarts (another connection, another station): its numbers do not continue the old ones.
  void streamRestarts() { last_seq_.reset(); }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// Gaps in the frames' numbers, wherever they arose: at the station, or in this viewer's queue at the
  /// server.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] double lastLatencyMs() const { return last_latency_ms_; }
  /// q in [0, 1]; 0 when nothing came. From the newest 100,000 frames: half an hour at the full rate.
  [[nodiscard]] double latencyMs(double q) const;

 private:
  static constexpr std::size_t kKept = 100'000;
  std::uint64_t frames_ = 0, samples_ = 0, dropped_ = 0;
  std::optional<std::uint64_t> last_seq_;
  double last_latency_ms_ = 0;
  std::vector<float> latencies_ms_ = std::vector<float>(kKept);  // allocated at once: memory does not grow
};

/// Measures how late a live picture is: from the time when a sample was due at its station to the time when
/// the frame that shows it was presented. By the wall clocks of station and viewer: true on one machine, or
/// where both keep the time of day. Thread: one.
class LatencyMeter {
 public:
  static constexpr std::size_t kKept = 20'000;  ///< newest live frames: 6 minutes of one station

  /// The next picture will show a live frame whose last sample was due at that time.
  void fed(std::int64_t capture_unix_ns);
  /// That picture is on the screen now.
  void presented(std::int64_t now_unix_ns);
  /// The frames that were fed will not be shown (paused, another screen).
  void discard() { waiting_.clear(); }
  void clear();

  [[nodiscard]] std::size_t count() const { return shown_; }
  [[nodiscard]] double last_ms() const { return last_ms_; }
  /// q in [0, 1], over what is kept; 0 when nothing was shown.
  [[nodiscard]] double quantile_ms(double q) const;

 private:
  std::vector<std::int64_t> waiting_;
  std::vector<float> shown_ms_;  // a ring
  std::size_t shown_ = 0;
  double last_ms_ = 0;
};

// --- the station
inline constexpr double kLiveSpan_s = 300;

/// Thread: one. Never waits; costs about 1 µs a sample.
class LiveStation {
 public:
  explicit LiveStation(std::string station);

  // --- input
  void feed(const LiveArrival& arrival);
  void onStatus(const pb::StationStatus& status);
  /// The session to ask the server about (GetSession); empty: none, or it was asked a moment ago.
  /// Each call counts as a request; it is repeated after kAskAgain_s of `now_s`.
  [[nodiscard]] std::string sessionToAskFor(double now_s);
  /// Takes the description, and the samples that came before it.
  void setSession(const pb::SessionInfo& info, const ScenePreparer& prepare = {});
  void connectionLost();
  /// A remark at a tick of this session, for the time line.
  void addRemark(std::uint64_t tick, const std::string& text);

  // --- state
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
  /// The frame that shows it is on the screen now. The first pictures of a new scene do not count for the
  /// latency: they make its meshes.
  void presented(std::int64_t now_unix_ns);
  [[nodiscard]] std::uint64_t newestTick() const { return newest_tick_; }
  [[nodiscard]] double rate_hz() const { return rate_hz_; }
  [[nodiscard]] std::uint64_t unreadable() const {
    return unreadable_;
  }  ///< frames that could not be decoded
  /// A stretch of the stream is missing: until the tip is outside again, forces by effect may be off.
  [[nodiscard]] bool approximate() const { return !trace_.empty() && trace_.last().approximate; }

  // --- the view of it
  void pause();
  void resume() { paused_at_s_.reset(); }
  [[nodiscard]] bool paused() const { return paused_at_s_.has_value(); }
  /// Pauses and shows that time, clamped to the kept range.
  void scrollTo(double end_s);
  /// Seconds that the plots show: 2 … kLiveSpan_s.
  void setSpan(double span_s);
  [[nodiscard]] double span_s() const { return span_s_; }
  /// Right edge of the plots: the newest time, or the time of the pause (it moves on when that time is no
  /// longer kept).
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
