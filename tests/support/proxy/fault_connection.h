/// One connection through the bad network.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>

#include "common/wire/asio.h"
#include "tests/support/proxy/connection_script.h"

namespace needlelab::test {

class FaultProxy;

/// Thread: the proxy's. Ownership: shared by its coroutines and the proxy.
class FaultConnection : public std::enable_shared_from_this<FaultConnection> {
 public:
  FaultConnection(FaultProxy& proxy, std::uint64_t id, Tcp::socket client, const ConnectionScript& script,
                  std::uint64_t seed);

  static Task<> run(std::shared_ptr<FaultConnection> self, std::uint16_t server_port);
  void cut(Cut how);
  /// Notifies it that the next connection was accepted: the held bytes continue after `late_after`.
  void overtaken();

 private:
  using Clock = std::chrono::steady_clock;
  struct Piece {
    std::string bytes;  // empty: the sender has ended
    Clock::time_point due;
    bool reset = false;  // … by RST
  };
  struct Lane {
    explicit Lane(const Tcp::socket::executor_type& executor)
        : wake(executor, Clock::time_point::max()), pause(executor) {}
    std::deque<Piece> queue;
    std::size_t queued = 0;
    std::uint64_t in = 0, out = 0;
    bool stalled = false, over = false;
    Clock::time_point last_due{}, free_at{};
    asio::steady_timer wake;   // cancelled when something changes
    asio::steady_timer pause;  // the writer's waits
  };

  static Task<> readLane(std::shared_ptr<FaultConnection> self, Way way);
  static Task<> writeLane(std::shared_ptr<FaultConnection> self, Way way);
  static Task<> duplicate(std::shared_ptr<FaultConnection> self, std::uint16_t server_port);
  static Task<> release(std::shared_ptr<FaultConnection> self);
  Task<> wait(Lane& lane, Clock::duration time);
  Task<> change(Lane& lane);
  void laneOver(Way way, bool reset);
  void end(bool reset);

  [[nodiscard]] Lane& lane(Way way) { return way == Way::kUp ? up_ : down_; }
  [[nodiscard]] const WayScript& script(Way way) const { return way == Way::kUp ? script_.up : script_.down; }
  [[nodiscard]] Tcp::socket& from(Way way) { return way == Way::kUp ? client_ : server_; }
  [[nodiscard]] Tcp::socket& to(Way way) { return way == Way::kUp ? server_ : client_; }

  FaultProxy& proxy_;
  const std::uint64_t id_;
  const ConnectionScript script_;
  Random random_;
  Tcp::socket client_, server_;
  Lane up_, down_;
  std::string first_bytes_;  // the client's, for duplicates
  asio::steady_timer late_;
  bool silent_ = false, released_ = false, ended_ = false;
};

}  // namespace needlelab::test
