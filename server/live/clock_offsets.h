/// The clock offsets of open sessions, on their way to the database.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/db_writer.h"
#include "db/station_claims.h"
#include "server/base/log.h"

namespace needlelab {

/// Offsets that come before the writer gets to the first of them are one item of its queue, with the best
/// (least round trip) of each session: however many come, they take none of the places of chunks. Those of
/// more than kMostSessions sessions are further items. What is not stored is a line
/// `clock_offset_not_stored` in the log, 60 a minute at most.
class ClockOffsets {
 public:
  static constexpr std::size_t kMostSessions = 1024;

  /// What `put` comes before is stored before it. `round_trip_ns`: above 0. `claim`: by which it came, as
  /// ArrivedChunk::claim; one that is not its station's newest is not stored. Does not wait. Thread: any.
  void put(DbWriter& writer, const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns,
           std::shared_ptr<const StationClaim> claim = {});
  /// Says how many log lines were left out in minutes that are over. Call it by the clock, and at the end
  /// (INT64_MAX). Thread: any.
  void sayLeftOut(std::int64_t now_ns) { state_->sayLeftOut(now_ns); }

 private:
  struct Offset {
    std::int64_t offset_ns = 0, round_trip_ns = 0;
    std::shared_ptr<const StationClaim> claim;
  };
  using Item = std::map<Uuid, Offset>;
  /// Shared with the items, which may outlive this object in the writer's queue.
  struct State {
    /// No further offset belongs to this item.
    void end(const std::shared_ptr<Item>& item);
    void sayNotStored(const Error& error);
    void sayLeftOut(std::int64_t now_ns);
    std::mutex mutex;
    std::shared_ptr<Item> open;  ///< guarded by mutex; null: the next offset begins an item
    std::mutex lines_mutex;
    LogBound lines{60};  ///< guarded by lines_mutex
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace needlelab
