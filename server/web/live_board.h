/// The tiles of the live page: one per station, encoded once for all viewers.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "needlelab/control.pb.h"
#include "server/live/context.h"
#include "server/live/work/offload.h"

namespace needlelab {

/// `{"live_trouble": "…", "tiles":[{station, server, online, session_id, trainee, exercise, phase, depth_m,
/// layer, force_n, peak_force_n, fault, drops}]}`. `layer` is its displayed name, `fault` a problem that
/// needs attention, `drops` the number of ticks that the station missed. `peak_force_n` is the session's
/// maximum, kept by the hub regardless of viewers. `server` is the server that has the station,
/// `live_trouble` why stations of other servers may be missing; both are empty in a lab with one server.
/// Built only while there are viewers. Thread: the network's. Ownership: kept alive by its coroutine.
class LiveBoard : public std::enable_shared_from_this<LiveBoard> {
 public:
  LiveBoard(ServerContext& context, std::chrono::milliseconds period)
      : context_(context), period_(period), fresh_(context.io.get_executor()), tick_(context.io) {}

  void onViewerJoined();
  void onViewerLeft();
  /// Ends its coroutine.
  void stop();

  [[nodiscard]] std::uint64_t number() const { return number_; }
  [[nodiscard]] std::shared_ptr<const std::string> newest() const { return newest_; }
  /// Waits until there may be a newer board.
  Task<> wait() { return fresh_.wait(); }
  void wakeAll() { fresh_.notify(); }

 private:
  static Task<> run(std::shared_ptr<LiveBoard> self);
  Task<> readStore();
  std::string make();

  ServerContext& context_;
  const std::chrono::milliseconds period_;
  Signal fresh_;
  std::size_t viewers_ = 0;
  asio::steady_timer tick_;  // until the next text
  bool running_ = false, stopping_ = false;
  std::uint64_t number_ = 0;
  std::shared_ptr<const std::string> newest_;
  pb::Stations stations_;  // names, from the database
  std::int64_t stations_ns_ = 0;
  std::map<std::string, std::vector<std::string>> layer_names_;  // for each session on the board, by layer
};

}  // namespace needlelab
