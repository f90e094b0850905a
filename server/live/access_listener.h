/// Hears, on a thread of its own, of changes of access that other servers on the database have made.
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

#include "common/base/time_source.h"
#include "db/access_feed.h"

namespace needlelab {

/// A change is told as soon as it is heard of (NOTIFY), and at the latest with the next look at the numbers,
/// which comes each second also where nothing was heard. After each connection it looks for what came since
/// the number that it knew, and tells that all accounts in use want a look: a notice may have been missed,
/// and another server of PostgreSQL may have lost numbers.
class AccessListener {
 public:
  struct Settings {
    std::chrono::milliseconds look_every{1'000};
    /// Without a look that was answered for so long, nobody knows what others have changed.
    std::chrono::milliseconds deaf_after{3'000};
    std::chrono::milliseconds first_pause{100}, longest_pause{1'000};  ///< between two tries to connect
    /// A change of this server's own is told so much later: the request that made it ends connections itself,
    /// but its asker's (followUp), unless the answer of its COMMIT was lost.
    std::chrono::milliseconds own_after{1'000};
    /// Whether triggers are there costs more than a look at the number.
    std::chrono::milliseconds faults_every{10'000};
    /// Nobody begins to watch where the database has not answered a look for so long (remote_access.h): a
    /// server that is put in another's place, or whose network was cut, is back sooner.
    std::chrono::milliseconds watch_refused_after{30'000};
    std::chrono::milliseconds slice{100};  ///< of waiting, after which it looks whether to stop
  };
  struct Tell {
    /// Thread: the listener's.
    std::function<void(std::vector<AccessChange>)> changes;
    std::function<void()> look_at_all;             ///< any account may have changed
    std::function<void(std::string fault)> fault;  ///< another one than before; empty: it is over
  };
  /// For health and metrics.
  struct Hearing {
    bool is_connected = false;
    bool is_deaf = false;   ///< for longer than Settings::deaf_after
    double silence_s = -1;  ///< since the last look that was answered; below 0: there was none
    std::uint64_t changes = 0, connections = 0;
    std::string fault;  ///< why changes are not heard, or late; empty: they are heard
  };

  /// `server`: the name of this one, which tells its own changes. `time` must outlive it.
  AccessListener(std::unique_ptr<AccessFeed> feed, std::string server, Settings settings, Tell tell,
                 TimeSource& time = machineTime());
  ~AccessListener();
  AccessListener(const AccessListener&) = delete;
  AccessListener& operator=(const AccessListener&) = delete;

  /// Call it once. `tell` is called from then on, until stop() returns.
  void start();
  void stop();
  /// What the thread does again and again: connects, or waits and looks. For tests, without a thread.
  void turn();
  /// Thread: any.
  [[nodiscard]] Hearing hearing() const;
  [[nodiscard]] const Settings& settings() const { return settings_; }

 private:
  void connect();
  void look();
  void lose(const Error& error);
  void tellOwn();
  void setFault(std::string fault);

  const std::unique_ptr<AccessFeed> feed_;
  const std::string server_;
  const Settings settings_;
  const Tell tell_;
  TimeSource& time_;
  const std::int64_t began_ns_;
  // the thread's
  bool is_connected_ = false, knows_number_ = false;
  std::int64_t number_ = 0;  ///< of the last change that was told
  std::int64_t looked_ns_ = 0, connect_at_ns_ = 0, faults_looked_ns_ = 0;
  std::chrono::milliseconds pause_;
  std::deque<std::pair<std::int64_t, AccessChange>> own_;  ///< by when they are told

  mutable std::mutex mutex_;
  Hearing hearing_;               ///< guarded by mutex_; without what is computed from the time
  std::int64_t answered_ns_ = 0;  ///< guarded by mutex_; 0: never

  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace needlelab
