#include "db/sessions/db_writer.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <future>
#include <utility>

#include "common/base/planted_bug.h"
#include "common/gesture/chunk.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"

namespace needlelab {
namespace {

Error stoppedError(const std::optional<Error>& cause) {
  if (!cause) return {ErrorCode::kUnavailable, "the database writer is stopping: nothing more is stored"};
  return {ErrorCode::kUnavailable, "the database writer has stopped after a failure: " + cause->message};
}

std::int64_t nanoseconds(std::chrono::milliseconds time) {
  return std::chrono::nanoseconds(time).count();
}

}  // namespace

DbWriter::DbWriter(Connection connection, const Options& options, OnFatal on_fatal)
    : connection_(std::move(connection)),
      options_(options),
      time_(*options.time),
      on_fatal_(std::move(on_fatal)),
      lack_(options_.lack_at_start),
      reported_missing_(options_.lack_at_start),
      durability_(connection_.durability()) {
  next_checkpoint_ns_ = time_.nowNs() + nanoseconds(options_.checkpoint_every);
  assert(options_.max_group > 0 && options_.max_items > 0);
  connection_.setWhileWaiting([this] { return checkWaiting(); });
  thread_ = std::thread([this] { loop(); });
}

DbWriter::DbWriter(Connection connection, Error refuses)
    : connection_(std::move(connection)),
      time_(machineTime()),
      refuses_(true),
      failed_(std::move(refuses)),
      durability_(connection_.durability()) {}

DbWriter::~DbWriter() {
  stop();
}

Status DbWriter::post(Work work, Done done, Places places) {
  return put({std::move(work), std::move(done)}, places);
}

Status DbWriter::postChunk(ArrivedChunk chunk, Done done) {
  return put({std::move(chunk), std::move(done)}, Places::kCommon);
}

Status DbWriter::put(Item item, Places places) {
  bool wakes = false;
  {
    const std::lock_guard lock(mutex_);
    if (refuses_) return *failed_;
    if (stopping_ || failed_) return stoppedError(failed_);
    if (queue_.size() >= options_.max_items + (places == Places::kKept ? options_.kept_items : 0)) {
      return Error{
          ErrorCode::kUnavailable,
          fmt::format("the database writer's queue is full with {} items: try again later", queue_.size())};
    }
    queue_.push_back(std::move(item));
    // Wake the writer only for a group's first item and for the one that fills it; any other wake-up would be
    // wasted.
    wakes = queue_.size() == 1 || queue_.size() == options_.max_group;
  }
  if (wakes) wake_.notify_one();
  return {};
}

Status DbWriter::run(Work work) {
  // shared: the writer may still be inside set_value() when the waiting thread continues
  const auto promise = std::make_shared<std::promise<Status>>();
  auto future = promise->get_future();
  RETURN_IF_ERROR(post(std::move(work), [promise](const Status& status) { promise->set_value(status); }));
  return future.get();
}

bool DbWriter::emptyLog(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  if (ended_) return false;
  const std::uint64_t asked = ++emptying_asked_;
  wake_.notify_one();
  time_.waitUntilNs(emptied_, lock, time_.nowNs() + nanoseconds(patience),
                    [&] { return emptying_done_ >= asked || ended_; });
  return emptying_done_ >= asked;
}

void DbWriter::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  const std::lock_guard lock(join_mutex_);
  if (thread_.joinable()) thread_.join();
}

std::optional<Error> DbWriter::failed() const {
  const std::lock_guard lock(mutex_);
  return failed_;
}

DbWriter::Counters DbWriter::counters() const {
  const std::lock_guard lock(mutex_);
  Counters counters = counters_;
  counters.waiting = queue_.size();
  counters.log_pending = emptying_asked_ > emptying_done_;
  return counters;
}

DbWriter::Standing DbWriter::standing() const {
  const std::lock_guard lock(mutex_);
  return standing_;
}

void DbWriter::loop() {
  for (;;) {
    std::vector<Item> group = takeGroup();
    if (!group.empty() && !commitGroup(group)) break;
    if (const auto tended = tendLog(); !tended) {
      std::vector<Item> none;
      fail(tended.error(), none);
      break;
    }
    const std::lock_guard lock(mutex_);
    if (stopping_ && queue_.empty()) break;
  }
  // leave a database that needs no recovery; a failure here loses nothing
  bool wanted = false, failed = false;
  {
    const std::lock_guard lock(mutex_);
    wanted = emptying_asked_ > emptying_done_;
    failed = failed_.has_value();
  }
  if (!failed) (void)(wanted ? tryToEmptyLog() : connection_.checkpointPassive());
  const std::lock_guard lock(mutex_);
  ended_ = true;
  emptied_.notify_all();
}

