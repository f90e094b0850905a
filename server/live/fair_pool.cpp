#include "server/live/fair_pool.h"

#include <algorithm>
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
  return takeOf([](const std::string&) { return true; }).work;
}

FairQueue::Piece FairQueue::takeOf(const std::function<bool(const std::string& who)>& may) {
  const auto turn = std::find_if(turns_.begin(), turns_.end(), may);
  if (turn == turns_.end()) return {};
  Piece piece{std::move(*turn), {}};
  turns_.erase(turn);
  const auto theirs = waiting_.find(piece.who);
  piece.work = std::move(theirs->second.front());
  theirs->second.pop_front();
  --size_;
  if (theirs->second.empty())
    waiting_.erase(theirs);
  else
    turns_.push_back(piece.who);
  return piece;
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
  FairQueue::Piece piece;
  {
    const std::lock_guard lock(mutex_);
    // few are refused: each of them has threads at work
    piece = queue_.takeOf([this](const std::string& who) {
      const auto theirs = at_work_.find(who);
      return theirs == at_work_.end() || theirs->second < most_of_one_;
    });
    if (!piece.work) {  // another thread was quicker, or only those wait who have their threads
      --running_;
      return;
    }
    ++at_work_[piece.who];
  }
  piece.work();
  piece.work = {};
  const std::lock_guard lock(mutex_);
  const auto theirs = at_work_.find(piece.who);
  if (--theirs->second == 0) at_work_.erase(theirs);
  if (queue_.size() > 0)
    boost::asio::post(pool_, [this] { runNext(); });
  else
    --running_;
}

}  // namespace needlelab
