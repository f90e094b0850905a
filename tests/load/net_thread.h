/// An io_context with a thread of its own, and a way to ask it things.
#pragma once

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <future>
#include <thread>
#include <utility>

#include "common/wire/asio.h"

namespace needlelab::test {

/// Thread: `call` by any but its own. Destruction stops it: what runs on it must have ended, or is dropped.
class NetThread {
 public:
  NetThread() : thread_([this] { io_.run(); }) {}
  ~NetThread() { stop(); }
  NetThread(const NetThread&) = delete;
  NetThread& operator=(const NetThread&) = delete;

  asio::io_context& io() { return io_; }
  /// Runs `work` on the thread and gives its result.
  template <typename Work>
  auto call(Work work) -> decltype(work()) {
    std::packaged_task<decltype(work())()> task(std::move(work));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }
  void stop() {
    if (!thread_.joinable()) return;
    io_.stop();
    thread_.join();
  }

 private:
  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> guard_ = asio::make_work_guard(io_);
  std::thread thread_;
};

}  // namespace needlelab::test
