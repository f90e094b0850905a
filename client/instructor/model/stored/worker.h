/// One thread for long jobs. The view starts them and polls their results.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace needlelab {

/// Thread: one thread starts jobs, polls and destroys. Jobs run one at a time.
class Worker {
 public:
  /// Runs within a later `poll`.
  using Finish = std::function<void()>;
  /// Runs on the worker's thread and calls `stopped` regularly. May return an empty Finish.
  using Job = std::function<Finish(const std::function<bool()>& stopped)>;

  Worker();
  /// Stops the running job, discards the others, joins.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// `what` describes the running job for a person: "loading a session".
  void start(std::string what, Job job);
  void poll();
  /// Returns the running job, or the next waiting one; empty if idle.
  [[nodiscard]] std::string doing() const;
  [[nodiscard]] bool busy() const { return !doing().empty(); }

 private:
  struct Entry {
    std::string what;
    Job job;
  };
  void run();

  mutable std::mutex mutex_;  // guards all following members
  std::condition_variable changed_;
  std::deque<Entry> waiting_;
  std::string running_;
  std::vector<Finish> finished_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace needlelab