Status DbWriter::tendLog() {
  const std::int64_t now_ns = time_.nowNs();
  bool empty = false;
  {
    const std::lock_guard lock(mutex_);
    const bool wanted = emptying_asked_ > emptying_done_ || log_bytes_ > options_.max_log_bytes;
    // immediately after each call of emptyLog(), then at intervals
    empty = emptying_asked_ > emptying_tried_ || (wanted && now_ns >= next_emptying_ns_);
  }
  if (empty) return tryToEmptyLog();
  if (!uncheckpointed_ || now_ns < next_checkpoint_ns_) return {};
  Connection::WalProgress progress;
  RETURN_IF_ERROR(connection_.checkpointPassive(&progress));
  uncheckpointed_ = false;
  next_checkpoint_ns_ = now_ns + nanoseconds(options_.checkpoint_every);
  const std::int64_t took = time_.nowNs() - now_ns;
  const std::lock_guard lock(mutex_);
  ++counters_.checkpoints;
  counters_.checkpoint_ns.add(took);
  counters_.wal_pages_waiting = progress.pages - std::min(progress.pages, progress.moved);
  return {};
}

Status DbWriter::tryToEmptyLog() {
  std::uint64_t asked = 0;
  bool wanted = false;
  {
    const std::lock_guard lock(mutex_);
    asked = emptying_asked_;
    wanted = asked > emptying_done_;
  }
  ASSIGN_OR_RETURN(const bool emptied, connection_.emptyLog(kEmptyingPatience_ms));
  log_bytes_ = connection_.walBytes();
  if (emptied) uncheckpointed_ = false;
  next_emptying_ns_ = time_.nowNs() + nanoseconds(options_.empty_every);
  const std::lock_guard lock(mutex_);
  assert(emptying_tried_ <= asked && emptying_done_ <= asked && asked <= emptying_asked_);
  emptying_tried_ = asked;
  counters_.wal_bytes = log_bytes_;
  if (!emptied) return {};
  ++counters_.logs_emptied;
  counters_.wal_pages_waiting = 0;
  if (!wanted) return {};
  emptying_done_ = asked;
  emptied_.notify_all();
  return {};
}

std::optional<std::int64_t> DbWriter::nextTendNs() const {
  std::optional<std::int64_t> next;
  if (uncheckpointed_) next = next_checkpoint_ns_;
  if (emptying_asked_ > emptying_done_ || log_bytes_ > options_.max_log_bytes)
    next = std::min(next.value_or(next_emptying_ns_), next_emptying_ns_);
  return next;
}

std::vector<DbWriter::Item> DbWriter::takeGroup() {
  std::unique_lock lock(mutex_);
  // idle until there is work or the log needs attention
  const auto has_work = [this] { return stopping_ || !queue_.empty() || emptying_asked_ > emptying_tried_; };
  if (const auto next = nextTendNs()) {
    time_.waitUntilNs(wake_, lock, *next, has_work);
  } else {
    wake_.wait(lock, has_work);
  }
  if (queue_.empty()) return {};
  // wait for more items for this commit
  time_.waitUntilNs(wake_, lock, time_.nowNs() + nanoseconds(options_.window),
                    [this] { return stopping_ || queue_.size() >= options_.max_group; });
  const std::size_t count = std::min(queue_.size(), options_.max_group);
  std::vector<Item> group(std::make_move_iterator(queue_.begin()),
                          std::make_move_iterator(queue_.begin() + static_cast<std::ptrdiff_t>(count)));
  queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(count));
  looked_at_ -= std::min(looked_at_, count);
  assert(!group.empty() && looked_at_ <= queue_.size());
  return group;
}

bool DbWriter::checkWaiting() {
  ArrivedChunk* chunk = nullptr;
  {
    const std::lock_guard lock(mutex_);
    while (chunk == nullptr && looked_at_ < queue_.size())
      chunk = std::get_if<ArrivedChunk>(&queue_[looked_at_++].work);
  }
  if (chunk == nullptr) return false;
  // only this thread removes items, and new ones do not move it in memory
  if (chunk->bytes.size() > kMaxStoredChunkBytes) return true;
  try {
    const auto info = checkChunk(chunk->bytes);
    if (!info) return true;
    chunk->samples = info->count;
  } catch (const std::exception&) {
    return false;  // out of memory: its group checks the chunk and reports it
  }
  const std::lock_guard lock(mutex_);
  ++counters_.checked_ahead;
  return true;
}

