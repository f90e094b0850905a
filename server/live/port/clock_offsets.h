/// Stores the clock offsets of open sessions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/sessions/db_writer.h"
#include "db/sessions/station_claims.h"
#include "server/base/log.h"

namespace needlelab {

/// Collects offsets until the writer processes them as one item of its queue, with the best (least round
/// trip) of each session. So offsets never use up places for chunks. With more than kMaxSessions sessions,
/// further items are used. Offsets that are not stored are logged as `clock_offset_not_stored`, at most 60
/// lines a minute.
class ClockOffsets {
 public:
  static constexpr std::size_t kMaxSessions = 1024;

  /// Stored before anything posted to the writer after put(). `round_trip_ns`: above 0. `claim`: the log-in
  /// that sent it, as in ArrivedChunk::claim; the offset is dropped if the station has a newer one. Does not
  /// wait. Thread: any.
  void put(DbWriter& writer, const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns,
           std::shared_ptr<const StationClaim> claim = {});
  /// Logs how many lines were left out in minutes that have ended. Call periodically, and at the end
  /// (INT64_MAX). Thread: any.
  void reportOmitted(std::int64_t now_ns) { state_->reportOmitted(now_ns); }

 private:
  struct Offset {
    std::int64_t offset_ns = 0, round_trip_ns = 0;
    std::shared_ptr<const StationClaim> claim;
  };
  using Item = std::map<Uuid, Offset>;
  /// Shared with the items, which may outlive this object in the writer's queue.
  struct State {
    /// No further offset is added to this item.
    void end(const std::shared_ptr<Item>& item);
    void reportNotStored(const Error& error);
    void reportOmitted(std::int64_t now_ns);
    std::mutex mutex;
    std::shared_ptr<Item> open;  ///< guarded by mutex; null: the next offset starts an item
    std::mutex lines_mutex;
    LogBound lines{60};  ///< guarded by lines_mutex
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace needlelab
