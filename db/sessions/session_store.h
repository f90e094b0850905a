/// Sessions and their chunks: opening, gapless appending, closing once complete, reading, verifying.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "db/sessions/arrived_chunk.h"
#include "db/store/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Maximum size of a stored chunk: with its envelope it must fit into a wire message (1 MiB).
inline constexpr std::size_t kMaxStoredChunkBytes = (1u << 20) - 1024;

/// Maximum number of open sessions in a Welcome: about 30 bytes each, far below 1 MiB.
inline constexpr std::uint32_t kMaxWelcomed = 1000;

/// Maximum number of sessions or audit lines in one list.
inline constexpr std::uint32_t kMaxListed = 1000;

/// What the database knows about a session that a station wants to open.
struct SessionArrival {
  enum class State {
    kNew,
    kOpen,
    kClosed,
  };
  State state = State::kNew;
  // for new ones only
  std::uint64_t open_sessions = 0;  ///< of its station
  bool unknown_name = false;        ///< no account has its trainee's name, and no stored session either
};

/// The outcome of close().
struct Closed {
  enum class Kind {
    kClosed,
    kRepeated,       ///< already closed with the same numbers
    kIncomplete,     ///< chunks from `next_seq` on are missing
    kContradiction,  ///< chunk count, samples or hash differ from what is stored; the session stays open
    kNotHashed,  ///< closeHashed(): the hash is needed but not given for these chunks; the session stays open
    kUnknownSession,
  };
  Kind kind = Kind::kClosed;
  std::uint64_t next_seq = 0;
  pb::SessionState state = pb::SESSION_STATE_UNSPECIFIED;
  std::string text;
  [[nodiscard]] bool taken() const { return kind == Kind::kClosed || kind == Kind::kRepeated; }
};

/// Chunks hashed in advance on a reader, so that the writer need not read a whole session. Stored chunks
/// never change, so the reader's result stays valid.
struct HashedChunks {
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  Digest hash{};
};

/// Intermediate state of hashing the first chunks, to be continued (SessionStore::hashOn).
struct HashSoFar {
  SessionHash hash;
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  std::uint64_t bytes = 0;  ///< of the chunks
  [[nodiscard]] HashedChunks result() const { return {chunks, samples, hash.digest()}; }
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

/// Readable chunks, and the faults of damaged ones.
struct ChunksAround {
  std::vector<StoredChunk> chunks;
  std::vector<ChunkFault> damaged;
  std::uint64_t next_seq = 0;  ///< continue here
};

/// A moment of a recording: a tick, or seconds since its first sample by the station's clock.
struct SeekTo {
  std::optional<std::uint64_t> tick;
  double seconds = 0;
};
/// The last chunk that begins at or before the moment; the first chunk if the moment is earlier than all. If
/// a damaged chunk is in the way, an earlier one.
struct SoughtChunk {
  std::uint64_t seq = 0;
  std::uint64_t first_tick = 0;
  std::int64_t first_time_ns = 0;
  std::uint64_t recording_first_tick = 0;  ///< of chunk 0
  std::int64_t recording_first_time_ns = 0;
  std::uint32_t chunks_read = 0;  ///< by the search; none is decoded
};

/// The greatest number of faults that a check lists.
inline constexpr std::size_t kMaxFaults = 100;

/// The outcome of a full check: every chunk's CRC, whether it can be decoded, gaps, count, samples, hash.
/// Covers the stored recording: the original or the thinned one.
struct SessionCheck {
  bool ok = false;
  std::uint64_t chunks = 0;         ///< readable ones
  std::uint64_t samples = 0;        ///< in them
  Digest hash{};                    ///< over all undamaged chunks
  std::string text;                 ///< the first fault, or that all is well
  std::vector<std::string> faults;  ///< each by session and chunk; at most kMaxFaults (db/backup/check.h)
  /// Chunks stored as received that cannot be decoded: not damaged, but not sound. At most kMaxFaults.
  std::vector<ChunkFault> undecodable;
  std::uint64_t undecodable_chunks = 0;
};

/// A check of one session between two steps (SessionStore::verifyOn).
struct SessionCheckSoFar {
  SessionCheck check;
  SessionHash hash;
  std::uint64_t next_seq = 0;
  std::uint64_t samples = 0, bytes = 0;  ///< of all undamaged chunks
  int recording = 0;                     ///< which recording it reads (StoredRecording::Kind); 0: none yet
};

/// Does not own the connection. A Result's error means that the database failed or the arguments are invalid;
/// protocol refusals are values. Thread: as its Connection. open, append, close, set… change several rows and
/// need the writer's connection and a transaction: run them inside DbWriter.
class SessionStore {
 public:
  explicit SessionStore(Connection& connection) : connection_(connection) {}

