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

#include "common/base/time_source.h"
#include "common/wire/asio.h"
#include "db/service/bootstrap.h"
#include "server/live/access_changes.h"
#include "server/live/access_listener.h"
#include "server/live/admission.h"
#include "server/live/byte_budget.h"
#include "server/live/clock_offsets.h"
#include "server/live/disk_room.h"
#include "server/live/fair_queue.h"
#include "server/live/handshake_turns.h"
#include "server/live/hub.h"
#include "server/live/limits.h"
#include "server/live/login_state.h"
#include "server/live/offload.h"
#include "server/live/peer_lines.h"
#include "server/live/quotas.h"
#include "server/live/token_bucket.h"
#include "server/live/turn_queue.h"

namespace needlelab {

class PeerConnection;
class RemoteLive;

/// Totals since the start.
struct ServerCounters {
  std::uint64_t connections = 0;
  std::uint64_t logins = 0, logins_refused = 0;
  std::uint64_t chunks_stored = 0, chunks_repeated = 0, chunks_refused = 0;
  std::uint64_t chunks_quarantined = 0;    ///< of the stored ones
  std::uint64_t chunks_contradicting = 0;  ///< of the refused ones
  std::uint64_t sessions_closed = 0;
  std::uint64_t stations_deposed = 0;  ///< connections that ended because the station logged in elsewhere
  std::uint64_t messages_refused = 0;
  std::uint64_t messages_refused_unparsed = 0;       ///< of those: by their first bytes
  std::uint64_t messages_parsed = 0;                 ///< all but live frames, which are forwarded as bytes
  std::uint64_t messages_parsed_elsewhere = 0;       ///< of those: not on the network's thread
  std::uint64_t decoded_bytes = 0;                   ///< of parsed messages: an estimate (PayloadCost)
  std::uint64_t most_reply_bytes = 0;                ///< made or unread at once, as Server::counters() says
  std::uint64_t refused_for_room = 0;                ///< for want of room, on both ports
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

inline constexpr std::size_t kWorkerThreads = 2, kSlowThreads = 1, kLoginThreads = 1;
/// Long scores (kShortScoreSamples) have all of the closers but one, and the other steps of closes as many:
/// so a short close waits for no long score. A station has one of either at most.
inline constexpr std::size_t kCloserThreads = 3, kLongScoreThreads = kCloserThreads - 1;
/// Scores between their steps, which hold up to 110 MB each (SessionScore): long ones of stations, which take
/// turns on kLongScoreThreads, and of people who rescore.
inline constexpr std::size_t kLongScoresAtOnce = 4, kRescoringsAtOnce = 1;
/// A station shows a trainee its standing while people plot and export: one of the views' threads is kept
/// free of people's work.
inline constexpr std::size_t kPeopleViewThreads = 2, kStationViewThreads = 1;
inline constexpr std::size_t kViewThreads = kPeopleViewThreads + kStationViewThreads;

/// Lines of the passwords' thread.
enum PasswordLine : std::size_t {
  kLoginLine,    ///< log-ins of people, one at a time: LoginQueue says whose
  kStationLine,  ///< stations, which bring a trainee's code
  kPersonLine,   ///< people, who give themselves or others passwords and codes
  kPasswordLines
};

/// A look at all accounts in use (remote_access.h).
struct AccessLook {
  bool is_under_way = false;
  bool is_due = false;                   ///< once more
  std::int64_t unanswered_since_ns = 0;  ///< by steadyNowNs(); 0: the database answered the last one
};

struct ServerContext {
  asio::io_context& io;
  Store& store;                     ///< its parts are thread-safe
  asio::thread_pool& passwords;     ///< argon2id: 64 MiB and 0.1 s each, so few at a time
  asio::thread_pool& logins;        ///< station keys, tokens: not delayed by scoring; kLoginThreads
  asio::thread_pool& parsers;       ///< large messages: milliseconds each
  asio::thread_pool& workers;       ///< short reads; kWorkerThreads
  asio::thread_pool& closers;       ///< closes of sessions, with their hash and score; kCloserThreads
  asio::thread_pool& views;         ///< plots, exports, results: never delay a lesson; kViewThreads
  asio::thread_pool& slow_workers;  ///< backup, check, verify: minutes; kSlowThreads
  /// Two threads: one for a run, perhaps hours with pauses, one for answers.
  asio::thread_pool& retention_workers;
  ConnectionBounds bounds;
  Hub hub;
  std::unique_ptr<LoginState> login;  ///< lock-outs and tokens
  ServerCounters counters;
  WebCounters web{};
  std::uint16_t web_port = 0;  ///< 0: there is no console
  Admission admission{};
  /// What people ask for, on `workers`, on `views` and on `slow_workers`.
  std::unique_ptr<FairPool> workers_of_people = std::make_unique<FairPool>(workers, kWorkerThreads);
  std::unique_ptr<FairPool> views_of_people = std::make_unique<FairPool>(views, kPeopleViewThreads);
  std::unique_ptr<FairPool> views_of_stations = std::make_unique<FairPool>(views, kStationViewThreads);
  std::unique_ptr<FairPool> slow_workers_of_people = std::make_unique<FairPool>(slow_workers, kSlowThreads);
  /// Of each station, on `closers`.
  std::unique_ptr<FairPool> closes_in_turn = std::make_unique<FairPool>(closers, kCloserThreads - 1);
  std::unique_ptr<FairPool> long_scores_in_turn = std::make_unique<FairPool>(closers, kLongScoreThreads);
  TurnQueue long_scores{io.get_executor(), {.at_once = kLongScoresAtOnce}};
  TurnQueue rescorings{io.get_executor(), {.at_once = kRescoringsAtOnce}};
  ByteBudget closes{
      {.station = bounds.closes_of_station}};  ///< of sessions, not bytes: by name of the station
  /// Of each account; before its log-in, of the connection.
  TokenBuckets small_messages{};
  ClockOffsets clock_offsets{};
  /// Keys, tokens and open sessions of those who log in, on `logins`.
  std::unique_ptr<FairPool> logins_in_turn = std::make_unique<FairPool>(logins, kLoginThreads);
  /// What hashes, on `passwords`, in lines (PasswordLine): 0.1 s each. So between two log-ins at most one
  /// other piece is done, however many wait.
  std::unique_ptr<FairPool> passwords_in_turn = std::make_unique<FairPool>(passwords, 1, kPasswordLines);
  LoginQueue logins_waiting{io.get_executor(), bounds.logins};
  PeerLines lines{bounds.log_lines};  ///< of the log, on both ports
  /// A message was done with: there may be room for another one.
  std::shared_ptr<Signal> decoded_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget decoded{bounds.decoded, [room = decoded_room] { room->notify(); }};
  /// A reply was read, or was shorter than its room: there may be room for another one.
  std::shared_ptr<Signal> reply_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget replies{bounds.replies, [room = reply_room] { room->notify(); }};
  AccessChanges access{};  ///< accounts disabled, keys revoked, passwords changed
  AccessLook access_look{};
  /// Of what other servers on the database change; null: this one is alone.
  std::unique_ptr<AccessListener> access_listener{};
  /// Of all connections: how many, and their bytes. While either is full nobody should read another chunk;
  /// each connection may have read one already, so the bytes stay below the limit and one chunk (1 MiB) for
  /// each connection.
  ByteBudget chunks_in_flight{{.server = bounds.all_chunks_in_flight.chunks}};
  ByteBudget chunk_bytes_in_flight{{.server = bounds.all_chunks_in_flight.bytes}};
  std::unique_ptr<Inbox> committed =
      std::make_unique<Inbox>(io.get_executor());  ///< chunks that the writer has finished
  Signal chunk_room{io.get_executor()};            ///< neither of them is full any longer
  DiskRoom disk_room{0};
  StationQuotas quotas{};  ///< the writer's thread only
  PeopleShares shares{};
  HandshakeTurns handshakes{};
  asio::steady_timer handshakes_due{io};  ///< the next place of a handshake becomes free by itself
  /// This server's name among those that work together (Store::togetherAs); empty: it is alone, and stations
  /// have no claims (db/station_claims.h).
  const std::string claims_as = {};
  /// The newest connection of each station that is here, or logs in: an older one claims nothing.
  std::unordered_map<std::string, std::uint64_t> newest_logins{};
  const bool acks_are_safe = false;  ///< they survive the loss of a disk (--durability two-disks)
  RemoteLive* remote = nullptr;      ///< the lab's other servers; null: it has one server
  bool stopping = false;
  std::unordered_map<std::uint64_t, PeerConnection*> connections;  ///< by id; each removes itself at its end
};

inline bool chunksFull(const ServerContext& context) {
  return context.chunks_in_flight.full() || context.chunk_bytes_in_flight.full();
}

}  // namespace needlelab
