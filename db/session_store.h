/// Sessions and their chunks: opened, appended to without a gap, closed when everything is there, read,
/// verified.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/gesture/session_hash.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Longest chunk that is stored: it must fit, with its envelope, into a message of the wire (1 MiB).
inline constexpr std::size_t kMaxStoredChunkBytes = (1u << 20) - 1024;

/// Most open sessions that a Welcome lists: some 30 bytes each, so that it stays far below 1 MiB.
inline constexpr std::uint32_t kMaxWelcomed = 1000;

/// Most rows of sessions or audit lines that are listed at once.
inline constexpr std::uint32_t kMaxListed = 1000;

/// The outcome of append(). Only kStored and kRepeated may be acknowledged, and only after the commit.
struct Appended {
  enum class Kind {
    kStored,
    kRepeated,        ///< the same bytes were stored before: acknowledge again
    kGap,             ///< seq is beyond `next_seq`
    kContradiction,   ///< other bytes are stored under this seq, or the session is closed and has no such
                      ///< chunk
    kCorrupt,         ///< the chunk fails its own check
    kUnknownSession,  ///< never opened here, or opened by another station
  };
  Kind kind = Kind::kStored;
  std::uint64_t next_seq = 0;  ///< first seq that the store lacks, after this call
  std::string text;            ///< for a refusal: what was found, what to do
  [[nodiscard]] bool taken() const { return kind == Kind::kStored || kind == Kind::kRepeated; }
};

/// The outcome of close().
struct Closed {
  enum class Kind {
    kClosed,
    kRepeated,       ///< it was closed before with the same numbers
    kIncomplete,     ///< chunks from `next_seq` on are missing
    kContradiction,  ///< chunk count, samples or hash differ from what is stored; the session stays open
    kUnknownSession,
  };
  Kind kind = Kind::kClosed;
  std::uint64_t next_seq = 0;
  pb::SessionState state = pb::SESSION_STATE_UNSPECIFIED;
  std::string text;
  [[nodiscard]] bool taken() const { return kind == Kind::kClosed || kind == Kind::kRepeated; }
};

/// Chunks hashed beforehand on a reader, so that the writer need not read a whole session.
/// Stored chunks never change, so what a reader saw stays true.
struct HashedChunks {
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  Digest hash{};
};

struct StoredChunk {
  std::uint64_t seq = 0;
  std::uint64_t samples = 0;
  Bytes bytes;
};

/// A fault of one stored chunk.
struct ChunkFault {
  std::uint64_t seq = 0;
  std::string text;  ///< names session and chunk
};

/// Chunks that were read, and those that could not be.
struct ChunksAround {
  std::vector<StoredChunk> chunks;
  std::vector<ChunkFault> damaged;
  std::uint64_t next_seq = 0;  ///< where to go on
};

/// A moment of a recording: a tick, or else seconds since its first sample by the station's clock.
struct SeekTo {
  std::optional<std::uint64_t> tick;
  double seconds = 0;
};
/// The last chunk that begins at or before it; the first one for a moment before all. Where a damaged chunk
/// stands in the way it is an earlier one.
struct SoughtChunk {
  std::uint64_t seq = 0;
  std::uint64_t first_tick = 0;
  std::int64_t first_time_ns = 0;
  std::uint64_t recording_first_tick = 0;  ///< of chunk 0
  std::int64_t recording_first_time_ns = 0;
  std::uint32_t chunks_read = 0;  ///< to find it; none is decoded
};

/// The outcome of reading everything again: CRC of every chunk, no gap, count, samples, hash. Of the
/// recording that is there: the original, or the thinned one.
struct SessionCheck {
  bool ok = false;
  std::uint64_t chunks = 0;         ///< that could be read
  std::uint64_t samples = 0;        ///< in them
  Digest hash{};                    ///< over them
  std::string text;                 ///< what is wrong (the first fault), or that all is well
  std::vector<std::string> faults;  ///< each by session and chunk; at most kMaxFaults (db/check.h)
};