  /// Returns what is known about a session before it is opened. Only index look-ups: about 10 µs, plus 1 µs
  /// per open session of the station.
  Result<SessionArrival> arrivalOf(const pb::SessionDescription& description);

  /// Returns the next seq: 0 for a new session. Repeating a known description is not an error. Chunks of an
  /// erased trainee's session are acknowledged but not kept. A session of an unknown trainee, or without the
  /// trainee's code, is accepted and flagged (unknown_trainees.h). Description fields unknown to this version
  /// are not stored. Errors: kInvalidInput (field, value, range), kAlreadyExists (the id is known with
  /// another description), kNotFound (no such station).
  Result<std::uint64_t> open(const pb::SessionDescription& description, std::int64_t now_unix_ns);

  /// Checks the chunk and stores it if it is the next one. Decodes it without keeping the samples
  /// (checkChunk: about 10 µs for a second of gesture at 1 kHz). A chunk with a correct CRC that cannot be
  /// decoded is stored as received and quarantined, so that the session can continue. The session's first
  /// such chunk, and its first contradiction, each get a line in the audit log. `station`: the session must
  /// belong to it; empty: any.
  Result<Appended> append(const Uuid& session, std::uint64_t seq, ByteView bytes,
                          std::string_view station = {});

  /// Same, but checks the chunk's claim first and calls its admit() afterwards; the result goes to its
  /// `appended`. On an error the caller must undo its savepoint to remove the chunk. Errors also: kDeposed.
  Status append(const ArrivedChunk& chunk);

  /// Stores many chunks in one statement, for engines where a statement costs a round trip (PostgreSQL; on
  /// SQLite it stores none). Considers the first of `chunks`, as many as it returns results: at most
  /// kMaxTogether and, after the first, kMaxTogetherBytes in total. Result per chunk: nothing - call
  /// append() for it, in order with the other chunks left; success - stored, with `appended` as append()
  /// would set it; an error - from its admit(), not stored. A chunk is taken if it is sound, is the next one
  /// of an open session and was sent under its station's newest claim, and if all earlier chunks of that
  /// session are taken too, so the outcome is the same as one by one. Calls admit() once per chunk, in order.
  /// Uses its own savepoint. Errors: nothing is stored, and all `appended` are invalid.
  Result<std::vector<std::optional<Status>>> appendMany(std::span<const ArrivedChunk* const> chunks);
  static constexpr std::size_t kMaxTogether = 512;
  static constexpr std::size_t kMaxTogetherBytes = std::size_t{4} << 20;

  /// Closes a session whose chunks a reader has hashed (hashOn); reads none itself, however long the session
  /// is. kNotHashed: the hash is needed, and `known` covers other chunks than are stored, because more
  /// arrived meanwhile.
  Result<Closed> closeHashed(const pb::CloseSession& request, std::int64_t now_unix_ns,
                             std::string_view station, const std::optional<HashedChunks>& known);
  /// Same, but computes the hash itself by reading all chunks: not for a server's writer.
  Result<Closed> close(const pb::CloseSession& request, std::int64_t now_unix_ns,
                       std::string_view station = {});

  /// Hash and sample count of chunks 0 … count−1 of the original, read back with their CRC. kCorrupt names
  /// the damaged chunk; kNotFound: there are fewer, or retention has removed them.
  Result<HashedChunks> hashChunks(const Uuid& session, std::uint64_t count);
  /// Same in steps: continues after the chunks in `so_far` up to `count`, and stops earlier once it has read
  /// `most_bytes` (a chunk counts kHashedChunkBytes plus its size). After an error `so_far` holds what was
  /// read before.
  Status hashOn(const Uuid& session, std::uint64_t count, std::uint64_t most_bytes, HashSoFar& so_far);
  static constexpr std::uint64_t kHashedChunkBytes = 1024;

