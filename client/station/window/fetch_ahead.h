/// What a station gets from the server while nobody is at it, so that it has it without the server: the
/// lessons that are assigned to anybody, and how far each trainee is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "client/station/run/curriculum.h"
#include "client/station/run/options.h"
#include "client/station/window/lesson_board.h"
#include "common/base/result.h"

namespace needlelab {

/// What is to be fetched next.
struct WantedAhead {
  enum class Kind : std::uint8_t { kLesson, kStanding };
  Kind kind = Kind::kLesson;
  std::string id;  ///< of the exercise; the trainee's name
  friend bool operator<(const WantedAhead& a, const WantedAhead& b) {
    return std::tie(a.kind, a.id) < std::tie(b.kind, b.id);
  }
};

/// One thing at a time, so that a person who comes waits for little. Thread: the lessons'.
class FetchAhead {
 public:
  explicit FetchAhead(const StationOptions& options) : options_(options) {}

  /// Fetches what is missing, lessons first; else what is an hour old; standings also when assignments have
  /// changed. Keeps lessons at once, standings by and by and at the end. False: nothing is to be fetched.
  /// Errors: from `ask`, and of the disk; unless the server is away or somebody interrupts, it is asked for
  /// again only an hour later.
  Result<bool> step(StartLists& lists, const AskServer& ask, std::int64_t now_unix_ns);
  /// Keeps the standings that were fetched and are not kept yet. `lists`: as the last step left them. Errors:
  /// as CurriculumCache::keep.
  Status keep(const StartLists& lists, std::int64_t now_unix_ns);

 private:
  [[nodiscard]] std::optional<WantedAhead> wanted(const StartLists& lists, std::int64_t now_unix_ns) const;
  Status fetchLesson(StartLists& lists, const std::string& id, const AskServer& ask,
                     std::int64_t now_unix_ns);

  const StationOptions& options_;
  std::map<WantedAhead, std::int64_t> refused_unix_ns_;  // when it was asked for and not given
  std::size_t assignments_ = 0;                          // as in the lists of the last step
  std::int64_t assigned_unix_ns_ = 0;                    // when they changed; standings before that are old
  bool unkept_ = false;
  std::int64_t kept_unix_ns_ = 0;
};

}  // namespace needlelab