/// Functions on a connection, which it does not own. A Result's error means that the database failed or the
/// arguments are invalid; refusals of protocol are values.
/// Thread: as its Connection. open, append, close, set… need the writer's connection and a
/// transaction, because they change several rows: run them inside DbWriter.
class SessionStore {
 public:
  explicit SessionStore(Connection& connection) : connection_(connection) {}

  /// Gives the next seq: 0 for a new session. Repeating a known description is not an error. When the
  /// trainee's data was erased since the session began, it is stored under the pseudonym, and its chunks are
  /// acknowledged and not kept. Errors: kInvalidInput (field, value, range), kAlreadyExists (the id is known
  /// with another description), kNotFound (no such station).
  Result<std::uint64_t> open(const pb::SessionDescription& description, std::int64_t now_unix_ns);

  /// Checks the chunk (CRC, sample count) and stores it when it is the next one. `station`: the session must
  /// be its; empty = any.
  Result<Appended> append(const Uuid& session, std::uint64_t seq, ByteView bytes,
                          std::string_view station = {});

  /// `known`: from hashChunks() on a reader, with the count that is being closed; without it all chunks are
  /// read here.
  Result<Closed> close(const pb::CloseSession& request, std::int64_t now_unix_ns,
                       std::string_view station = {}, const std::optional<HashedChunks>& known = {});

  /// Hash and sample count of chunks 0 … count−1 of the original, read back with their CRC. kCorrupt names
  /// the chunk that fails; kNotFound when there are fewer, or retention has removed them.
  Result<HashedChunks> hashChunks(const Uuid& session, std::uint64_t count);

  /// First seq that is not stored. kNotFound: unknown session.
  Result<std::uint64_t> nextSeq(const Uuid& session);
  /// Chunks 0 … n−1 are covered by a verified backup.
  Result<std::uint64_t> safeSeqs(const Uuid& session);
  /// Open sessions of a station: the newest kMaxWelcomed, oldest of them first. A station asks for any other
  /// that it has by OpenSession.
  Result<std::vector<pb::Welcome::OpenSession>> openSessions(std::string_view station);

  /// Everything known of a session, profile JSON and score included. kNotFound.
  Result<pb::SessionInfo> info(const Uuid& session);
  /// Newest first, without profile JSON but with score and verdict. `wanted.page` is not read; `after`: those
  /// behind this session, for the next page. At most `limit` and kMaxListed; 0 means that many.
  /// kInvalidInput: an unknown verdict, a search text that is not UTF-8.
  Result<std::vector<pb::SessionInfo>> list(const pb::ListSessions& wanted,
                                            const std::optional<Uuid>& after = {});

  /// Chunks from `from_seq` on, at most `max_chunks` and about `max_bytes` (at least one). Every CRC is
  /// checked: kCorrupt names the first one that fails. Of the recording that is there, original or thinned;
  /// kNotFound says when and why it was deleted.
  Result<std::vector<StoredChunk>> readChunks(const Uuid& session, std::uint64_t from_seq,
                                              std::uint32_t max_chunks, std::size_t max_bytes);
  /// As readChunks, but over damaged chunks, which count for `max_chunks`.
  Result<ChunksAround> readAround(const Uuid& session, std::uint64_t from_seq, std::uint32_t max_chunks,
                                  std::size_t max_bytes);

  /// A few chunks are read, however long the recording is: 3 or 4 where they are about equally long, at most
  /// about 2·log2 of their number. kNotFound: deleted, or empty; kCorrupt: chunk 0 is damaged.
  Result<SoughtChunk> seek(const Uuid& session, const SeekTo& to);

  /// Reads all of it again. A fault in the data is `ok == false`; an error means it could not be looked at.
  Result<SessionCheck> verify(const Uuid& session);

  /// Kept only when the round trip is smaller than the one stored, or none is stored.
  Status setClockOffset(const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns);
  /// Chunks 0 … chunks−1 are in a verified backup. Never moves back.
  Status markSafe(const Uuid& session, std::uint64_t chunks);

 private:
  Connection& connection_;
};

}  // namespace needlelab
