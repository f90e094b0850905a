/// The network side of a station: the real spool and uplink behind a bad network, and a check of the server's
/// database.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "client/net/spool/spool.h"
#include "client/net/uplink/uplink.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

/// Timeouts of about a twentieth of the real ones, for both ends, so that a test does not wait for 30 s.
/// keepalive < idle/3 as in ChannelLimits' defaults.
ChannelLimits shortLimits();

/// Options of a server with these limits that prints nothing.
void withShortLimits(ServerOptions& options);

struct StationSettings {
  std::uint64_t chunks = 40;
  std::size_t samples = 50;             ///< per chunk
  std::chrono::milliseconds period{0};  ///< between chunks; 0: all exist from the beginning
  ChannelLimits limits = shortLimits();
  std::chrono::milliseconds connect_timeout{5000};
  std::vector<std::uint16_t> other_ports = {};  ///< of further servers that it knows
};

/// One session, recorded by its own thread while the uplink sends. Thread: the test's.
class FaultStation {
 public:
  /// `port`: the proxy's or the server's.
  FaultStation(RunningServer& server, const std::string& name, std::uint16_t port,
               const StationSettings& settings);
  ~FaultStation();
  FaultStation(const FaultStation&) = delete;
  FaultStation& operator=(const FaultStation&) = delete;

  /// Waits until the server has closed the session. False if `patience` passes first.
  bool waitUntilDone(std::chrono::milliseconds patience);
  /// Checks that the database holds every recorded sample once, in order and complete by its hash, and that
  /// acknowledgements never decreased.
  void expectWhole(RunningServer& server) const;

  [[nodiscard]] UplinkState state() const { return uplink_->state(); }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const SpoolSession& session() const { return *session_; }
  [[nodiscard]] std::vector<std::string> said() const;
  [[nodiscard]] std::vector<std::string> heard() const;  ///< texts of trainee messages, ids of next exercises
  /// Sends a live frame and a status line, as the loop's recorder does.
  void offer(const SamplePiece& piece) { uplink_->offer(piece); }
  Uplink& uplink() { return *uplink_; }

 private:
  void record(const StationSettings& settings);
  void watchAcks();

  std::string name_;
  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::shared_ptr<SpoolSession> session_;
  mutable std::mutex mutex_;
  std::vector<std::string> said_, heard_;
  std::unique_ptr<Uplink> uplink_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> went_back_{0};
  std::thread recorder_, watcher_;
};

}  // namespace needlelab::test
