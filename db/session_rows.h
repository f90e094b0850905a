/// A session's row, with the facts that every operation needs, and a scan over its chunks. Private to db.
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
#include "needlelab/teaching.pb.h"
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

/// Reads each chunk once and checks it (CRC at its end, CRC and sample count in its row, whether it can be
/// decoded). A row that is
/// missing, inconsistent or on an unreadable page is a fault of that chunk; the scan continues with the next
/// one. Thread: as the connection, which must outlive it.
class ChunkScan {
 public:
  /// What a chunk counts besides its bytes in `most_bytes`.
  static constexpr std::uint64_t kChunkCost = 1024;
  /// `name`: "session …", for messages. Scans chunks `from` to `to` − 1, limited to the stored count.
  /// `most_bytes`: after so many (with kChunkCost) the caller ends at the latest; it may go on all the same.
  /// Where an engine reads a result whole, each piece that is asked for ends with the chunk that reaches
  /// them, or kPieceBytes.
  ChunkScan(Connection& connection, std::string name, const StoredRecording& recording, std::uint64_t from,
            std::uint64_t to, std::uint64_t most_bytes = UINT64_MAX);

  struct Item {
    std::uint64_t seq = 0;
    std::uint64_t samples = 0;
    ByteView bytes;              ///< valid until the next call of next()
    std::optional<Error> fault;  ///< kCorrupt, names session and chunk; then `bytes` is empty, unless:
    bool undecodable = false;    ///< the chunk came as it is: its CRC is right, but it cannot be decoded
    /// Whether the stored bytes are not those that came.
    [[nodiscard]] bool damaged() const { return fault.has_value() && !undecodable; }
  };
  /// Nothing at the end. An error: the database could not be read.
  Result<std::optional<Item>> next();

 private:
  static constexpr std::uint64_t kPieceBytes = std::uint64_t{4} << 20, kPieceChunks = 256;
  Error faultOf(const std::string& what) const;
  void ask();
  /// Whether the rows ended although more may be there.
  [[nodiscard]] bool isCut() const { return at_end_ && (next_ >= piece_to_ || in_piece_ >= piece_bytes_); }

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  std::uint64_t next_;
  const std::uint64_t to_;
  std::uint64_t most_bytes_;  ///< what is left of them
  std::uint64_t piece_to_ = 0, piece_bytes_ = 0, in_piece_ = 0;
  std::optional<Statement> rows_;
  bool row_there_ = false;  ///< rows_ is at a row that was not delivered yet
  bool at_end_ = false;     ///< rows_ has no more rows
};

/// The columns of a session's row that every operation needs.
struct SessionRow {
  std::int64_t number = 0;
  std::string station;
  pb::SessionState state = pb::SESSION_OPEN;
  // of the original recording, even after retention; in session_progress while the session is open, then in
  // its row
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  std::uint64_t stored_bytes = 0;
  bool counting = false;       ///< has a row in session_progress: exactly the open sessions do
  std::optional<Digest> hash;  ///< once it is closed
  StoredRecording::Kind recording = StoredRecording::Kind::kOriginal;
  bool erased = false;  ///< the person's data was erased
};

/// Nothing when the session is unknown; an error when the database fails.
Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session);

/// kNotFound when the session is unknown.
Result<SessionRow> requireSession(Connection& connection, const Uuid& session);

/// kNotFound, with the session's name.
Error unknownSession(const Uuid& session);

/// The currently readable recording. kCorrupt: a thinned recording has no row.
Result<StoredRecording> recordingOf(Connection& connection, const std::string& name, const SessionRow& row);

/// "its recording was thinned to 100 Hz on 2026-11-20 …": why the original is gone. For messages.
Result<std::string> removalText(Connection& connection, const SessionRow& row);

/// kNotFound, with the time and reason of the deletion and what was kept.
Error recordingDeleted(Connection& connection, const std::string& name, const SessionRow& row);

/// recordingOf() by session id. kNotFound: the session is unknown, or its recording was deleted (with time
/// and reason). Within one view (Transaction::view), chunks read afterwards belong to this recording.
Result<StoredRecording> readableRecording(Connection& connection, const Uuid& session);

/// What attemptOf() reads, of `sessions s` and a place `p`.
inline constexpr std::string_view kAttemptColumns =
    "s.id, s.trainee, s.exercise_id, p.place, s.started_unix_ns, s.passed, s.state, s.excused,"
    " s.profile_revision, s.engine_version";
/// An attempt of these columns; `with_score`: its text is the next column.
pb::Attempt attemptOf(const Statement& row, bool with_score);
/// Numbers and places of the attempts of trainee ?1 at exercise ?2 that begin behind (?3, ?4), where there
/// are ?5 attempts before; at most ?6. Looks at the keys of these alone.
inline constexpr std::string_view kPlacesBehind =
    "SELECT number, ?5 + row_number() OVER (ORDER BY started_unix_ns, number) AS place FROM"
    " (SELECT number, started_unix_ns FROM sessions WHERE trainee = ?1 AND exercise_id = ?2 AND trainee <> ''"
    " AND (started_unix_ns, number) > (?3, ?4)"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"
    " ORDER BY started_unix_ns, number LIMIT ?6) AS these";
/// How many attempts the trainee has at the exercise up to this key: counts them by their keys.
Result<std::uint32_t> attemptsUpTo(Connection& connection, std::string_view trainee,
                                   std::string_view exercise_id, std::int64_t started_unix_ns,
                                   std::int64_t number);

/// A hash from a column; nothing unless it has 32 bytes.
std::optional<Digest> digestOf(ByteView bytes);

/// 16 bytes as a Uuid; nothing for any other length.
std::optional<Uuid> uuidOf(std::string_view bytes);
/// For messages: the id's text, or a note that it is not an id.
std::string sessionText(std::string_view bytes);

/// The CRC that the station stored in the chunk's last four bytes (common/gesture/FORMAT.md); 0 when the
/// chunk is shorter. A CRC over all bytes would be the same for every chunk, because each chunk ends with its
/// own CRC.
std::int64_t stationCrcOf(ByteView chunk);

/// Checks a row of `chunks`: the bytes must match the CRC at their end, that CRC must match the row's, and
/// the sample counts must match. Errors: kCorrupt names session and chunk. Returns nothing for a chunk that
/// can be decoded, else why it cannot, by session and chunk.
Result<std::optional<Error>> checkStoredChunk(const std::string& name, std::uint64_t seq,
                                              std::uint64_t samples, std::int64_t crc, ByteView bytes);

}  // namespace needlelab
