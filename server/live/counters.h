/// What a server counts, for its metrics. Thread: the network's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

namespace needlelab {

/// Totals since the start.
struct ServerCounters {
  std::uint64_t connections = 0;
  std::uint64_t logins = 0, logins_refused = 0;
  std::uint64_t chunks_stored = 0, chunks_repeated = 0, chunks_refused = 0;
  std::uint64_t chunks_quarantined = 0;    ///< included in chunks_stored
  std::uint64_t chunks_contradicting = 0;  ///< included in chunks_refused
  std::uint64_t sessions_closed = 0;
  std::uint64_t stations_deposed = 0;  ///< connections that ended because the station logged in elsewhere
  std::uint64_t messages_refused = 0;
  std::uint64_t messages_refused_unparsed = 0;       ///< of those, by their first bytes
  std::uint64_t messages_parsed = 0;                 ///< all but live frames, which are forwarded as bytes
  std::uint64_t messages_parsed_off_thread = 0;      ///< of those, not on the network's thread
  std::uint64_t decoded_bytes = 0;                   ///< of parsed messages: an estimate (PayloadCost)
  std::uint64_t max_reply_bytes = 0;                 ///< being made or unread at once; see Server::counters()
  std::uint64_t refused_for_room = 0;                ///< for lack of room, on both ports
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
  std::size_t connections_open = 0, live_open = 0;  ///< currently
};

}  // namespace needlelab
