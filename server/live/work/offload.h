/// Runs blocking work on other threads while a coroutine on the network's thread waits.
#pragma once

#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"
#include "db/sessions/db_writer.h"
#include "server/live/work/fair_queue.h"

namespace needlelab {

/// Coroutines wait until another wakes them all, on one thread. A wake-up without a waiter is lost: check the
/// condition before and after waiting.
class Signal {
 public:
  explicit Signal(asio::any_io_executor executor)
      : timer_(std::move(executor), asio::steady_timer::time_point::max()) {}
  Task<> wait() { co_await timer_.async_wait(kUseTuple); }
  void notify() { timer_.cancel(); }

 private:
  asio::steady_timer timer_;
};

/// A value set later, on the same thread.
template <typename T>
struct Later {
  explicit Later(asio::any_io_executor executor) : come(std::move(executor)) {}
  void set(T given) {
    value.emplace(std::move(given));
    come.notify();
  }
  static Task<T> wait(std::shared_ptr<Later> later) {
    while (!later->value) co_await later->come.wait();
    co_return std::move(*later->value);
  }

  Signal come;
  std::optional<T> value;
};

/// Collects completions from another thread (e.g. a group of commits) and runs them on the network's thread
/// with one wake-up for many. Thread: put() from any; the items run on the executor's thread in put() order.
/// Must outlive the executor's last run.
class Inbox {
 public:
  explicit Inbox(asio::any_io_executor executor) : executor_(std::move(executor)) {}

  void put(std::function<void()> item) {
    {
      const std::lock_guard lock(mutex_);
      items_.push_back(std::move(item));
      if (items_.size() > 1) return;  // the first item's callback takes all
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

/// Logs an exception of offloaded work (e.g. out of memory) and returns it as kFailed.
Error thrownByWork(const std::exception& thrown);

/// Whether T can hold an error itself.
template <typename T>
inline constexpr bool kCarriesError = std::is_same_v<T, Status>;
template <typename T>
inline constexpr bool kCarriesError<Result<T>> = true;

/// Runs `work` where `post` puts it and returns its result on the caller's executor. If T is a Result or
/// Status, an exception becomes its error, so that only this work fails; otherwise it is rethrown on the
/// caller's executor.
template <typename T>
Task<T> offloadBy(std::function<void(std::function<void()>)> post, std::function<T()> work) {
  struct Answer {
    std::optional<T> value;
    std::exception_ptr error;
  };
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  auto later = std::make_shared<Later<Answer>>(executor);
  std::function<void()> run = [later, executor, work = std::move(work)]() mutable {
    Answer answer;
    try {
      answer.value.emplace(work());
    } catch (const std::exception& thrown) {
      if constexpr (kCarriesError<T>)
        answer.value.emplace(thrownByWork(thrown));
      else
        answer.error = std::current_exception();
    } catch (...) {
      answer.error = std::current_exception();
    }
    asio::post(executor, [later = std::move(later), answer = std::move(answer)]() mutable {
      later->set(std::move(answer));
    });
  };
  post(std::move(run));
  Answer answer = co_await Later<Answer>::wait(std::move(later));
  if (answer.error) std::rethrow_exception(answer.error);
  co_return std::move(*answer.value);
}

/// Runs `work` on the pool and returns its result on the caller's executor. The pool must end before the
/// io_context does.
template <typename T>
Task<T> offload(asio::thread_pool& pool, std::function<T()> work) {
  std::function<void(std::function<void()>)> post = [&pool](std::function<void()> run) {
    asio::post(pool, std::move(run));
  };
  return offloadBy(std::move(post), std::move(work));
}

/// Likewise for work of a person or another name, in fair turns. `line`: a line of the pool.
template <typename T>
Task<T> offload(FairPool& pool, std::string who, std::function<T()> work, std::size_t line = 0) {
  std::function<void(std::function<void()>)> post = [&pool, line,
                                                     who = std::move(who)](std::function<void()> run) {
    pool.post(who, std::move(run), line);
  };
  return offloadBy(std::move(post), std::move(work));
}

/// Runs `work` on the pool without waiting for it. Logs an error or exception as `event`.
void postLogged(asio::thread_pool& pool, std::string event, std::function<Status()> work);

/// Lowers this thread's priority below the threads that serve people and stations. For retention, which is
/// not urgent.
void yieldThread();

/// Runs `work` in the writer's next group; returns the status after the commit.
Task<Status> commit(DbWriter& writer, DbWriter::Work work);

}  // namespace needlelab
