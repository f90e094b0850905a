/// One thread for jobs that take long: the view starts them and takes their results in its own time.
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

/// Thread: one starts, polls and destroys. Jobs run one after the other.
class Worker {
 public:
  /// Runs within a later `poll`.
  using Finish = std::function<void()>;
  /// Runs on the worker's thread; asks `stopped` now and then. An empty Finish is allowed.
  using Job = std::function<Finish(const std::function<bool()>& stopped)>;

  Worker();
  /// Stops the job that runs, forgets the others, joins.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// `what`: for a person, while it runs: "loading a session".
  void start(std::string what, Job job);
  void poll();
  /// The running or the next waiting job; empty: none.
  [[nodiscard]] std::string doing() const;
  [[nodiscard]] bool busy() const { return !doing().empty(); }

 private:
  struct Entry {
    std::string what;
    Job job;
  };
  void run();

  mutable std::mutex mutex_;  // guards all that follows
  std::condition_variable changed_;
  std::deque<Entry> waiting_;
  std::string running_;
  std::vector<Finish> finished_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace needlelab
