#include "db/sessions/session_rows.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"

namespace needlelab {

Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session) {
  auto query = connection.query(
      "SELECT s.number, s.station, s.state, coalesce(p.chunks, s.chunks),"
      " coalesce(p.samples, s.samples), coalesce(p.stored_bytes, s.stored_bytes),"
      " s.hash, s.recording, s.erased, p.session IS NOT NULL FROM sessions s"
      " LEFT JOIN session_progress p ON p.session = s.number WHERE s.id = ?",
      ByteView(session));
  ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found) return std::optional<SessionRow>();
  SessionRow row;
  row.number = query.integer(0);
  row.station = query.text(1);
  row.state = static_cast<pb::SessionState>(query.integer(2));
  row.chunks = query.natural(3);
  row.samples = query.natural(4);
  row.stored_bytes = query.natural(5);
  row.hash = digestOf(query.bytes(6));
  row.recording = static_cast<StoredRecording::Kind>(query.integer(7));
  row.erased = query.integer(8) != 0;
  row.counting = query.integer(9) != 0;
  return std::optional(row);
}

Result<SessionRow> requireSession(Connection& connection, const Uuid& session) {
  ASSIGN_OR_RETURN(auto row, findSession(connection, session));
  if (!row) return unknownSession(session);
  return *std::move(row);
}

Result<StoredRecording> recordingOf(Connection& connection, const std::string& name, const SessionRow& row) {
  StoredRecording recording{row.recording, row.number, 0};
  if (row.recording == StoredRecording::Kind::kOriginal) recording.chunks = row.chunks;
  if (row.recording != StoredRecording::Kind::kThinned) return recording;
  auto query = connection.query("SELECT chunks FROM derived_recordings WHERE session = ? AND complete = 1",
                                row.number);
  ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found)
    return Error{ErrorCode::kCorrupt,
                 name + " was thinned, but the row of its thinned recording is not there"};
  recording.chunks = query.natural(0);
  return recording;
}

Result<std::string> removalText(Connection& connection, const SessionRow& row) {
  auto query = connection.query(
      "SELECT coalesce(deleted_unix_ns, removed_unix_ns), reason FROM removed_originals"
      " WHERE session = ?",
      row.number);
  ASSIGN_OR_RETURN(const bool found, query.step());
  const std::string what = row.recording == StoredRecording::Kind::kDeleted ? "its recording was deleted"
                                                                            : "its recording was thinned";
  if (!found) return what;
  return what + " on " + localTime(query.integer(0), TimeForm::kDay) + " (" + query.text(1) + ")";
}

Error recordingDeleted(Connection& connection, const std::string& name, const SessionRow& row) {
  ASSIGN_OR_RETURN(const auto why, removalText(connection, row));
  return {ErrorCode::kNotFound, name + ": " + why + "; its score, events and remarks are kept"};
}

Result<StoredRecording> readableRecording(Connection& connection, const Uuid& session) {
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection, session));
  const std::string name = "session " + uuidText(session);
  if (row.recording == StoredRecording::Kind::kDeleted) return recordingDeleted(connection, name, row);
  return recordingOf(connection, name, row);
}

std::optional<Digest> digestOf(ByteView bytes) {
  if (bytes.size() != std::tuple_size_v<Digest>) return std::nullopt;
  Digest digest{};
  std::copy(bytes.begin(), bytes.end(), digest.begin());
  return digest;
}

std::string sessionText(std::string_view bytes) {
  const auto id = uuidOf(bytes);
  return id ? uuidText(*id) : fmt::format("(an id of {} bytes, not 16)", bytes.size());
}

std::int64_t stationCrcOf(ByteView chunk) {
  std::uint32_t crc = 0;
  if (chunk.size() < sizeof(crc)) return 0;
  ByteReader reader(chunk.last(sizeof(crc)));
  return reader.get<std::uint32_t>();
}

