/// Threads that many people share: each person in turn.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <unordered_map>

namespace needlelab {

/// Work in the order in which it is to be done: one piece of each person in turn; a person's own in the order
/// of its arrival. So a person who asks for one thing waits for at most one piece of each other, however much
/// they have asked for. Thread: one at a time.
class FairQueue {
 public:
  using Work = std::function<void()>;
  struct Piece {
    std::string who;
    Work work;  ///< empty: there is none
  };
  void put(const std::string& who, Work work);
  /// The next piece; an empty function: there is none.
  Work take();
  /// The next piece of somebody whom `may` accepts; the others keep their places.
  Piece takeOf(const std::function<bool(const std::string& who)>& may);
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t waitingOf(const std::string& who) const;

 private:
  std::unordered_map<std::string, std::deque<Work>> waiting_;  // by person; without empty entries
  std::deque<std::string> turns_;                              // the people of waiting_, the next first
  std::size_t size_ = 0;
};

/// Runs the work of a FairQueue on a pool. At most `threads` pieces are in the pool at once; the others wait
/// in the queue, so that what is posted to the pool directly waits for few. One person has at most all but
/// one of the threads, even while nobody else asks: who comes then finds one free, however long that person's
/// pieces take. Only of a single thread a person may have all. Thread: any. The pool must be joined before
/// this ends. Work must not throw.
class FairPool {
 public:
  FairPool(boost::asio::thread_pool& pool, std::size_t threads)
      : pool_(pool), threads_(threads), most_of_one_(threads > 1 ? threads - 1 : 1) {}
  FairPool(const FairPool&) = delete;
  FairPool& operator=(const FairPool&) = delete;

  void post(const std::string& who, FairQueue::Work work);

 private:
  void runNext();

  boost::asio::thread_pool& pool_;
  const std::size_t threads_, most_of_one_;
  std::mutex mutex_;
  FairQueue queue_;          // guarded by mutex_
  std::size_t running_ = 0;  // guarded by mutex_: pieces in the pool
  // guarded by mutex_: pieces at work, by person; without zeros
  std::unordered_map<std::string, std::size_t> at_work_;
};

}  // namespace needlelab
