/// What the connections of one server share, by subject; include the header of each part you need. Owned by
/// ServerState; used on the network's thread unless stated otherwise.
#pragma once

#include <cstdint>
#include <unordered_map>

#include "common/wire/asio.h"
#include "db/service/start/bootstrap.h"

namespace needlelab {

class ClockOffsets;
class Hub;
class LivePeer;
struct InFlight;
struct ServerCounters;
struct ServerLimits;
struct ServerLogins;
struct ServerTogether;
struct ServerWork;
struct WebCounters;

/// A member that prevents copies and moves, because others hold references to the object.
struct Pinned {
  Pinned() = default;
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;
};

struct ServerContext {
  asio::io_context& io;
  Store& store;  ///< thread-safe
  ServerWork& work;
  ServerLimits& limits;
  InFlight& in_flight;
  ServerLogins& logins;
  ServerTogether& together;
  Hub& hub;
  ClockOffsets& clock_offsets;
  ServerCounters& counters;
  WebCounters& web;
  const bool acks_are_safe = false;  ///< they survive the loss of a disk (--durability two-disks)
  std::uint16_t web_port = 0;        ///< 0: no console
  bool stopping = false;
  std::unordered_map<std::uint64_t, LivePeer*> connections{};  ///< by id; each removes itself at its end
  Pinned pinned{};
};

}  // namespace needlelab