Result<std::optional<Error>> checkStoredChunk(const std::string& name, std::uint64_t seq,
                                              std::uint64_t samples, std::int64_t crc, ByteView bytes) {
  const auto corrupt = [&](const std::string& why) {
    return Error{ErrorCode::kCorrupt, fmt::format("{}, chunk {}: {}", name, seq, why)};
  };
  if (crc != stationCrcOf(bytes))
    return corrupt("the stored bytes do not have the CRC that was noted when the chunk came in");
  const auto info = checkChunk(bytes);
  const auto count = info ? std::optional(info->count) : sealedSamples(bytes);
  if (!count) return corrupt(info.error().message);
  if (*count != samples) return corrupt(fmt::format("holds {} samples, noted are {}", *count, samples));
  return info ? std::optional<Error>() : std::optional(corrupt(info.error().message));
}

ChunkScan::ChunkScan(Connection& connection, std::string name, const StoredRecording& recording,
                     std::uint64_t from, std::uint64_t to, std::uint64_t most_bytes)
    : connection_(connection),
      name_(std::move(name)),
      recording_(recording),
      next_(from),
      to_(std::min(to, recording.chunks)),
      max_bytes_(most_bytes) {}

Error ChunkScan::faultOf(const std::string& what) const {
  return {ErrorCode::kCorrupt, fmt::format("{}, chunk {}: {}", name_, next_, what)};
}

void ChunkScan::ask() {
  const std::string table(recording_.table());
  row_there_ = at_end_ = false;
  if (connection_.sqlite() != nullptr) {
    // SQLite returns row by row. Match the row itself: a damaged index could return another chunk's row
    piece_to_ = to_;
    piece_bytes_ = UINT64_MAX;
    rows_.emplace(
        connection_.query("SELECT k.seq, c.samples, c.crc, c.bytes, c.session = k.session AND c.seq = k.seq"
                          " FROM " +
                              table + " AS k CROSS JOIN " + table +
                              " AS c ON c.rowid = k.rowid WHERE k.session = ? AND k.seq >= ? AND k.seq < ?"
                              " ORDER BY k.seq",
                          recording_.session, next_, to_));
    return;
  }
  // up to the row that reaches the piece's size; reading the lengths does not read the bytes
  piece_to_ = std::min(to_, next_ + kPieceChunks);
  piece_bytes_ = std::clamp<std::uint64_t>(max_bytes_, 1, kPieceBytes);
  in_piece_ = 0;
  rows_.emplace(
      connection_.query("SELECT k.seq, k.samples, k.crc, k.bytes, 1 FROM (SELECT seq, samples, crc, bytes,"
                        " sum(length(bytes) + ?5) OVER (ORDER BY seq) - length(bytes) - ?5 AS before FROM " +
                            table +
                            " WHERE session = ?1 AND seq >= ?2 AND seq < ?3) AS k WHERE k.before < ?4"
                            " ORDER BY k.seq",
                        recording_.session, next_, piece_to_, piece_bytes_, kChunkCost));
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

  if (rows_ && isCut()) rows_.reset();
  while (!row_there_) {
    if (!rows_) ask();
    if (at_end_) break;
    const auto row = rows_->step();
    if (!row) {
      if (row.error().code != ErrorCode::kCorrupt) return row.error();
      // a damaged page ends the statement but not the scan: restart after it
      rows_.reset();
      return faulty(faultOf("cannot be read from the database's pages: " + row.error().message));
    }
    row_there_ = *row;
    at_end_ = !*row;
    if (row_there_) {
      const std::uint64_t cost = rows_->bytes(3).size() + kChunkCost;
      in_piece_ += cost;
      max_bytes_ -= std::min(max_bytes_, cost);
    } else if (isCut()) {
      rows_.reset();
    }
  }
  if (at_end_ || rows_->natural(0) != next_) return faulty(faultOf("is missing"));
  row_there_ = false;
  if (rows_->integer(4) == 0)
    return faulty(faultOf("the database's index leads to another one: REINDEX mends it"));
  auto undecodable = checkStoredChunk(name_, next_, rows_->natural(1), rows_->integer(2), rows_->bytes(3));
  if (!undecodable) return faulty(undecodable.error());
  item.undecodable = undecodable->has_value();
  item.fault = *std::move(undecodable);
  item.samples = rows_->natural(1);
  item.bytes = rows_->bytes(3);
  ++next_;
  return std::optional(std::move(item));
}

}  // namespace needlelab
