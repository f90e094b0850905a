/// The database's only writing thread. Collects work for some milliseconds and commits it together.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "common/base/histogram.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/sessions/arrived_chunk.h"
#include "db/store/connection.h"

namespace needlelab {

/// Group commit. Runs all work posted within `window` in one transaction, each item in its own savepoint.
/// Calls `done` on the writer's thread; with success only after COMMIT (and so fsync) returned. An item that
/// fails or throws is rolled back and reported alone. A failed COMMIT, write or fsync stops the writer
/// permanently: every item of that group and all later ones fail, and `on_fatal` is called once. Consecutive
/// chunks go to the engine together if that is faster (SessionStore::appendMany). Thread: post(), run(),
/// emptyLog(), stop(), failed() and counters() may be called from any thread. `work`, `done` and `on_fatal`
/// run on the writer's thread, must not call run(), emptyLog() or stop(), and should be short.
class DbWriter {
 public:
  using Work = std::function<Status(Connection&)>;
  using Done = std::function<void(const Status&)>;
  using OnFatal = std::function<void(const Error&)>;

  struct Options {
    std::chrono::milliseconds window{25};  ///< from a group's first item to the start of its transaction
    std::chrono::milliseconds checkpoint_every{100};  ///< PASSIVE checkpoints, between commits
    /// A log larger than this is truncated as soon as no reader needs it. A smaller limit costs rewriting
    /// pages in each new log; a greater one only disk space.
    std::uint64_t max_log_bytes = std::uint64_t{64} << 20;
    /// Interval between attempts to empty a log that readers need. Each blocks commits for up to 50 ms.
    std::chrono::milliseconds empty_every{1000};
    std::size_t max_items = 16384;  ///< queue limit; further items are refused
    /// Extra queue places for items posted with Places::kKept.
    std::size_t kept_items = 256;
    std::size_t max_group = 4096;  ///< items in a transaction; the window ends early when the group is full
    /// Receives the text of an exception from an item, after the item was rolled back and refused like any
    /// other failure; may be empty. Thread: the writer's.
    std::function<void(const std::string&)> on_thrown{};
    /// Called at the first transaction, after each reconnection to the engine's server, and when the
    /// durability of acks changes; may be empty. Thread: the writer's.
    std::function<void(Durability, const std::string& reason)> on_durability{};
    /// Called when the engine's server turns out to lack acknowledged data (lack()); may be empty. Thread:
    /// the writer's.
    std::function<void(const std::string& text)> on_lack{};
    /// Initial value of lack() (db/sessions/acknowledged.h).
    std::string lack_at_start{};
    TimeSource* time = &machineTime();  ///< must outlive the writer
  };

  /// Totals since the start. `commit_ns` times COMMIT alone (with its fsync), without the work before it.
  struct Counters {
    std::uint64_t items = 0;     ///< committed
    std::uint64_t refused = 0;   ///< items that failed alone
    std::uint64_t together = 0;  ///< items stored in one statement with others (chunks)
    /// Chunks checked while the thread waited for the engine's server (PostgreSQL).
    std::uint64_t checked_ahead = 0;
    std::uint64_t commits = 0;
    std::uint64_t checkpoints = 0;
    std::uint64_t waiting = 0;  ///< items in the queue now
    std::int64_t last_commit_ns = 0;
    std::int64_t max_commit_ns = 0;
    std::int64_t total_commit_ns = 0;
    DurationHistogram commit_ns;          ///< COMMIT of a group, fsync included
    DurationHistogram work_ns;            ///< from BEGIN to COMMIT: the items' work
    DurationHistogram checkpoint_ns;      ///< a PASSIVE checkpoint
    CountHistogram group_items;           ///< items per committed group
    std::uint64_t wal_bytes = 0;          ///< size of the write-ahead log file after the last commit
    std::uint64_t wal_pages_waiting = 0;  ///< in the log but not in the database, after the last checkpoint
    std::uint64_t logs_emptied = 0;       ///< how often the log was truncated
    bool log_pending = false;             ///< emptyLog() was called and has not finished
  };

  /// Takes ownership of the writer connection and starts the thread. `on_fatal` may be empty.
  DbWriter(Connection connection, const Options& options, OnFatal on_fatal);
  /// A writer that refuses everything with `refuses`, which failed() also returns from the start: for a
  /// database that must not be written. Owns the connection, has no thread.
  DbWriter(Connection connection, Error refuses);
  DbWriter(const DbWriter&) = delete;
  DbWriter& operator=(const DbWriter&) = delete;
  /// Calls stop().
  ~DbWriter();

  /// kKept: for audit log items, which are few but must fit even if others fill the queue.
  enum class Places { kCommon, kKept };
  /// Queues an item. Fails at once with kUnavailable, without calling `done`, if the queue is full or the
  /// writer is stopping or has failed. `done` may be empty.
  Status post(Work work, Done done, Places places = Places::kCommon);

  /// Like post(), for appending a chunk as SessionStore::append() does. When `done` is called with success,
  /// the outcome is in the chunk's `appended`.
  Status postChunk(ArrivedChunk chunk, Done done);

  /// Posts an item and waits for its result. Must not be called on the writer's thread.
  Status run(Work work);

