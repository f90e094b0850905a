#include "server/live/fair_pool.h"

#include <boost/asio/post.hpp>
#include <utility>

namespace needlelab {

void FairQueue::put(const std::string& who, Work work) {
  std::deque<Work>& theirs = waiting_[who];
  if (theirs.empty()) turns_.push_back(who);
  theirs.push_back(std::move(work));
  ++size_;
}

FairQueue::Work FairQueue::take() {
  if (turns_.empty()) return {};
  std::string who = std::move(turns_.front());
  turns_.pop_front();
  const auto theirs = waiting_.find(who);
  Work work = std::move(theirs->second.front());
  theirs->second.pop_front();
  --size_;
  if (theirs->second.empty())
    waiting_.erase(theirs);
  else
    turns_.push_back(std::move(who));
  return work;
}

std::size_t FairQueue::waitingOf(const std::string& who) const {
  const auto theirs = waiting_.find(who);
  return theirs == waiting_.end() ? 0 : theirs->second.size();
}

void FairPool::post(const std::string& who, FairQueue::Work work) {
  const std::lock_guard lock(mutex_);
  queue_.put(who, std::move(work));
  if (running_ == threads_) return;
  ++running_;
  boost::asio::post(pool_, [this] { runNext(); });
}

void FairPool::runNext() {
  FairQueue::Work work;
  {
    const std::lock_guard lock(mutex_);
    work = queue_.take();
  }
  if (work) work();  // another thread may have been quicker
  work = {};
  const std::lock_guard lock(mutex_);
  if (queue_.size() > 0)
    boost::asio::post(pool_, [this] { runNext(); });
  else
    --running_;
}

}  // namespace needlelab
