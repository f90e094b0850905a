/// State shared by the connections of one server. Owned by Server; used on the network's thread unless stated
/// otherwise.
#pragma once

#include <array>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/wire/asio.h"
#include "db/service/bootstrap.h"
#include "server/live/admission.h"
#include "server/live/chunk_budget.h"
#include "server/live/disk_room.h"
#include "server/live/hub.h"
#include "server/live/login_guard.h"
#include "server/live/offload.h"
#include "server/live/station_quotas.h"
#include "server/live/tokens.h"

namespace needlelab {

class PeerConnection;

/// Limits on the load from one connection.
struct ConnectionBounds {
  std::size_t chunks_in_flight = 64;  ///< received but not yet committed; at the limit its socket is not read
  std::size_t chunk_bytes_in_flight = 8u << 20;
  ChunkBudget::Limits all_chunks_in_flight;  ///< of the whole server
  std::size_t requests_at_work = 8;
  /// TLS handshakes of the whole server. With a thousand at once, all would be unfinished when their stations
  /// time out.
  std::size_t handshakes_at_once = 32;
  std::size_t handshakes_of_address = 24;  ///< of those: one address can never use all
  /// One handshake's share of these places; a slower peer goes on without one.
  std::chrono::milliseconds handshake_turn{1000};
  std::size_t logins_waiting = 64;  ///< of the whole server, for the password check
  /// The other places are for people who have logged in from that address before.
  std::size_t logins_waiting_of_strangers = 48;
  std::size_t logins_waiting_at_address = 32;  ///< of those strangers, from one address
  std::size_t connections_of_person = 256;     ///< logged in at once
  double small_messages_at_once = 5000;        ///< all but chunks and requests, which have their own limits
  double small_messages_per_s = 500;
  std::size_t refusals = 200;  ///< refused messages after log-in; then the connection ends
  /// Time for a station to confirm an instructor's message; after that the instructor gets an error.
  std::chrono::milliseconds confirm_timeout{5'000};
  std::size_t known_sessions = 1024;  ///< whose watermarks are in memory
};

/// Totals since the start.
struct ServerCounters {
  std::uint64_t connections = 0;
  std::uint64_t logins = 0, logins_refused = 0;
  std::uint64_t chunks_stored = 0, chunks_repeated = 0, chunks_refused = 0;
  std::uint64_t sessions_closed = 0;
  std::uint64_t messages_refused = 0;
  std::uint64_t refused_for_room = 0;                ///< of those: sessions and chunks for want of room
  std::uint64_t live_dropped = 0;                    ///< of connections that have ended
  std::uint64_t connections_refused = 0;             ///< because of too many connections
  std::uint64_t handshakes_failed = 0;               ///< TLS failed or timed out
  std::uint64_t acks = 0;                            ///< messages; one acknowledges many chunks
  std::uint64_t backups = 0;                         ///< verified
  std::uint64_t bytes_received = 0, bytes_sent = 0;  ///< of connections that have ended
};

/// Counters of the web port since the start (server/web), part of the metrics.
struct WebCounters {
  static constexpr std::array<double, 8> kLatency_s = {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3};
  /// By route pattern, then by status.
  std::unordered_map<std::string, std::map<unsigned, std::uint64_t>> requests;
  std::array<std::uint64_t, kLatency_s.size() + 1> latency{};  ///< request read to reply written
  double latency_sum_s = 0;
  std::uint64_t connections = 0, connections_refused = 0, handshakes_failed = 0;
  std::uint64_t live_dropped = 0;                   ///< viewers cut because they did not read
  std::size_t connections_open = 0, live_open = 0;  ///< now
};

struct ServerContext {
  asio::io_context& io;
  Store& store;                     ///< its parts are thread-safe
  asio::thread_pool& passwords;     ///< argon2id: 64 MiB and 0.1 s each, so few at a time
  asio::thread_pool& logins;        ///< station keys, tokens: not delayed by scoring
  asio::thread_pool& workers;       ///< short reads and scoring
  asio::thread_pool& views;         ///< plots, exports, results: never delay a lesson
  asio::thread_pool& slow_workers;  ///< backup, check, verify: minutes
  /// Two threads: one for a run, perhaps hours with pauses, one for answers.
  asio::thread_pool& retention_workers;
  ConnectionBounds bounds;
  Hub hub;
  LoginGuard guard;
  Tokens tokens;
  ServerCounters counters;
  WebCounters web{};
  Admission admission{};
  std::size_t logins_waiting = 0;
  std::unordered_map<std::string, std::size_t> logins_waiting_at{};  ///< of strangers, by address
  /// Turns issued, and the turn whose password is being checked.
  std::uint64_t password_turns = 0, password_turn = 0;
  Signal password_done{io.get_executor()};  ///< password_turn has advanced
  std::uint64_t access_changes = 0;  ///< accounts disabled, keys revoked, passwords changed, since the start
  ChunkBudget chunks_in_flight{bounds.all_chunks_in_flight};  ///< of all connections
  std::unique_ptr<Inbox> committed =
      std::make_unique<Inbox>(io.get_executor());  ///< chunks that the writer has finished
  Signal chunk_room{io.get_executor()};            ///< chunks_in_flight is no longer full
  DiskRoom disk_room{0};
  StationQuotas quotas{};      ///< the writer's thread only
  std::size_t handshakes = 0;  ///< in progress
  /// Handshakes in progress, by address; without zero entries.
  std::unordered_map<std::string, std::size_t> handshakes_of = {};
  std::vector<PeerConnection*> handshakes_wait{};  ///< last in, first out
  bool stopping = false;
  std::unordered_map<std::uint64_t, PeerConnection*> connections;  ///< by id; each removes itself at its end
};

}  // namespace needlelab
