#include "server/live/password_pool.h"

#include <boost/asio/post.hpp>
#include <iterator>
#include <utility>

namespace needlelab {
namespace {

using PasswordLine = PasswordQueue::Line;

/// Which line has the next of four turns.
constexpr PasswordLine kPasswordCycle[] = {PasswordLine::kLogin, PasswordLine::kStation, PasswordLine::kLogin,
                                           PasswordLine::kPerson};

}  // namespace

bool PasswordQueue::hasRoom(Line line, const std::string& who) const {
  return lines_[static_cast<std::size_t>(line)].waitingOf(who) < kMostWaiting;
}

void PasswordQueue::put(Line line, const std::string& who, FairQueue::Work work) {
  queueOf(line).put(who, std::move(work));
}

FairQueue::Work PasswordQueue::take() {
  for (std::size_t tried = 0; tried < std::size(kPasswordCycle); ++tried) {
    FairQueue& queue = queueOf(kPasswordCycle[next_]);
    next_ = (next_ + 1) % std::size(kPasswordCycle);
    if (queue.size() > 0) return queue.take();
  }
  return {};
}

std::size_t PasswordQueue::size() const {
  std::size_t size = 0;
  for (const FairQueue& queue : lines_) size += queue.size();
  return size;
}

bool PasswordPool::hasRoom(Line line, const std::string& who) {
  const std::lock_guard lock(mutex_);
  return queue_.hasRoom(line, who);
}

void PasswordPool::post(Line line, const std::string& who, FairQueue::Work work) {
  const std::lock_guard lock(mutex_);
  queue_.put(line, who, std::move(work));
  if (std::exchange(running_, true)) return;
  boost::asio::post(pool_, [this] { runNext(); });
}

void PasswordPool::runNext() {
  FairQueue::Work work;
  {
    const std::lock_guard lock(mutex_);
    work = queue_.take();
  }
  work();
  work = {};
  const std::lock_guard lock(mutex_);
  running_ = queue_.size() > 0;
  if (running_) boost::asio::post(pool_, [this] { runNext(); });
}

}  // namespace needlelab