  /// Has the log emptied (Connection::emptyLog), so that data overwritten by earlier commits is no longer in
  /// any file. Waits up to `patience`. False: readers still need the log (the writer continues trying), or
  /// the writer has ended. Must not be called on the writer's thread.
  bool emptyLog(std::chrono::milliseconds patience);

  /// Refuses new work, commits the queue and ends the thread. May be called repeatedly.
  void stop();

  /// The error that stopped the writer permanently, if any.
  [[nodiscard]] std::optional<Error> failed() const;

  /// Acknowledged data that the engine's server lacks (EngineConnection::lack, reportMissing);
  /// human-readable.
  [[nodiscard]] std::string lack() const;
  /// An item reports missing data; lack() returns the text until the writer ends. Call on the writer's
  /// thread.
  void reportMissing(std::string text);

  /// How long health and console report an item that failed alone; stations retry at least every 15 s.
  static constexpr std::chrono::seconds kReportedFor{30};
  /// The engine's server's message that it had no space, if not older than `within`; other items may have
  /// found space since. Empty: none.
  [[nodiscard]] std::string full(std::chrono::nanoseconds within) const;
  /// Why a valid item was not stored (kFailed: a table, its rights, the disk of the engine's server, a bug in
  /// this program), if not older than `within`; the rest of its group and later items may have been stored.
  /// Empty: none.
  [[nodiscard]] std::string failedItem(std::chrono::nanoseconds within) const;
  [[nodiscard]] Counters counters() const;
  /// State of the last transactions. Times are from Options::time.
  struct Standing {
    std::int64_t began_ns = 0;      ///< start of the current transaction; 0: none
    std::int64_t committed_ns = 0;  ///< time of the last commit; 0: never
    std::string refused = {};       ///< why the last one was not committed; empty: it was, or none has ended
  };
  [[nodiscard]] Standing standing() const;
  /// What an ack survives, as of the start of the last transaction.
  [[nodiscard]] Durability durability() const { return durability_.load(std::memory_order_relaxed); }

 private:
  static constexpr int kEmptyingPatience_ms = 50;
  struct Item {
    std::variant<Work, ArrivedChunk> work;
    Done done;
  };
  Status put(Item item, Places places);
  void loop();
  std::vector<Item> takeGroup();
  /// Checks the next chunk in the queue, so that its group need not. False: nothing left to check.
  bool checkWaiting();
  /// Checkpoints or empties the log if due. On an error the writer must stop.
  Status tendLog();
  Status tryToEmptyLog();
  /// When the log needs attention next; nothing: only after the next commit or call of emptyLog(). Requires
  /// mutex_.
  [[nodiscard]] std::optional<std::int64_t> nextTendNs() const;
  /// Runs `call`; converts an exception into an error.
  template <typename Call>
  auto guarded(const Call& call) -> decltype(call());
  Status runWork(const Item& item);
  /// Stores the chunks starting at group[from] together, as far as possible, and sets their results. Returns
  /// the index of the first item that it has not handled.
  std::size_t storeBatch(const std::vector<Item>& group, std::size_t from,
                         std::vector<std::optional<Status>>& results);
  /// Runs one transaction. False: the writer must stop.
  bool commitGroup(std::vector<Item>& group);
  void fail(const Error& error, std::vector<Item>& group);
  struct Noted {
    std::string text = {};
    std::int64_t at_ns = 0;
  };
  /// The text if it is recent enough, else empty.
  [[nodiscard]] std::string notedWithin(const Noted& noted, std::chrono::nanoseconds within) const;
  /// Reports the durability of acks and data that the engine's server lacks, if new; notes a full disk.
  void noteDurability();
  void noteLack();

  Connection connection_;  ///< the writer's thread only
  const Options options_;
  TimeSource& time_;
  const OnFatal on_fatal_;
  const bool refuses_ = false;  ///< from the start, with failed_

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Item> queue_;        ///< guarded by mutex_
  bool stopping_ = false;         ///< guarded by mutex_
  std::optional<Error> failed_;   ///< guarded by mutex_
  Counters counters_;             ///< guarded by mutex_
  std::string lack_;              ///< guarded by mutex_
  std::string reported_missing_;  ///< from reportMissing() or the start; the writer's thread only
  Noted full_, failed_item_;      ///< guarded by mutex_
  Standing standing_;             ///< guarded by mutex_
  std::condition_variable emptied_;
  std::uint64_t emptying_asked_ = 0;       ///< calls of emptyLog(); guarded by mutex_
  std::uint64_t emptying_tried_ = 0;       ///< of these, those followed by an attempt; guarded by mutex_
  std::uint64_t emptying_done_ = 0;        ///< of these, those finished; guarded by mutex_
  bool ended_ = false;                     ///< the thread no longer tends the log; guarded by mutex_
  std::size_t looked_at_ = 0;              ///< queue items that checkWaiting() has handled; guarded by mutex_
  bool uncheckpointed_ = false;            ///< the writer's thread only
  std::int64_t next_checkpoint_ns_ = 0;    ///< the writer's thread only
  std::int64_t next_emptying_ns_ = 0;      ///< the writer's thread only
  std::uint64_t log_bytes_ = 0;            ///< the writer's thread only
  std::uint64_t reported_connection_ = 0;  ///< timesConnected() at the last report; the writer's thread only
  std::atomic<Durability> durability_;     ///< written by the writer's thread

  std::mutex join_mutex_;  ///< one stop() at a time
  std::thread thread_;
};

}  // namespace needlelab
