/// Limits guessing of trainees' codes: a PIN of six digits has a million values.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>

#include "common/base/time/time_source.h"

namespace needlelab {

/// Counts each person's consecutive wrong codes, over all stations. After `allowed` wrong ones that person
/// must wait, at first for `first_wait`, twice as long after each further wrong one, at most for
/// `longest_wait`: a guesser has about 100 attempts a day. The price: anyone at a station can make a trainee
/// wait. An attempt counts as wrong from its beginning until forget() or giveBack(), so that concurrent
/// attempts cannot exceed `allowed`. In memory: a restart forgets; servers that work together keep the
/// entries in the database (code_tries.h). Thread: any.
class CodeGuard {
 public:
  struct Settings {
    unsigned allowed = 5;
    std::chrono::seconds first_wait{60};
    std::chrono::seconds longest_wait{15 * 60};
    /// Above this limit, the entry idle for longest is dropped.
    std::size_t max_entries = 10'000;
  };
  /// `time` must outlive it.
  explicit CodeGuard(TimeSource& time) : CodeGuard(time, Settings{}) {}
  CodeGuard(TimeSource& time, Settings settings) : time_(time), settings_(settings) {}

  struct Try {
    std::chrono::seconds must_wait{0};  ///< above 0: this attempt is not allowed and does not count
    unsigned left = 0;                  ///< further attempts without waiting, if this one is wrong
    std::chrono::seconds then_wait{0};  ///< wait before the next attempt, if this one is wrong
  };
  /// Begins an attempt at this person's code.
  Try begin(const std::string& name);
  /// The code was right or has been replaced: the count restarts.
  void forget(const std::string& name);
  /// The last allowed attempt could not be checked and does not count.
  void giveBack(const std::string& name);
  [[nodiscard]] std::size_t entries() const;

  struct Entry {
    unsigned wrong = 0;
    std::int64_t at_ns = 0, wait_until_ns = 0;
  };
  /// A person's state, to be stored elsewhere; nothing: no entry.
  [[nodiscard]] std::optional<Entry> entry(const std::string& name) const;
  void setEntry(const std::string& name, const Entry& entry);

 private:
  TimeSource& time_;
  const Settings settings_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Entry> entries_;  ///< by name; guarded by mutex_
};

/// "40 s", "2 min"; minutes are rounded up.
std::string waitText(std::chrono::seconds wait);

}  // namespace needlelab
