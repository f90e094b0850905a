/// Shared data of the stations and viewers of one run, and a thread for the network.
#pragma once

#include <algorithm>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/net/link/connect.h"
#include "client/net/link/server_link.h"
#include "common/base/text/uuid.h"
#include "common/wire/asio.h"
#include "tests/load/gesture_pool.h"

namespace needlelab::test {

/// Name and key of one station, and when its tick 0 is due.
struct StationPlan {
  std::string name, key;
  Uuid session{};
  std::size_t first_server = 0;        ///< the station asks this one first (LoadShared::clientOf)
  std::atomic<std::size_t> server{0};  ///< its current or last server
  /// This machine's steady clock; 0: not known yet. Set once, before the station's first frame.
  std::atomic<std::int64_t> start_ns{0};
};

/// Read-only during the run, except the atomics. Thread: any.
struct LoadShared {
  const GesturePool* pool = nullptr;
  std::uint64_t seed = 1;
  std::uint64_t ticks = 0;  ///< of each station
  ClientConfig client;      ///< without log-in; knows all servers
  /// For the stations; also reconnects soon after the cuts of a fault plan.
  LinkSettings link{.retry = {.most = std::chrono::milliseconds(5000)},
                    .lasting = std::chrono::milliseconds(0)};
  std::vector<StationPlan> stations;
  /// Samples of a live frame, and of a chunk.
  static constexpr std::uint64_t kFrameTicks = 20, kChunkTicks = 1000;

  /// `client`, with its servers rotated: this one is the first.
  [[nodiscard]] ClientConfig clientOf(std::size_t server) const {
    Endpoints all = client.servers();
    std::rotate(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(server % all.size()), all.end());
    ClientConfig config = client;
    config.setServers(all);
    return config;
  }
  /// The server's number among the client's.
  [[nodiscard]] std::size_t numberOf(const Endpoint& server) const {
    const Endpoints all = client.servers();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const Endpoint& one) { return sameEndpoint(one, server); });
    return found == all.end() ? 0 : static_cast<std::size_t>(found - all.begin());
  }
};

// An io_context with its own thread, and calls into that thread.

/// Thread: `call` from any thread except its own. Destruction stops the thread: its work must have ended, or
/// is dropped.
class NetThread {
 public:
  NetThread() : thread_([this] { io_.run(); }) {}
  ~NetThread() { stop(); }
  NetThread(const NetThread&) = delete;
  NetThread& operator=(const NetThread&) = delete;

  asio::io_context& io() { return io_; }
  /// Runs `work` on the thread and returns its result.
  template <typename Work>
  auto call(Work work) -> decltype(work()) {
    std::packaged_task<decltype(work())()> task(std::move(work));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }
  void stop() {
    if (!thread_.joinable()) return;
    io_.stop();
    thread_.join();
  }

 private:
  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> guard_ = asio::make_work_guard(io_);
  std::thread thread_;
};

}  // namespace needlelab::test
