/// Work that blocks, done on other threads while a coroutine of the network's thread waits.
#pragma once

#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "common/wire/asio.h"
#include "db/db_writer.h"

namespace needlelab {

/// Coroutines wait, another wakes them all; on one thread. A wake without a waiter is lost: check the
/// condition first, and again after waiting.
class Signal {
 public:
  explicit Signal(asio::any_io_executor executor)
      : timer_(std::move(executor), asio::steady_timer::time_point::max()) {}
  Task<> wait() { co_await timer_.async_wait(kUseTuple); }
  void notify() { timer_.cancel(); }

 private:
  asio::steady_timer timer_;
};

/// Brings what ends on another thread (a group of commits, say) to the network's thread together: one wake-up
/// for many. Thread: put() from any; the items run on the executor's, in the order in which they were put.
/// Must outlive the executor's last run.
class Inbox {
 public:
  explicit Inbox(asio::any_io_executor executor) : executor_(std::move(executor)) {}

  void put(std::function<void()> item) {
    {
      const std::lock_guard lock(mutex_);
      items_.push_back(std::move(item));
      if (items_.size() > 1) return;  // the first one's turn takes all
    }
    asio::post(executor_, [this] {
      std::vector<std::function<void()>> items;
      {
        const std::lock_guard lock(mutex_);
        items.swap(items_);
      }
      for (const auto& act : items) act();
    });
  }

 private:
  asio::any_io_executor executor_;
  std::mutex mutex_;
  std::vector<std::function<void()>> items_;  ///< guarded by mutex_
};

/// Runs `work` on the pool and gives its result on the caller's executor. The pool must end before the
/// io_context does.
template <typename T>
Task<T> offload(asio::thread_pool& pool, std::function<T()> work) {
  struct Answer {
    std::optional<T> value;
    std::exception_ptr error;
  };
  struct State {
    explicit State(asio::any_io_executor executor) : done(std::move(executor)) {}
    Signal done;
    std::optional<Answer> answer;  // written and read on the caller's executor only
  };
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  auto state = std::make_shared<State>(executor);
  asio::post(pool, [state, executor, work = std::move(work)]() mutable {
    // an exception (out of memory …) crosses the threads and comes out where the result would
    Answer answer;
    try {
      answer.value.emplace(work());
    } catch (...) {
      answer.error = std::current_exception();
    }
    asio::post(executor, [state = std::move(state), answer = std::move(answer)]() mutable {
      state->answer.emplace(std::move(answer));
      state->done.notify();
    });
  });
  while (!state->answer) co_await state->done.wait();
  if (state->answer->error) std::rethrow_exception(state->answer->error);
  co_return std::move(*state->answer->value);
}

/// For retention, which has time: from now on the threads that act for a person or a station go before this
/// one.
void yieldToOthers();

/// Runs `work` in the writer's next group; the status comes after the commit.
Task<Status> commit(DbWriter& writer, DbWriter::Work work);

}  // namespace needlelab
