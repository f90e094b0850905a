/// The rows of a session: the few facts that every operation on it needs, and its chunks one after the other.
/// Private to db.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/gesture/session_hash.h"
#include "db/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Where a session's recording stands (migrations/0003_retention.sql), and what was noted of it.
struct StoredRecording {
  enum class Kind {
    kOriginal = 1,
    kThinned = 2,
    kDeleted = 3,  ///< nothing to read: no chunks
  };
  Kind kind = Kind::kOriginal;
  std::int64_t session = 0;  ///< sessions.number
  std::uint64_t chunks = 0;
  [[nodiscard]] std::string_view table() const {
    return kind == Kind::kThinned ? "derived_chunks" : "chunks";
  }
};

/// Each chunk once, checked (CRC at its end, CRC and sample count in its row). A row that is not there, does
/// not agree or lies on a page that SQLite cannot read is a fault of that chunk; the next one is tried all
/// the same. Thread: as the connection, which must outlive it.
class ChunkScan {
 public:
  /// `name`: "session …", for messages. Chunks `from` to `to` − 1, at most those noted.
  ChunkScan(Connection& connection, std::string name, const StoredRecording& recording, std::uint64_t from,
            std::uint64_t to);

  struct Item {
    std::uint64_t seq = 0;
    std::uint64_t samples = 0;
    ByteView bytes;              ///< until the next call of next()
    std::optional<Error> fault;  ///< kCorrupt, names session and chunk; then `bytes` is empty
  };
  /// Nothing at the end. An error: the database could not be read.
  Result<std::optional<Item>> next();

 private:
  Error faultOf(const std::string& what) const;

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  std::uint64_t next_;
  const std::uint64_t to_;
  std::optional<Statement> rows_;
  bool row_there_ = false;  ///< rows_ stands on a row that was not yet delivered
  bool at_end_ = false;     ///< rows_ has no more rows
};

/// What every operation on a session needs of its row.
struct SessionRow {
  std::int64_t number = 0;
  std::string station;
  pb::SessionState state = pb::SESSION_OPEN;
  // of the original recording, whatever retention has made of it; while it is open they stand in
  // session_progress, afterwards in its row
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  std::uint64_t stored_bytes = 0;
  bool counting = false;       ///< has a row in session_progress, as every open session has and no other
  std::optional<Digest> hash;  ///< once it is closed
  StoredRecording::Kind recording = StoredRecording::Kind::kOriginal;
  bool erased = false;  ///< its person's data was erased
};

/// Nothing when the session is unknown; an error when the database fails.
Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session);

/// kNotFound when the session is unknown.
Result<SessionRow> requireSession(Connection& connection, const Uuid& session);

/// kNotFound, with the session's name.
Error unknownSession(const Uuid& session);

/// The recording that can be read now. kCorrupt: the row of a thinned one is not there.
Result<StoredRecording> recordingOf(Connection& connection, const std::string& name, const SessionRow& row);

/// "its recording was thinned to 100 Hz on 2026-11-20 …": why the original is not there. For messages.
Result<std::string> removalText(Connection& connection, const SessionRow& row);

/// kNotFound: when and why it was deleted, what is kept.
Error recordingDeleted(Connection& connection, const std::string& name, const SessionRow& row);

/// recordingOf() of a session by its id. kNotFound: the session is unknown, or its recording was deleted
/// (when and why). Within one view (Transaction::view) it is the recording of the chunks that are read next.
Result<StoredRecording> readableRecording(Connection& connection, const Uuid& session);

/// A hash from a column; nothing unless it has 32 bytes.
std::optional<Digest> digestOf(ByteView bytes);

/// 16 bytes as a Uuid; nothing when there are more or fewer.
std::optional<Uuid> uuidOf(std::string_view bytes);
/// For messages: the id's text, or that it is none.
std::string sessionText(std::string_view bytes);

/// The CRC that the station put at the chunk's end (common/gesture/FORMAT.md): its last four bytes; 0 when it
/// is shorter. A CRC over all of its bytes would be the same number for every chunk, because they end with
/// their own.
std::int64_t stationCrcOf(ByteView chunk);

/// A row of `chunks` as read back: its bytes must agree with the CRC at their end, this with the one kept in
/// the row, and the sample counts with each other. kCorrupt names session and chunk. Gives the sample count.
Result<std::uint64_t> checkStoredChunk(const std::string& name, std::uint64_t seq, std::uint64_t samples,
                                       std::int64_t crc, ByteView bytes);

}  // namespace needlelab
