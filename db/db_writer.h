/// The database's only writing thread. It collects work for some milliseconds and commits it together.
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
#include "common/base/time_source.h"
#include "db/arrived_chunk.h"
#include "db/connection.h"

namespace needlelab {

/// Group commit. Runs all work posted within `window` in one transaction, each item in its own savepoint.
/// Calls `done` on the writer's thread, with success only after COMMIT, i.e. after fsync, returned. An item
/// that fails or throws is rolled back and reported alone. A failed COMMIT, write or fsync stops the writer
/// for good: every item of that group and every later one fails, then `on_fatal` is called once. Chunks that
/// follow each other go to the engine together where that is faster (SessionStore::appendMany). Thread:
/// post(), run(), emptyLog(), stop(), failed(), counters() may be called from any thread. `work`, `done` and
/// `on_fatal` run on the writer's thread, must not call run(), emptyLog() or stop(), and should be short.
class DbWriter {
 public:
  using Work = std::function<Status(Connection&)>;
  using Done = std::function<void(const Status&)>;
  using OnFatal = std::function<void(const Error&)>;

  struct Options {
    std::chrono::milliseconds window{25};             ///< from a group's first item to its transaction
    std::chrono::milliseconds checkpoint_every{100};  ///< PASSIVE, between commits
    /// A log above this is cut to 0 bytes as soon as no reader needs it. A smaller bound costs the pages of
    /// each new log; a greater one only room on the disk.
    std::uint64_t most_log_bytes = std::uint64_t{64} << 20;
    /// Between two tries to empty the log while readers need it. Commits wait for 50 ms in each.
    std::chrono::milliseconds empty_every{1000};
    std::size_t max_items = 16384;  ///< in the queue; more are refused
    /// Beyond these, for items that are posted with Places::kKept.
    std::size_t kept_items = 256;
    std::size_t max_group = 4096;  ///< items in a transaction; the window ends early when the group is full
    /// Receives the text of an exception from an item, after the item was rolled back and refused like any
    /// other failure; may be empty. Thread: the writer's.
    std::function<void(const std::string&)> on_thrown{};
    /// At the first transaction, after each time that the engine's server was connected to again, and
    /// whenever an ack survives more or less than before; may be empty. Thread: the writer's.
    std::function<void(Durability, const std::string& reason)> on_durability{};
    /// Whenever the engine's server turns out to lack what was acknowledged (lack()); may be empty. Thread:
    /// the writer's.
    std::function<void(const std::string& text)> on_lack{};
    /// What lack() is from the beginning (db/acknowledged.h).
    std::string lack_at_start{};
    TimeSource* time = &machineTime();  ///< must outlive the writer
  };

  /// Totals since the start. `commit_ns` times COMMIT alone (with its fsync), without the work before it.
  struct Counters {
    std::uint64_t items = 0;     ///< committed
    std::uint64_t refused = 0;   ///< items that failed alone
    std::uint64_t together = 0;  ///< of the items: chunks that were stored with others in one statement
    /// Of the chunks: those that were checked while the thread waited for the engine's server (PostgreSQL).
    std::uint64_t checked_ahead = 0;
    std::uint64_t commits = 0;
    std::uint64_t checkpoints = 0;
    std::uint64_t waiting = 0;  ///< items in the queue now
    std::int64_t last_commit_ns = 0;
    std::int64_t max_commit_ns = 0;
    std::int64_t total_commit_ns = 0;
    DurationHistogram commit_ns;          ///< COMMIT of a group, fsync included
    DurationHistogram work_ns;            ///< from BEGIN to COMMIT: the items' own work
    DurationHistogram checkpoint_ns;      ///< a PASSIVE checkpoint
    CountHistogram group_items;           ///< items of a committed group
    std::uint64_t wal_bytes = 0;          ///< size of the write-ahead log's file after the last commit
    std::uint64_t wal_pages_waiting = 0;  ///< in the log but not in the database, after the last checkpoint
    std::uint64_t logs_emptied = 0;       ///< times that the log was cut to 0 bytes
    bool log_pending = false;             ///< emptyLog() was called, and has not done
  };

  /// Takes ownership of the writer connection and starts the thread. `on_fatal` may be empty.
  DbWriter(Connection connection, const Options& options, OnFatal on_fatal);
  /// A writer that refuses everything with `refuses`, as failed() says from the beginning: for a database
  /// that must not be written to. Owns the connection, has no thread.
  DbWriter(Connection connection, Error refuses);
  DbWriter(const DbWriter&) = delete;
  DbWriter& operator=(const DbWriter&) = delete;
  /// Calls stop().
  ~DbWriter();

  /// kKept: an item of the audit log, of which few come, also where others fill the queue.
  enum class Places { kCommon, kKept };
  /// Queues an item. Fails at once with kUnavailable, without calling `done`, when the queue is full or the
  /// writer is stopping or has failed. `done` may be empty.
  Status post(Work work, Done done, Places places = Places::kCommon);

  /// The same with an item that appends a chunk, as SessionStore::append(); the outcome is in its `appended`
  /// when `done` is called with success.
  Status postChunk(ArrivedChunk chunk, Done done);

  /// Posts an item and waits for its result. Not from the writer's thread.
  Status run(Work work);

