/// A session's row, with the facts that every operation needs, and a scan over its chunks. Private to db.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "db/store/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The location of a session's recording (migrations/0001_first.sql), with its stored totals.
struct StoredRecording {
  enum class Kind {
    kOriginal = 1,
    kThinned = 2,
    kDeleted = 3,  ///< not readable: no chunks
  };
  Kind kind = Kind::kOriginal;
  std::int64_t session = 0;  ///< sessions.number
  std::uint64_t chunks = 0;
  [[nodiscard]] std::string_view table() const {
    return kind == Kind::kThinned ? "derived_chunks" : "chunks";
  }
};

/// Reads each chunk once and checks it (the CRC at its end, CRC and sample count in its row, and that it can
/// be decoded). A row that is missing, inconsistent or on an unreadable page is a fault of that chunk; the
/// scan continues with the next one. Thread: as the connection, which must outlive it.
class ChunkScan {
 public:
  /// A chunk's fixed cost in `most_bytes`, added to its bytes.
  static constexpr std::uint64_t kChunkCost = 1024;
  /// `name`: "session …", for messages. Scans chunks `from` to `to` − 1, limited to the stored count.
  /// `most_bytes`: hint that the caller stops after so many bytes (including kChunkCost); it may still
  /// continue. Engines that read a result whole are asked for pieces that end with the chunk that reaches
  /// `most_bytes` or kPieceBytes.
  ChunkScan(Connection& connection, std::string name, const StoredRecording& recording, std::uint64_t from,
            std::uint64_t to, std::uint64_t most_bytes = UINT64_MAX);

  struct Item {
    std::uint64_t seq = 0;
    std::uint64_t samples = 0;
    ByteView bytes;              ///< valid until the next call of next()
    std::optional<Error> fault;  ///< kCorrupt, names session and chunk; `bytes` is empty unless:
    bool undecodable = false;    ///< stored as received with a correct CRC, but cannot be decoded
    /// Whether the stored bytes differ from those received.
    [[nodiscard]] bool damaged() const { return fault.has_value() && !undecodable; }
  };
  /// Nothing at the end. An error: the database could not be read.
  Result<std::optional<Item>> next();

 private:
  static constexpr std::uint64_t kPieceBytes = std::uint64_t{4} << 20, kPieceChunks = 256;
  Error faultOf(const std::string& what) const;
  void ask();
  /// Whether the rows ended although there may be more.
  [[nodiscard]] bool isCut() const { return at_end_ && (next_ >= piece_to_ || in_piece_ >= piece_bytes_); }

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  std::uint64_t next_;
  const std::uint64_t to_;
  std::uint64_t max_bytes_;  ///< remaining budget
  std::uint64_t piece_to_ = 0, piece_bytes_ = 0, in_piece_ = 0;
  std::optional<Statement> rows_;
  bool row_there_ = false;  ///< rows_ is at a row not delivered yet
  bool at_end_ = false;     ///< rows_ has no more rows
};

/// The columns of a session's row that every operation needs.
struct SessionRow {
  std::int64_t number = 0;
  std::string station;
  pb::SessionState state = pb::SESSION_OPEN;
  // for the original recording, even after retention; stored in session_progress while the session is open,
  // then in its row
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  std::uint64_t stored_bytes = 0;
  bool counting = false;       ///< has a row in session_progress, as exactly the open sessions do
  std::optional<Digest> hash;  ///< once closed
  StoredRecording::Kind recording = StoredRecording::Kind::kOriginal;
  bool erased = false;  ///< the person's data was erased
};

/// Nothing if the session is unknown; an error if the database fails.
Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session);

/// kNotFound if the session is unknown.
Result<SessionRow> requireSession(Connection& connection, const Uuid& session);

/// The currently readable recording. kCorrupt: a thinned recording has no row.
Result<StoredRecording> recordingOf(Connection& connection, const std::string& name, const SessionRow& row);

/// For messages: why the original is gone, e.g. "its recording was thinned to 100 Hz on 2026-11-20 …".
Result<std::string> removalText(Connection& connection, const SessionRow& row);

/// kNotFound, with the time and reason of the deletion and what was kept.
Error recordingDeleted(Connection& connection, const std::string& name, const SessionRow& row);

/// recordingOf() by session id. kNotFound: the session is unknown, or its recording was deleted (with time
/// and reason). Within one view (Transaction::view), chunks read afterwards belong to this recording.
Result<StoredRecording> readableRecording(Connection& connection, const Uuid& session);

/// A hash from a column; nothing unless it is 32 bytes long.
std::optional<Digest> digestOf(ByteView bytes);

/// For messages: the id's text, or a note that it is not an id.
std::string sessionText(std::string_view bytes);

/// The CRC that the station stored in the chunk's last four bytes (common/gesture/FORMAT.md); 0 if the chunk
/// is shorter. A CRC over all bytes, including that CRC, would be the same for every chunk.
std::int64_t stationCrcOf(ByteView chunk);

/// Checks a row of `chunks`: the bytes must match the CRC at their end, that CRC and the sample count must
/// match the row. Errors: kCorrupt names session and chunk. Returns nothing if the chunk can be decoded, else
/// why not, with session and chunk.
Result<std::optional<Error>> checkStoredChunk(const std::string& name, std::uint64_t seq,
                                              std::uint64_t samples, std::int64_t crc, ByteView bytes);

}  // namespace needlelab
