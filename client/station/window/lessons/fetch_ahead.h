/// Fetches from the server, while the station is idle, what lessons need without it: everyone's assigned
/// lessons, and each trainee's standing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "client/station/run/io/options.h"
#include "client/station/run/lesson/curriculum.h"
#include "client/station/window/lessons/lesson_board.h"
#include "common/base/result.h"

namespace needlelab {

/// The next thing to fetch.
struct PrefetchItem {
  enum class Kind : std::uint8_t { kLesson, kStanding };
  Kind kind = Kind::kLesson;
  std::string id;  ///< the exercise's id, or the trainee's name
  friend bool operator<(const PrefetchItem& a, const PrefetchItem& b) {
    return std::tie(a.kind, a.id) < std::tie(b.kind, b.id);
  }
};

/// Fetches one thing at a time, so that an arriving person waits only briefly. Thread: the lessons'.
class FetchAhead {
 public:
  explicit FetchAhead(const StationOptions& options) : options_(options) {}

  /// Fetches what is missing, lessons first, then what is an hour old; standings also after assignments
  /// changed. Stores lessons at once, standings now and then and at the end. Returns false if there is
  /// nothing to fetch. Errors: from `ask` and the disk; retries only an hour later, unless the server was
  /// away or a person interrupted.
  Result<bool> step(StartLists& lists, const AskServer& ask, std::int64_t now_unix_ns);
  /// Stores the fetched standings that are not stored yet. `lists`: as the last step left them. Errors: as
  /// CurriculumCache::keep.
  Status keep(const StartLists& lists, std::int64_t now_unix_ns);

 private:
  [[nodiscard]] std::optional<PrefetchItem> wanted(const StartLists& lists, std::int64_t now_unix_ns) const;
  Status fetchLesson(StartLists& lists, const std::string& id, const AskServer& ask,
                     std::int64_t now_unix_ns);

  const StationOptions& options_;
  std::map<PrefetchItem, std::int64_t> refused_unix_ns_;  // when it was requested and refused
  std::size_t assignments_ = 0;                           // as in the lists of the last step
  std::int64_t assigned_unix_ns_ = 0;                     // when they changed; earlier standings are outdated
  bool unkept_ = false;
  std::int64_t kept_unix_ns_ = 0;
};

}  // namespace needlelab