  /// Has the log emptied (Connection::emptyLog), so that what the commits so far overwrote is no longer in
  /// any file. Waits up to `patience` for it. False: readers still need the log, or the writer has ended; the
  /// writer goes on trying until it ends. Not from the writer's thread.
  bool emptyLog(std::chrono::milliseconds patience);

  /// Refuses new work, commits the queue and ends the thread. May be called repeatedly.
  void stop();

  /// The error that stopped the writer for good, if any.
  [[nodiscard]] std::optional<Error> failed() const;

  /// What the engine's server lacks of what was acknowledged (EngineConnection::lack, sayLack), for a person.
  [[nodiscard]] std::string lack() const;
  /// An item has found that it lacks something: lack() says so until the writer's end. On its thread.
  void sayLack(std::string text);

  /// For how long health and console say what failed alone: stations ask again every 15 s, or sooner.
  static constexpr std::chrono::seconds kSaidFor{30};
  /// What the engine's server said when it had no room for something, not longer ago than `within`: other
  /// items may have found room. Empty: nothing.
  [[nodiscard]] std::string full(std::chrono::nanoseconds within) const;
  /// Why an item was not stored though its contents were right (kFailed: a table, a right to it, the disk of
  /// the engine's server, a fault of this program), not longer ago than `within`: other items may have been
  /// stored, and their group was. Empty: there was none.
  [[nodiscard]] std::string failedItem(std::chrono::nanoseconds within) const;
  [[nodiscard]] Counters counters() const;
  /// How the last transactions went. Times are of Options::time.
  struct Standing {
    std::int64_t began_ns = 0;      ///< of the transaction that is under way; 0: none is
    std::int64_t committed_ns = 0;  ///< when one was committed last; 0: never
    std::string refused = {};       ///< why the last one was not committed; empty: it was, or none ended
  };
  [[nodiscard]] Standing standing() const;
  /// What an ack survives, as of the last transaction's begin.
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
  /// Checks the next chunk in the queue, so that its group need not. False: none is left to look at.
  bool checkWaiting();
  /// Checkpoints or empties the log when that is due. An error: the writer must stop.
  Status tendLog();
  Status tryToEmptyLog();
  /// When the log is to be tended next; nothing: only after the next commit or call of emptyLog(). Call with
  /// mutex_ held.
  [[nodiscard]] std::optional<std::int64_t> nextTendNs() const;
  /// Calls it; converts an exception into an error.
  template <typename Call>
  auto guarded(const Call& call) -> decltype(call());
  /// Runs the item's work.
  Status runWork(const Item& item);
  /// Stores the chunks that begin at group[from] together, as far as they can be, and puts their results.
  /// Returns the first one that it has not looked at.
  std::size_t storeTogether(const std::vector<Item>& group, std::size_t from,
                            std::vector<std::optional<Status>>& results);
  /// Runs one transaction. False: the writer must stop.
  bool commitGroup(std::vector<Item>& group);
  void fail(const Error& error, std::vector<Item>& group);
  struct Noted {
    std::string text = {};
    std::int64_t at_ns = 0;
  };
  /// The text, unless it is older.
  [[nodiscard]] std::string notedWithin(const Noted& noted, std::chrono::nanoseconds within) const;
  /// Tells what an ack survives, and what the engine's server lacks, if that is new; notes when it is full.
  void noteDurability();
  void noteLack();

  Connection connection_;  ///< the writer's thread only
  const Options options_;
  TimeSource& time_;
  const OnFatal on_fatal_;
  const bool refuses_ = false;  ///< from the beginning, with failed_

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Item> queue_;       ///< guarded by mutex_
  bool stopping_ = false;        ///< guarded by mutex_
  std::optional<Error> failed_;  ///< guarded by mutex_
  Counters counters_;            ///< guarded by mutex_
  std::string lack_;             ///< guarded by mutex_
  std::string lack_said_;        ///< of sayLack(), or at the start; the writer's thread only
  Noted full_, failed_item_;     ///< guarded by mutex_
  Standing standing_;            ///< guarded by mutex_
  std::condition_variable emptied_;
  std::uint64_t emptying_asked_ = 0;     ///< calls of emptyLog(); guarded by mutex_
  std::uint64_t emptying_tried_ = 0;     ///< of these, those with a try after them; guarded by mutex_
  std::uint64_t emptying_done_ = 0;      ///< of these, those that are done; guarded by mutex_
  bool ended_ = false;                   ///< the thread tends the log no more; guarded by mutex_
  std::size_t looked_at_ = 0;            ///< of the queue, by checkWaiting(); guarded by mutex_
  bool uncheckpointed_ = false;          ///< the writer's thread only
  std::int64_t next_checkpoint_ns_ = 0;  ///< the writer's thread only
  std::int64_t next_emptying_ns_ = 0;    ///< the writer's thread only
  std::uint64_t log_bytes_ = 0;          ///< the writer's thread only
  std::uint64_t told_connection_ = 0;    ///< timesConnected(), when told last; the writer's thread only
  std::atomic<Durability> durability_;   ///< written by the writer's thread

  std::mutex join_mutex_;  ///< one stop() at a time
  std::thread thread_;
};

}  // namespace needlelab
