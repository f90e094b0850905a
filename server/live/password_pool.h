/// The one thread that has argon2's memory, shared in fair turns.
#pragma once

#include <array>
#include <boost/asio/thread_pool.hpp>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>

#include "server/live/fair_pool.h"

namespace needlelab {

/// A hash takes 0.1 s, so whoever asks for many makes others wait. Three lines take turns:
/// - log-ins of people, one at a time: LoginQueue says whose;
/// - stations, which bring a trainee's code;
/// - people, who give themselves or others passwords and codes.
/// Of four turns the log-ins have two and each other line one; a line where nobody waits gives its turn to
/// the next. So between two log-ins at most one other piece is done, whoever waits. In a line each station or
/// person has one piece in turn (FairQueue). Thread: one at a time.
class PasswordQueue {
 public:
  enum class Line : std::uint8_t { kLogin, kStation, kPerson };
  /// Of one station or person. As many as a connection's requests at work, so that only who uses several
  /// connections at once meets it.
  static constexpr std::size_t kMostWaiting = 8;

  /// Whether this station or person has fewer than kMostWaiting pieces in its line.
  [[nodiscard]] bool hasRoom(Line line, const std::string& who) const;
  /// Ask hasRoom() first, except for log-ins, which LoginQueue bounds.
  void put(Line line, const std::string& who, FairQueue::Work work);
  /// The next piece; an empty function: there is none.
  FairQueue::Work take();
  [[nodiscard]] std::size_t size() const;

 private:
  static constexpr std::size_t kLines = 3;
  [[nodiscard]] FairQueue& queueOf(Line line) { return lines_[static_cast<std::size_t>(line)]; }

  std::array<FairQueue, kLines> lines_;
  std::size_t next_ = 0;  // turn of the cycle
};

/// Runs the work of a PasswordQueue on a pool, one piece at a time. Thread: any. The pool must be joined
/// before this ends. Work must not throw.
class PasswordPool {
 public:
  using Line = PasswordQueue::Line;
  explicit PasswordPool(boost::asio::thread_pool& pool) : pool_(pool) {}
  PasswordPool(const PasswordPool&) = delete;
  PasswordPool& operator=(const PasswordPool&) = delete;

  /// PasswordQueue::hasRoom. It stays true until the caller posts, if only one thread posts.
  [[nodiscard]] bool hasRoom(Line line, const std::string& who);
  void post(Line line, const std::string& who, FairQueue::Work work);

 private:
  void runNext();

  boost::asio::thread_pool& pool_;
  std::mutex mutex_;
  PasswordQueue queue_;   // guarded by mutex_
  bool running_ = false;  // guarded by mutex_: a piece is in the pool
};

}  // namespace needlelab
