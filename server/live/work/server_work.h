/// The threads of a server, the order of work on them, and what is in hand at once.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <cstddef>
#include <memory>

#include "common/wire/asio.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/limits/limits.h"
#include "server/live/work/fair_queue.h"
#include "server/live/work/offload.h"
#include "server/live/work/turn_queue.h"

namespace needlelab {

inline constexpr std::size_t kWorkerThreads = 2, kSlowThreads = 1, kLoginThreads = 1;
/// Long scores (above kShortScoreSamples) use at most all closers but one, and so do the other steps of
/// closes, so a short close never waits for a long score. A station uses at most one of each.
inline constexpr std::size_t kCloserThreads = 3, kLongScoreThreads = kCloserThreads - 1;
/// Scores in progress, which hold up to 110 MB each (SessionScore): long ones of stations, which take turns
/// on kLongScoreThreads, and those of people who rescore.
inline constexpr std::size_t kLongScoresAtOnce = 4, kRescoringsAtOnce = 1;
/// Stations must be able to show a trainee's standing while people plot and export, so one of the views'
/// threads stays free of people's work.
inline constexpr std::size_t kPeopleViewThreads = 2, kStationViewThreads = 1;
inline constexpr std::size_t kViewThreads = kPeopleViewThreads + kStationViewThreads;

/// Lines of the passwords' thread.
enum PasswordLine : std::size_t {
  kLoginLine,    ///< people's log-ins, one at a time, in the order of LoginQueue
  kStationLine,  ///< stations that check a trainee's code
  kPersonLine,   ///< people who set passwords and codes for themselves or others
  kPasswordLines
};

/// The pools must outlive it.
struct ServerWork {
  asio::io_context& io;
  asio::thread_pool& passwords;     ///< argon2id: 64 MiB and 0.1 s each, so few at a time
  asio::thread_pool& logins;        ///< station keys, tokens: not delayed by scoring; kLoginThreads
  asio::thread_pool& parsers;       ///< large messages: milliseconds each
  asio::thread_pool& workers;       ///< short reads; kWorkerThreads
  asio::thread_pool& closers;       ///< closes of sessions, with their hash and score; kCloserThreads
  asio::thread_pool& views;         ///< plots, exports, results: never delay a lesson; kViewThreads
  asio::thread_pool& slow_workers;  ///< backup, check, verify: minutes; kSlowThreads
  /// Two threads: one for a run, which may take hours with pauses, and one for answers.
  asio::thread_pool& retention_workers;
  /// Requests of people, on `workers`, `views` and `slow_workers`.
  std::unique_ptr<FairPool> workers_of_people = std::make_unique<FairPool>(workers, kWorkerThreads);
  std::unique_ptr<FairPool> views_of_people = std::make_unique<FairPool>(views, kPeopleViewThreads);
  std::unique_ptr<FairPool> views_of_stations = std::make_unique<FairPool>(views, kStationViewThreads);
  std::unique_ptr<FairPool> slow_workers_of_people = std::make_unique<FairPool>(slow_workers, kSlowThreads);
  /// Per station, on `closers`.
  std::unique_ptr<FairPool> closes_by_station = std::make_unique<FairPool>(closers, kCloserThreads - 1);
  std::unique_ptr<FairPool> long_scores_by_station = std::make_unique<FairPool>(closers, kLongScoreThreads);
  TurnQueue long_scores{io.get_executor(), {.at_once = kLongScoresAtOnce}};
  TurnQueue rescorings{io.get_executor(), {.at_once = kRescoringsAtOnce}};
  /// Checks of keys and tokens, and open sessions, during log-in; on `logins`.
  std::unique_ptr<FairPool> login_pool = std::make_unique<FairPool>(logins, kLoginThreads);
  /// Hashing, on `passwords`, in lines (PasswordLine): 0.1 s each. Between two log-ins at most one other
  /// piece runs, however many wait.
  std::unique_ptr<FairPool> password_pool = std::make_unique<FairPool>(passwords, 1, kPasswordLines);
};

// --- parsed messages, unread replies, uncommitted chunks

/// `bounds` must outlive it.
struct InFlight {
  asio::io_context& io;
  const ConnectionBounds& bounds;
  /// A message was completed; there may be room for another.
  std::shared_ptr<Signal> decoded_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget decoded{bounds.decoded, [room = decoded_room] { room->notify(); }};
  /// A reply was read, or was shorter than reserved; there may be room for another.
  std::shared_ptr<Signal> reply_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget replies{bounds.replies, [room = reply_room] { room->notify(); }};
  /// Over all connections: the number of chunks and their bytes. While either is full, connections should not
  /// read another chunk. Each may already have read one, so the bytes stay below the limit plus one chunk (1
  /// MiB) per connection.
  ByteBudget chunks{{.server = bounds.all_chunks_in_flight.chunks}};
  ByteBudget chunk_bytes{{.server = bounds.all_chunks_in_flight.bytes}};
  Inbox committed{io.get_executor()};    ///< chunks that the writer has finished
  Signal chunk_room{io.get_executor()};  ///< neither is full any longer

  [[nodiscard]] bool chunksFull() const { return chunks.full() || chunk_bytes.full(); }
};

}  // namespace needlelab
