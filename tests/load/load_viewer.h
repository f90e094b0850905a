/// One load instructor: watches its share of the stations at full rate and measures latencies.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "client/net/link/server_link.h"
#include "common/base/histogram.h"
#include "tests/load/gesture_pool.h"
#include "tests/load/load_shared.h"

namespace needlelab::test {

/// Totals of the viewers. Thread: one writes.
struct ViewerTotals {
  LatencyHistogram live;       ///< from the due time of a frame's oldest sample to its arrival here, decoded
  LatencyHistogram elsewhere;  ///< … of those from stations at another server than the viewer
  std::uint64_t frames = 0, samples = 0, bytes = 0;
  std::uint64_t gaps = 0;     ///< missing frames of a station's connection, by their numbers
  std::uint64_t told = 0;     ///< … of these, counted by the server for this viewer
  std::uint64_t corrupt = 0;  ///< frames without a valid chunk, or from a different station than stated
  std::uint64_t connections = 0;
};

/// Thread: its io_context's.
class LoadViewer {
 public:
  /// Watches the stations index, index + of, index + 2·of, … and asks the server with its index first.
  LoadViewer(LoadShared& shared, pb::Login login, std::size_t index, std::size_t of, ViewerTotals& totals,
             asio::io_context& io);

  /// Connects and reconnects until stop().
  void connect();
  void stop();
  /// Stops reading for the given time.
  void pause(std::chrono::milliseconds time) { link_.pauseReading(time); }

  /// Whether all subscriptions were answered.
  [[nodiscard]] bool watching() const { return subscribed_ == watched_; }
  [[nodiscard]] const std::string& lastError() const { return last_error_; }

 private:
  struct Watched {
    std::size_t station = 0;
    std::uint64_t next_frame = 0;
    bool seen = false;
  };
  LinkHandlers handlers();
  void onConnected();
  void onMessage(const pb::Envelope& envelope);
  void onFrame(const pb::LiveFrame& frame);

  LoadShared& shared_;
  pb::Login login_;
  std::size_t index_, of_, watched_ = 0, subscribed_ = 0, server_ = 0;
  ViewerTotals& totals_;
  ServerLink link_;
  std::unordered_map<std::string, Watched> by_name_;
  std::vector<std::unique_ptr<StationStream>> streams_;  // for the stations' clocks
  std::uint64_t told_ = 0;                               // on this connection
  std::string last_error_;
};

// All viewers of a run on one network thread.

/// Thread: the owner's; its own for the network.
class ViewerCrowd {
 public:
  ViewerCrowd(LoadShared& shared, const pb::Login& login, std::size_t viewers);
  ~ViewerCrowd();

  void connect();
  /// The number of viewers that watch all of their stations.
  [[nodiscard]] std::size_t watching();
  [[nodiscard]] std::string lastError();
  void pause(std::size_t viewer, std::chrono::milliseconds time);
  /// Valid after the end.
  [[nodiscard]] const ViewerTotals& totals() const { return totals_; }
  void stop();

 private:
  NetThread net_;  // destroyed last: viewers have timers on it; stop() has already ended its thread
  ViewerTotals totals_;
  bool stopped_ = false;
  std::vector<std::unique_ptr<LoadViewer>> viewers_;
};

}  // namespace needlelab::test
