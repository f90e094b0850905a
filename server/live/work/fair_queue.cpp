#include "server/live/work/fair_queue.h"

#include <boost/asio/post.hpp>
#include <cassert>

namespace needlelab {

void FairPool::post(const std::string& who, Work work, std::size_t line) {
  const std::lock_guard lock(mutex_);
  queue_.put(who, std::move(work), line);
  assert(running_ <= threads_);
  if (running_ == threads_) return;
  ++running_;
  boost::asio::post(pool_, [this] { runNext(); });
}

std::size_t FairPool::waitingOf(const std::string& who, std::size_t line) {
  const std::lock_guard lock(mutex_);
  return queue_.waitingOf(who, line);
}

void FairPool::runNext() {
  std::optional<FairQueue<Work>::Taken> piece;
  {
    const std::lock_guard lock(mutex_);
    assert(running_ > 0);
    // few names are rejected here: only those that already use their threads
    piece = queue_.take([this](const std::string& who) {
      const auto theirs = at_work_.find(who);
      return theirs == at_work_.end() || theirs->second < max_of_one_;
    });
    if (!piece) {  // another thread was quicker, or all waiting names use their threads
      --running_;
      return;
    }
    ++at_work_[piece->who];
  }
  piece->item();
  piece->item = {};
  const std::lock_guard lock(mutex_);
  const auto theirs = at_work_.find(piece->who);
  assert(theirs != at_work_.end() && theirs->second > 0);
  if (--theirs->second == 0) at_work_.erase(theirs);
  if (queue_.size() > 0)
    boost::asio::post(pool_, [this] { runNext(); });
  else
    --running_;
}

}  // namespace needlelab
