/// Listens, on its own thread, for changes of access made by other servers on the database.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/time/time_source.h"
#include "db/login/access_numbers.h"

namespace needlelab {

/// Reports a change as soon as it is notified of it (NOTIFY), or at the latest with the next look at the
/// numbers, which happens each second in any case. After each connection it reads the changes since the last
/// known number, and requests a check of all accounts in use: a notification may have been missed, and a
/// promoted PostgreSQL server may have lost numbers.
class AccessListener {
 public:
  struct Settings {
    std::chrono::milliseconds poll_every{1'000};
    /// Changes count as unknown after this time without a successful look.
    std::chrono::milliseconds deaf_after{3'000};
    std::chrono::milliseconds first_pause{100}, longest_pause{1'000};  ///< between two attempts to connect
    /// This server's own changes are reported after this delay. The request that made the change ends
    /// connections itself, except its own (followUp), unless the answer to its COMMIT was lost.
    std::chrono::milliseconds own_after{1'000};
    /// Checking that the triggers exist is more expensive than looking at the number.
    std::chrono::milliseconds faults_every{10'000};
    /// New viewers are refused when the database has answered no look for this long (remote_access.h). A
    /// standby that takes over, or a repaired network, is back sooner.
    std::chrono::milliseconds watch_refused_after{30'000};
    std::chrono::milliseconds slice{100};  ///< of waiting, before it checks whether to stop
  };
  struct Tell {
    /// Thread: the listener's.
    std::function<void(std::vector<AccessChange>)> changes;
    std::function<void()> look_at_all;             ///< any account may have changed
    std::function<void(std::string fault)> fault;  ///< a new fault; empty: it is over
  };
  /// For health check and metrics.
  struct Hearing {
    bool is_connected = false;
    bool is_deaf = false;   ///< for longer than Settings::deaf_after
    double silence_s = -1;  ///< since the last look that was answered; below 0: never
    std::uint64_t changes = 0, connections = 0;
    std::string fault;  ///< why changes are not heard or are late; empty: they are heard
  };

  /// `server`: this server's name, to recognise its own changes. `time` must outlive it.
  AccessListener(std::unique_ptr<AccessFeed> feed, std::string server, Settings settings, Tell tell,
                 TimeSource& time = machineTime());
  ~AccessListener();
  AccessListener(const AccessListener&) = delete;
  AccessListener& operator=(const AccessListener&) = delete;

  /// Call only once. `tell` is called from then on, until stop() returns.
  void start();
  void stop();
  /// One iteration of the thread: connects, or waits and looks. For tests, without a thread.
  void turn();
  /// Thread: any.
  [[nodiscard]] Hearing hearing() const;
  [[nodiscard]] const Settings& settings() const { return settings_; }

 private:
  void connect();
  void look();
  void lose(const Error& error);
  void deliverOwnChanges();
  void setFault(std::string fault);

  const std::unique_ptr<AccessFeed> feed_;
  const std::string server_;
  const Settings settings_;
  const Tell tell_;
  TimeSource& time_;
  const std::int64_t began_ns_;
  // used by the thread
  bool is_connected_ = false, knows_number_ = false;
  std::int64_t number_ = 0;  ///< of the last change reported
  std::int64_t looked_ns_ = 0, connect_at_ns_ = 0, faults_looked_ns_ = 0;
  std::chrono::milliseconds pause_;
  std::deque<std::pair<std::int64_t, AccessChange>> own_;  ///< with the time when they are due

  mutable std::mutex mutex_;
  Hearing hearing_;               ///< guarded by mutex_; without the members computed from the time
  std::int64_t answered_ns_ = 0;  ///< guarded by mutex_; 0: never

  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace needlelab
