#include "db/chunk_scan.h"

#include <algorithm>
#include <utility>

#include "db/session_row.h"

namespace needlelab {

ChunkScan::ChunkScan(Connection& connection, std::string name, const StoredRecording& recording,
                     std::uint64_t from, std::uint64_t to)
    : connection_(connection),
      name_(std::move(name)),
      recording_(recording),
      next_(from),
      to_(std::min(to, recording.chunks)) {}

Error ChunkScan::faultOf(const std::string& what) const {
  return {ErrorCode::kCorrupt, name_ + ", chunk " + std::to_string(next_) + ": " + what};
}

Result<std::optional<ChunkScan::Item>> ChunkScan::next() {
  if (next_ >= to_) return std::optional<Item>();
  Item item;
  item.seq = next_;
  const auto faulty = [&](Error fault) {
    ++next_;
    item.fault = std::move(fault);
    return std::optional(std::move(item));
  };

  if (!rows_) {
    // the index finds the row; the row itself must say the same, or a damaged index would give out another
    // chunk
    const std::string table(recording_.table());
    rows_.emplace(
        connection_.query("SELECT k.seq, c.samples, c.crc, c.bytes, c.session = k.session AND c.seq = k.seq"
                          " FROM " +
                              table + " AS k CROSS JOIN " + table +
                              " AS c ON c.rowid = k.rowid"
                              " WHERE k.session = ? AND k.seq >= ? AND k.seq < ? ORDER BY k.seq",
                          recording_.session, next_, to_));
    row_there_ = at_end_ = false;
  }
  if (!row_there_ && !at_end_) {
    const auto row = rows_->step();
    if (!row) {
      if (row.error().code != ErrorCode::kCorrupt) return row.error();
      // a damaged page ends the statement, not the recording: begin anew behind it
      rows_.reset();
      return faulty(faultOf("cannot be read from the database's pages: " + row.error().message));
    }
    row_there_ = *row;
    at_end_ = !*row;
  }
  if (at_end_ || rows_->natural(0) != next_) return faulty(faultOf("is missing"));
  row_there_ = false;
  if (rows_->integer(4) == 0)
    return faulty(faultOf("the database's index leads to another one: REINDEX mends it"));
  const auto samples = checkStoredChunk(name_, next_, rows_->natural(1), rows_->integer(2), rows_->bytes(3));
  if (!samples) return faulty(samples.error());
  item.samples = *samples;
  item.bytes = rows_->bytes(3);
  ++next_;
  return std::optional(std::move(item));
}

}  // namespace needlelab