  /// First seq that is not stored. kNotFound: unknown session.
  Result<std::uint64_t> nextSeq(const Uuid& session);
  /// Returns n: a verified backup covers chunks 0 … n−1.
  Result<std::uint64_t> safeSeqs(const Uuid& session);
  /// How many of its chunks are Safe if acks survive the loss of a disk: those before the first undecodable
  /// one, which stays with its station. UINT64_MAX: all.
  Result<std::uint64_t> mostSafeSeqs(const Uuid& session);
  /// Number of committed chunks, over all sessions, that are not Safe: in no backup that counts or, if
  /// `acks_are_safe`, at or after mostSafeSeqs().
  Result<std::uint64_t> unsafeChunks(bool acks_are_safe);
  /// A station's newest kMaxWelcomed open sessions, oldest first. The station asks for others with
  /// OpenSession.
  Result<std::vector<pb::Welcome::OpenSession>> openSessions(std::string_view station);

  /// All stored facts of a session, including profile JSON and score. kNotFound.
  Result<pb::SessionInfo> info(const Uuid& session);
  /// Newest first, without profile JSON but with score and verdict. Ignores `wanted.page`; instead returns
  /// the sessions after `after`. At most `limit` and kMaxListed; 0 means kMaxListed. `only_counted`: omits
  /// sessions that count for no one (unknown_trainees.h). `take` may change each session before it is kept;
  /// it returns false to stop: that session is dropped, and hardly any more are read. `held_at_unix_ns`:
  /// exams whose results are held back at this time count as having no verdict (in the filter only); 0: no
  /// verdict is held back. kInvalidInput: an unknown verdict, a search text that is not UTF-8.
  Result<std::vector<pb::SessionInfo>> list(const pb::ListSessions& wanted,
                                            const std::optional<Uuid>& after = {}, bool only_counted = false,
                                            const std::function<bool(pb::SessionInfo&)>& take = {},
                                            std::int64_t held_at_unix_ns = 0);

  /// Chunks from `from_seq` on, at most `max_chunks` and about `max_bytes` (at least one). Checks every CRC:
  /// kCorrupt names the first damaged chunk. Reads the stored recording, original or thinned; kNotFound gives
  /// the time and reason of a deletion.
  Result<std::vector<StoredChunk>> readChunks(const Uuid& session, std::uint64_t from_seq,
                                              std::uint32_t max_chunks, std::size_t max_bytes);
  /// Like readChunks, but skips damaged chunks, which count towards `max_chunks`.
  Result<ChunksAround> readAround(const Uuid& session, std::uint64_t from_seq, std::uint32_t max_chunks,
                                  std::size_t max_bytes);

  /// Reads only a few chunks, however long the recording is: 3 or 4 if they are about equally long, at most
  /// about 2·log2 of their number. kNotFound: deleted, or empty; kCorrupt: chunk 0 is damaged.
  Result<SoughtChunk> seek(const Uuid& session, const SeekTo& to);

  /// Reads and checks the whole recording. A fault in the data is `ok == false`; an error means that the
  /// database could not be read.
  Result<SessionCheck> verify(const Uuid& session);
  /// Same in steps: continues after the chunks in `so_far` and stops once it has read `most_bytes`, counted
  /// as in hashOn(). Nothing: not finished, call it again. Between steps, chunks may arrive and the session
  /// may be closed; if the recording is thinned or removed meanwhile, the check restarts with the new
  /// recording.
  Result<std::optional<SessionCheck>> verifyOn(const Uuid& session, std::uint64_t most_bytes,
                                               SessionCheckSoFar& so_far);

  /// Stores the offset if none is stored or its round trip is smaller than the stored one's.
  Status setClockOffset(const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns);
  /// Records that a verified backup contains chunks 0 … chunks−1. Never decreases.
  Status markSafe(const Uuid& session, std::uint64_t chunks);

 private:
  Connection& connection_;
};

}  // namespace needlelab
