/// Stations that stream, viewers that read, and a crowd of viewers that do not, on a server in this process.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "tests/support/proxy/fault_proxy.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

inline constexpr std::size_t kStreamers = 3;  ///< stations "s0" to "s2"

/// How often, and after how many ms each time.
struct Delays {
  std::vector<double> ms;
  /// The quantile; `share` in [0, 1]. 0 without values.
  [[nodiscard]] double at(double share) const;
};

/// A streaming station: a live frame every 20 ms, a chunk every 100 ms; measures each acknowledgement's
/// delay. Adds itself to the server. Throws std::runtime_error if it cannot log in.
class Streamer {
 public:
  Streamer(RunningServer& server, const std::string& name, std::uint64_t seed);
  ~Streamer() { stop(); }
  Streamer(const Streamer&) = delete;
  Streamer& operator=(const Streamer&) = delete;

  /// Returns once each chunk is acknowledged.
  void stop();
  /// The acknowledgements' delays since the last call. Any thread.
  Delays take();
  [[nodiscard]] std::uint64_t acked() const { return acked_; }
  [[nodiscard]] std::uint64_t chunksSent() const { return chunks_; }

 private:
  void run(std::uint64_t seed);

  FakeSession session_;
  BlockingClient client_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> acked_{0}, chunks_{0};
  std::mutex mutex_;
  Delays delays_;  ///< guarded by mutex_
  std::thread thread_;
};

/// A log-in as an instructor by token: cheap, however often it is used.
class Instructor {
 public:
  explicit Instructor(RunningServer& server);
  /// `small_buffers`: the socket is full after a few frames.
  [[nodiscard]] ClientConfig config(bool small_buffers) const;
  /// Throws std::runtime_error if it cannot log in.
  [[nodiscard]] BlockingClient connect(bool small_buffers) const;

 private:
  RunningServer& server_;
  std::string token_;
};

/// Subscribes to all streamers.
void watchAll(BlockingClient& client);

/// A viewer of all streamers that reads everything.
class GoodViewer {
 public:
  explicit GoodViewer(BlockingClient client);
  ~GoodViewer();
  GoodViewer(const GoodViewer&) = delete;
  GoodViewer& operator=(const GoodViewer&) = delete;

  /// Delays from a frame's capture to its arrival here, since the last call. Any thread.
  Delays take();
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  void run();

  BlockingClient client_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> frames_{0};
  std::mutex mutex_;
  Delays delays_;  ///< guarded by mutex_
  std::thread thread_;
};

/// Many viewers at once: a third read nothing, a third get single bytes through a bad network, a third die
/// silently. All log in first, which may take long; then they subscribe and stop reading.
class Crowd {
 public:
  Crowd(std::uint16_t server_port, const Instructor& instructor, std::size_t viewers);
  /// The viewers that read nothing but still could.
  [[nodiscard]] std::vector<BlockingClient*> mute();

 private:
  FaultProxy slow_network_, dead_network_;
  std::vector<BlockingClient> viewers_;
};

/// Options of a server for such viewers: a socket is full after few bytes, and a silent connection stays for
/// an hour. `patience`: how long one write may take.
void withSlowViewers(ServerOptions& options, std::chrono::milliseconds patience);

}  // namespace needlelab::test