template <typename Call>
auto DbWriter::guarded(const Call& call) -> decltype(call()) {
  // Safe: stack unwinding releases statements and savepoints, so the item is rolled back like a failed one;
  // other items continue.
  try {
    return call();
  } catch (const std::exception& thrown) {
    const std::string text = thrown.what();
    if (options_.on_thrown) options_.on_thrown(text);
    return Error{ErrorCode::kFailed,
                 "a piece of work for the database failed inside (" + text +
                     "): nothing of it was stored; please report this as a fault of the program"};
  }
}

Status DbWriter::runWork(const Item& item) {
  return guarded([&]() -> Status {
    if (const auto* const chunk = std::get_if<ArrivedChunk>(&item.work))
      return SessionStore(connection_).append(*chunk);
    return std::get<Work>(item.work)(connection_);
  });
}

std::size_t DbWriter::storeBatch(const std::vector<Item>& group, std::size_t from,
                                 std::vector<std::optional<Status>>& results) {
  assert(from < group.size() && results.size() == group.size());
  std::vector<const ArrivedChunk*> chunks;
  for (std::size_t i = from; i < group.size() && chunks.size() < SessionStore::kMaxTogether; ++i) {
    const auto* const chunk = std::get_if<ArrivedChunk>(&group[i].work);
    if (chunk == nullptr) break;
    chunks.push_back(chunk);
  }
  if (chunks.empty()) return from + 1;
  auto stored = guarded([&] { return SessionStore(connection_).appendMany(chunks); });
  // retried one by one: each may fail alone
  if (!stored) return from + chunks.size();
  assert(!stored->empty() && stored->size() <= chunks.size());
  std::move(stored->begin(), stored->end(), results.begin() + static_cast<std::ptrdiff_t>(from));
  return from + stored->size();
}

bool DbWriter::commitGroup(std::vector<Item>& group) {
  assert(!group.empty());
  const std::int64_t began_ns = time_.nowNs();
  // nothing was stored, so nothing is in doubt
  const auto refuse = [&](const Error& error) {
    noteDurability();
    {
      const std::lock_guard lock(mutex_);
      counters_.refused += group.size();
      standing_.began_ns = 0;
      standing_.refused = error.message;
    }
    for (const Item& item : group) {
      if (item.done) item.done(error);
    }
    return true;
  };
  {
    const std::lock_guard lock(mutex_);
    standing_.began_ns = began_ns;
  }
  // chunks have no side effects beyond what they write, so they can be sent with BEGIN and receive its errors
  const bool begins_soon = std::holds_alternative<ArrivedChunk>(group.front().work);
  auto transaction = Transaction::begin(
      connection_, begins_soon ? Transaction::Kind::kWriteSoon : Transaction::Kind::kWrite);
  if (!transaction) {
    if (connection_.damaged()) return fail(transaction.error(), group), false;
    // another process holds the write lock (e.g. an SQLite shell)
    return refuse(transaction.error());
  }

  // a savepoint per item: a failed item is rolled back, the others continue
  const bool is_sqlite = connection_.sqlite() != nullptr;
  std::vector<std::optional<Status>> results(group.size());
  std::uint64_t refused = 0, together = 0;
  std::size_t looked_at = is_sqlite ? group.size() : 0;  // first item not yet tried together with others
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (i >= looked_at) looked_at = storeBatch(group, i, results);
    assert(looked_at > i);
    Status result;
    if (results[i]) {
      result = *std::exchange(results[i], std::nullopt);
      if (result.ok()) ++together;
    } else {
      auto savepoint = Savepoint::begin(connection_);
      // the engine's server keeps the data; nothing is in doubt
      if (!savepoint && (connection_.isLost() || (!is_sqlite && !connection_.damaged())))
        return refuse(savepoint.error());
      if (!savepoint) return fail(savepoint.error(), group), false;
      result = runWork(group[i]);
      if (result.ok()) result = savepoint->release();
    }
    // the transaction was lost with the connection
    if (!result.ok() && connection_.isLost()) return refuse(result.error());
    // out of memory, SQLite rolls back the whole transaction
    if (!result.ok() && !connection_.damaged() && !connection_.inTransaction()) return refuse(result.error());
    // an error that puts the disk in doubt concerns all items
    if (connection_.damaged() || !connection_.inTransaction()) {
      const Error cause =
          result.ok() ? Error{ErrorCode::kFailed, "the transaction ended unasked"} : result.error();
      return fail(cause, group), false;
    }
    if (!result.ok()) {
      ++refused;
      // the group continues without it, and the next one may succeed: without this note the failure would go
      // unnoticed
      if (result.error().code == ErrorCode::kFailed) {
        const std::lock_guard lock(mutex_);
        failed_item_ = {result.error().message, time_.nowNs()};
      }
    }
    results[i] = std::move(result);
  }

  const auto report = [&] {
    for (std::size_t i = 0; i < group.size(); ++i) {
      assert(results[i].has_value());
      if (group[i].done) group[i].done(*results[i]);
    }
  };
  noteDurability();
  if (planted(PlantedBug::kAckBeforeCommit)) report();
  const std::int64_t before_ns = time_.nowNs();
  if (auto done = transaction->commit(); !done && !planted(PlantedBug::kFsyncErrorIgnored)) {
    // the engine's server keeps the data; nothing is in doubt
    if (!is_sqlite && !connection_.damaged()) return refuse(done.error());
    return fail(done.error(), group), false;
  }
  assert(refused + together <= group.size());
  const std::int64_t took = time_.nowNs() - before_ns;
  log_bytes_ = connection_.walBytes();
  uncheckpointed_ = true;
  {
    const std::lock_guard lock(mutex_);
    counters_.items += group.size() - refused;
    counters_.refused += refused;
    counters_.together += together;
    ++counters_.commits;
    counters_.last_commit_ns = took;
    counters_.max_commit_ns = std::max<std::int64_t>(counters_.max_commit_ns, took);
    counters_.total_commit_ns += took;
    counters_.commit_ns.add(took);
    counters_.work_ns.add(before_ns - began_ns);
    counters_.group_items.add(static_cast<std::int64_t>(group.size()));
    counters_.wal_bytes = log_bytes_;
    standing_ = {.committed_ns = before_ns + took};
  }
  // only now is the data on disk
  if (!planted(PlantedBug::kAckBeforeCommit)) report();
  return true;
}

