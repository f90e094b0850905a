/// Constraints for work that takes minutes to hours: how much of the writer it may use, when it must end, and
/// which server does it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "common/base/time/time_source.h"
#include "db/store/duties.h"

namespace needlelab {

/// Limits of a run's use of the writer.
struct RetentionPace {
  std::uint32_t rows = 16;              ///< chunks removed in one piece
  std::size_t bytes = 96u << 10;        ///< of thinned chunks written in one piece; also read at once
  std::chrono::milliseconds pause{20};  ///< after each piece
  std::chrono::milliseconds look{20};   ///< between two checks of a busy writer
  std::uint64_t queue = 256;            ///< items in the writer's queue: with more, the run waits
  /// Free space to leave on the database's disk for stations, in addition to a thinned recording's own size.
  /// Deletions need only an eighth of it, because they free space.
  std::uint64_t min_free_bytes = 64u << 20;
  TimeSource* time = &machineTime();  ///< of the pauses; must outlive the run

  void sleep(std::chrono::milliseconds duration) const {
    time->sleepForNs(std::chrono::nanoseconds(duration).count());
  }
};

/// Thread: the two flags any; the rest is set before the first run.
struct LongWork {
  std::atomic<bool> cancelled = false;  ///< the program ends: stops backups, checks, verifications, previews
  /// Runs of retention and rescoring end after their current piece, and no further one begins.
  std::atomic<bool> is_stopped = false;
  RetentionPace pace;
  std::unique_ptr<Duties> duties = std::make_unique<Duties>();  ///< never null
};

}  // namespace needlelab
