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
#include "server/live/chunk_budget.h"
#include "server/live/clock_offsets.h"
#include "server/live/disk_room.h"
#include "server/live/fair_pool.h"
#include "server/live/handshake_turns.h"
#include "server/live/hub.h"
#include "server/live/login_queue.h"
#include "server/live/login_state.h"
#include "server/live/message_rates.h"
#include "server/live/offload.h"
#include "server/live/password_pool.h"
#include "server/live/peer_lines.h"
#include "server/live/people_shares.h"
#include "server/live/places_in_turn.h"
#include "server/live/station_closes.h"
#include "server/live/station_quotas.h"

namespace needlelab {

class PeerConnection;
class RemoteLive;

/// Limits on the load from one connection.
struct ConnectionBounds {
  /// Of a station, on all its connections: received but not yet committed. At the limit they are not read.
  std::size_t chunks_in_flight = 64;
  std::size_t chunk_bytes_in_flight = 8u << 20;
  ChunkBudget::Limits all_chunks_in_flight;  ///< of the whole server
  std::size_t requests_at_work = 8;
  /// That a station is closing at once, on all its connections; further ones are refused (RATE_LIMITED) and
  /// come again. A station has two or three: the session before, and old ones one after the other.
  std::size_t closes_of_station = 8;
  LoginQueue::Settings logins;              ///< of the whole server, that wait for the password check
  PeerLines::Settings log_lines;            ///< on both ports
  std::size_t connections_of_person = 256;  ///< logged in at once
  /// Of a station or person, by all of its connections: all but chunks and requests, which have their own
  /// limits.
  double small_messages_at_once = 5000;
  double small_messages_per_s = 500;
  /// A ClockOffset, CloseSession, Ping, Pong, Subscribe or Unsubscribe with more bytes is refused unparsed.
  /// So the closes that wait hold little (`closes_of_station`) and have no part in the budget of memory.
  std::size_t small_message_bytes = 4u << 10;
  std::size_t refusals = 200;  ///< refused messages after log-in; then the connection ends
  /// Time for a station to confirm an instructor's message; after that the instructor gets an error.
  std::chrono::milliseconds confirm_timeout{5'000};
  std::size_t known_sessions = 1024;  ///< whose watermarks are in memory
  /// A message with more bytes to read one by one is parsed on another thread: this takes some 50 µs here.
  std::size_t parsed_here_bytes = 16u << 10;
  /// A message that becomes no more than this has no part in the budget: `requests_at_work` and
  /// `closes_of_station` bound it.
  std::size_t uncounted_decoded_bytes = 4u << 10;
  /// Memory of messages that are parsed and not done yet, of both ports together. A person's is more than a
  /// message of 1 MiB can become (kMostPayloadFields), a station's more than its longest, an OpenSession with
  /// a profile of 1 MiB.
  ByteBudget::Limits decoded{.connection = 8u << 20,
                             .person = 8u << 20,
                             .people = 32u << 20,
                             .station = 2u << 20,
                             .server = 40u << 20};
  /// Replies that are being made or are not read yet, of both ports together. While a reply is made it has
  /// the room of the longest, 1 MiB: so a person has at most 12 such requests at work on all connections.
  ByteBudget::Limits replies{.connection = 8u << 20,
                             .person = 12u << 20,
                             .people = 96u << 20,
                             .station = 8u << 20,
                             .server = 128u << 20};
};

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
  std::uint64_t most_reply_bytes = 0;                ///< of replies that were made or unread at once
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
  Admission admission{};
  /// What people ask for, on `workers`, on `views` and on `slow_workers`.
  std::unique_ptr<FairPool> workers_of_people = std::make_unique<FairPool>(workers, kWorkerThreads);
  std::unique_ptr<FairPool> views_of_people = std::make_unique<FairPool>(views, kPeopleViewThreads);
  std::unique_ptr<FairPool> views_of_stations = std::make_unique<FairPool>(views, kStationViewThreads);
  std::unique_ptr<FairPool> slow_workers_of_people = std::make_unique<FairPool>(slow_workers, kSlowThreads);
  /// Of each station, on `closers`.
  std::unique_ptr<FairPool> closes_in_turn = std::make_unique<FairPool>(closers, kCloserThreads - 1);
  std::unique_ptr<FairPool> long_scores_in_turn = std::make_unique<FairPool>(closers, kLongScoreThreads);
  PlacesInTurn long_scores{io.get_executor(), kLongScoresAtOnce};
  PlacesInTurn rescorings{io.get_executor(), kRescoringsAtOnce};
  StationCloses closes{bounds.closes_of_station};
  MessageRates small_messages{bounds.small_messages_at_once, bounds.small_messages_per_s};
  ClockOffsets clock_offsets{};
  /// Keys, tokens and open sessions of those who log in, on `logins`.
  std::unique_ptr<FairPool> logins_in_turn = std::make_unique<FairPool>(logins, kLoginThreads);
  /// Whatever hashes, on `passwords`.
  std::unique_ptr<PasswordPool> passwords_in_turn = std::make_unique<PasswordPool>(passwords);
  /// A log-in's turn has ended, or its place was taken.
  std::shared_ptr<Signal> login_turns = std::make_shared<Signal>(io.get_executor());
  LoginQueue logins_waiting{bounds.logins, [turns = login_turns] { turns->notify(); }};
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
  ChunkBudget chunks_in_flight{bounds.all_chunks_in_flight};  ///< of all connections
  std::unique_ptr<Inbox> committed =
      std::make_unique<Inbox>(io.get_executor());  ///< chunks that the writer has finished
  Signal chunk_room{io.get_executor()};            ///< chunks_in_flight is no longer full
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

}  // namespace needlelab