void DbWriter::noteLack() {
  std::string found = connection_.lack(), full = connection_.takeFull();
  if (found.empty()) found = reported_missing_;
  {
    const std::lock_guard lock(mutex_);
    if (!full.empty()) full_ = {std::move(full), time_.nowNs()};
    if (found == lack_) return;
    lack_ = found;
  }
  if (options_.on_lack) options_.on_lack(found);
}

void DbWriter::reportMissing(std::string text) {
  reported_missing_ = std::move(text);
}

std::string DbWriter::lack() const {
  const std::lock_guard lock(mutex_);
  return lack_;
}

std::string DbWriter::notedWithin(const Noted& noted, std::chrono::nanoseconds within) const {
  const std::lock_guard lock(mutex_);
  return time_.nowNs() - noted.at_ns > within.count() ? std::string() : noted.text;
}

std::string DbWriter::full(std::chrono::nanoseconds within) const {
  return notedWithin(full_, within);
}

std::string DbWriter::failedItem(std::chrono::nanoseconds within) const {
  return notedWithin(failed_item_, within);
}

void DbWriter::noteDurability() {
  noteLack();
  const Durability now = connection_.durability();
  const std::uint64_t connection = connection_.timesConnected();
  if (std::exchange(reported_connection_, connection) == connection &&
      now == durability_.load(std::memory_order_relaxed))
    return;
  durability_.store(now, std::memory_order_relaxed);
  if (options_.on_durability) options_.on_durability(now, connection_.durabilityReason());
}

void DbWriter::fail(const Error& error, std::vector<Item>& group) {
  std::deque<Item> waiting;
  {
    const std::lock_guard lock(mutex_);
    assert(!failed_ && !ended_ && "a writer fails once");
    failed_ = error;
    standing_.began_ns = 0;
    standing_.refused = error.message;
    waiting.swap(queue_);
    looked_at_ = 0;
  }
  const Status status = stoppedError(error);
  for (const Item& item : group) {
    if (item.done) item.done(status);
  }
  for (const Item& item : waiting) {
    if (item.done) item.done(status);
  }
  if (on_fatal_) on_fatal_(error);
}

}  // namespace needlelab
