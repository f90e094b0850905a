#include "client/instructor/model/stored/worker.h"

#include <utility>

namespace needlelab {

Worker::Worker() : thread_([this] { run(); }) {}

Worker::~Worker() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::start(std::string what, Job job) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_.push_back({std::move(what), std::move(job)});
  }
  changed_.notify_all();
}

void Worker::run() {
  for (;;) {
    Entry entry;
    {
      std::unique_lock lock(mutex_);
      running_.clear();
      changed_.wait(lock, [&] { return stop_ || !waiting_.empty(); });
      if (stop_) return;
      entry = std::move(waiting_.front());
      waiting_.pop_front();
      running_ = entry.what;
    }
    Finish finish = entry.job([this] { return stop_.load(); });
    const std::scoped_lock lock(mutex_);
    if (finish) finished_.push_back(std::move(finish));
    // The worker stays busy until its result is in the list, so that it never looks idle without a result.
    if (waiting_.empty()) running_.clear();
  }
}

void Worker::poll() {
  std::vector<Finish> finished;
  {
    const std::scoped_lock lock(mutex_);
    finished.swap(finished_);
  }
  for (Finish& each : finished) each();
}

std::string Worker::doing() const {
  const std::scoped_lock lock(mutex_);
  if (!running_.empty()) return running_;
  if (!waiting_.empty()) return waiting_.front().what;
  return finished_.empty() ? std::string() : std::string("finishing");
}

}  // namespace needlelab
