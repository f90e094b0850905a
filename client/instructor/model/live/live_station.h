/// Live view of one station: its last minutes, losses and latency. The view can pause and scroll while the
/// stream continues.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/live/lab_connection.h"
#include "client/instructor/model/live/session_scene.h"
#include "client/view/model/gesture_trace.h"
#include "common/haptics/cut_snapshot.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// Counts a live stream's received frames and samples, losses and latency.
class LiveStats {
 public:
  /// Adds a frame with its number of samples and its wall-clock time of receipt.
  void add(const pb::LiveFrame& frame, std::size_t samples, std::int64_t received_unix_ns);
  /// Call when the stream restarts (another connection or station): its frame numbers do not continue the old
  /// ones.
  void streamRestarts() { last_seq_.reset(); }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// Number of lost frames, from gaps in the frame numbers. Losses occur at the station or in this viewer's
  /// queue on the server.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] double lastLatencyMs() const { return last_latency_ms_; }
  /// Returns quantile q in [0, 1] over the newest 100,000 frames (half an hour at the full rate); 0 without
  /// frames.
  [[nodiscard]] double latencyMs(double q) const;

 private:
  static constexpr std::size_t kKept = 100'000;
  std::uint64_t frames_ = 0, samples_ = 0, dropped_ = 0;
  std::optional<std::uint64_t> last_seq_;
  double last_latency_ms_ = 0;
  std::vector<float> latencies_ms_ = std::vector<float>(kKept);  // allocated at once: memory does not grow
};

/// Measures the latency of live pictures, from a sample's due time at its station to the presentation of its
/// frame. Compares the wall clocks of station and viewer, so it is valid on one machine or with synchronized
/// clocks. Thread: one.
class LatencyMeter {
 public:
  static constexpr std::size_t kKept = 20'000;  ///< newest live frames; 6 minutes of one station

  /// Announces a live frame for the next picture. `capture_unix_ns`: due time of its last sample.
  void fed(std::int64_t capture_unix_ns);
  /// Call when that picture is on the screen.
  void presented(std::int64_t now_unix_ns);
  /// Discards the announced frames because the window will not show them (paused, another screen).
  void discard() { waiting_.clear(); }
  void clear();

  [[nodiscard]] std::size_t count() const { return shown_; }
  [[nodiscard]] double last_ms() const { return last_ms_; }
  /// Returns quantile q in [0, 1] of the kept values; 0 without pictures.
  [[nodiscard]] double quantile_ms(double q) const;

 private:
  std::vector<std::int64_t> waiting_;
  std::vector<float> shown_ms_;  // a ring
  std::size_t shown_ = 0;
  double last_ms_ = 0;
};

// --- the station
inline constexpr double kLiveSpan_s = 300;

/// Thread: one. Never blocks; costs about 1 µs per sample.
class LiveStation {
 public:
  explicit LiveStation(std::string station);

  // --- input
  void feed(const LiveArrival& arrival);
  void onStatus(const pb::StationStatus& status);
  /// Returns the session to request from the server (GetSession); empty if there is none, or it was requested
  /// a moment ago. Each call counts as a request; the id is returned again after kAskAgain_s of `now_s`.
  [[nodiscard]] std::string sessionToRequest(double now_s);
  /// Takes the description, then processes the samples received before it.
  void setSession(const pb::SessionInfo& info, const ScenePreparer& prepare = {});
  void connectionLost();
  /// Adds a remark at a tick of this session to the time line.
  void addRemark(std::uint64_t tick, const std::string& text);

  // --- state
  [[nodiscard]] const std::string& station() const { return station_; }
  [[nodiscard]] const std::string& sessionId() const { return session_id_; }  ///< empty: idle, or unknown
  [[nodiscard]] const pb::SessionInfo& info() const { return info_; }
  [[nodiscard]] const SessionScene& scene() const { return scene_; }
  [[nodiscard]] const pb::StationStatus& status() const { return status_; }
  [[nodiscard]] const GestureTrace& trace() const { return trace_; }
  [[nodiscard]] const LiveStats& stats() const { return stats_; }
  [[nodiscard]] LatencyMeter& latency() { return latency_; }
  /// Call when the frame is on the screen. The first pictures of a new scene build its meshes, so they do not
  /// count for the latency.
  void presented(std::int64_t now_unix_ns);
  [[nodiscard]] std::uint64_t newestTick() const { return newest_tick_; }
  [[nodiscard]] double rate_hz() const { return rate_hz_; }
  [[nodiscard]] std::uint64_t unreadable() const { return unreadable_; }  ///< number of undecodable frames
  /// Returns whether forces by effect are not known in the newest sample (`Moment::approximate`): part of the
  /// stream is missing and the tip has not been outside since, or the engine's force differs from the
  /// recorded one.
  [[nodiscard]] bool approximate() const { return !trace_.empty() && trace_.last().approximate; }

  // --- the view of it
  void pause();
  void resume() { paused_at_s_.reset(); }
  [[nodiscard]] bool paused() const { return paused_at_s_.has_value(); }
  /// Pauses at that time, clamped to the kept range.
  void scrollTo(double end_s);
  /// Sets the plots' time span, from 2 s to kLiveSpan_s.
  void setSpan(double span_s);
  [[nodiscard]] double span_s() const { return span_s_; }
  /// Returns the right edge of the plots: the newest time, or the time of the pause (moves forward when that
  /// time leaves the kept range).
  [[nodiscard]] double viewEnd_s() const;
  [[nodiscard]] double viewBegin_s() const { return viewEnd_s() - span_s_; }
  /// Returns the moment in the 3-D scene.
  [[nodiscard]] const Moment& shown() const;
  [[nodiscard]] std::uint64_t shownTick() const { return shown().tick; }

 private:
  static constexpr double kAskAgain_s = 2;
  static constexpr std::size_t kFramesKept = 3000;  // a minute of frames, kept until the description arrives
  void beginSession(const std::string& session_id);
  struct Received {
    std::vector<GestureSample> samples;
    std::optional<CutSnapshot> cuts;  ///< after the last sample
    Bytes paths;                      ///< of the samples (appendPath)
  };
  void take(const Received& received);

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
  std::deque<Received> undescribed_;
  std::optional<std::uint64_t> last_frame_;
  std::uint64_t newest_tick_ = 0, unreadable_ = 0;
  int new_scene_frames_ = 0;
  std::optional<double> paused_at_s_;
  double span_s_ = 20;
};

}  // namespace needlelab
