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
#include "common/base/uuid.h"
#include "common/gesture/session_hash.h"
#include "db/arrived_chunk.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Maximum size of a stored chunk: with its envelope it must fit into a wire message (1 MiB).
inline constexpr std::size_t kMaxStoredChunkBytes = (1u << 20) - 1024;

/// Maximum number of open sessions in a Welcome: some 30 bytes each, far below 1 MiB.
inline constexpr std::uint32_t kMaxWelcomed = 1000;

/// Maximum number of sessions or audit lines in one list.
inline constexpr std::uint32_t kMaxListed = 1000;

/// What the database knows of a session that a station wants to open, before it is opened.
struct SessionArrival {
  enum class State {
    kNew,
    kOpen,
    kClosed,
  };
  State state = State::kNew;
  // for new ones only
  std::uint64_t open_sessions = 0;  ///< that its station has
  bool unknown_name = false;        ///< its trainee's name is nobody's, and no stored session has it
};

/// The outcome of close().
struct Closed {
  enum class Kind {
    kClosed,
    kRepeated,       ///< already closed with the same numbers
    kIncomplete,     ///< chunks from `next_seq` on are missing
    kContradiction,  ///< chunk count, samples or hash differ from what is stored; the session stays open
    kNotHashed,      ///< closeHashed(): its hash is needed, and is not given for these chunks; it stays open
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

/// The same of the first chunks, to go on from (SessionStore::hashOn).
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
/// The last chunk that begins at or before the moment; the first chunk when the moment is earlier than all.
/// An earlier chunk when a damaged one is in the way.
struct SoughtChunk {
  std::uint64_t seq = 0;
  std::uint64_t first_tick = 0;
  std::int64_t first_time_ns = 0;
  std::uint64_t recording_first_tick = 0;  ///< of chunk 0
  std::int64_t recording_first_time_ns = 0;
  std::uint32_t chunks_read = 0;  ///< number of chunks read in the search; none is decoded
};

/// The outcome of a full check: every chunk's CRC, whether it can be decoded, gaps, count, samples, hash.
/// Covers the stored recording: the original or the thinned one.
struct SessionCheck {
  bool ok = false;
  std::uint64_t chunks = 0;         ///< readable ones
  std::uint64_t samples = 0;        ///< in them
  Digest hash{};                    ///< over all that is not damaged
  std::string text;                 ///< the first fault, or that all is well
  std::vector<std::string> faults;  ///< each by session and chunk; at most kMaxFaults (db/check.h)
  /// Chunks that are stored as they came, but cannot be decoded: no damage, but not sound. At most
  /// kMaxFaults.
  std::vector<ChunkFault> undecodable;
  std::uint64_t undecodable_chunks = 0;
};

/// A check of one session between its steps (SessionStore::verifyOn).
struct SessionCheckSoFar {
  SessionCheck check;
  SessionHash hash;
  std::uint64_t next_seq = 0;
  std::uint64_t samples = 0, bytes = 0;  ///< of all chunks that are not damaged
  int recording = 0;                     ///< which of the session's it reads (StoredRecording::Kind); 0: none
};

/// Does not own the connection. A Result's error means that the database failed or the arguments are invalid;
/// protocol refusals are values. Thread: as its Connection. open, append, close, set… change several rows and
/// need the writer's connection and a transaction: run them inside DbWriter.
class SessionStore {
 public:
  explicit SessionStore(Connection& connection) : connection_(connection) {}

  /// What is known of the session before it is opened. Looks up indices only: some 10 µs, and 1 µs for each
  /// open session of the station.
  Result<SessionArrival> arrivalOf(const pb::SessionDescription& description);

  /// Returns the next seq: 0 for a new session. Repeating a known description is not an error. The
  /// chunks of an erased trainee's session are acknowledged but not kept. A session of an unknown trainee, or
  /// without its trainee's code, is taken, and flagged (unknown_trainees.h). Fields of the description that
  /// this version does not know are not stored. Errors: kInvalidInput (field, value, range), kAlreadyExists
  /// (the id is known with another description), kNotFound (no such station).
  Result<std::uint64_t> open(const pb::SessionDescription& description, std::int64_t now_unix_ns);

  /// Checks the chunk and stores it when it is the next one. Decodes it without keeping the samples
  /// (checkChunk: some 10 µs for a second of gesture at 1 kHz). A chunk with a right CRC that cannot be
  /// decoded is stored as it came and quarantined, so that the session goes on; the session's first one gets
  /// a line of the audit log, as its first contradiction does. `station`: the session must belong to it;
  /// empty = any.
  Result<Appended> append(const Uuid& session, std::uint64_t seq, ByteView bytes,
                          std::string_view station = {});

  /// The same, with a look at the chunk's claim before it and its admit() behind it; puts the result to its
  /// `appended`. An error takes the chunk back, if the caller undoes its savepoint. kDeposed.
  Status append(const ArrivedChunk& chunk);

  /// Stores many chunks at once, where a statement costs a round trip (PostgreSQL; on SQLite it takes none).
  /// Looks at the first of `chunks`, at most kMostTogether and, but for the first one, kMostTogetherBytes in
  /// all: as many as it returns. For each: nothing - append() is to take or refuse it, with the others that
  /// are left, in their order; success - it is stored, and its `appended` is what append() would have said;
  /// an error - of its admit(), it is not stored. Takes a chunk when it is sound and the next one of an open
  /// session, came by its station's newest claim, and so is each one of that session before it: so nothing
  /// comes out otherwise than one by one. admit() is called once a chunk, in their order. Within a savepoint
  /// of its own. Errors: nothing is stored, and no `appended` counts.
  Result<std::vector<std::optional<Status>>> appendMany(std::span<const ArrivedChunk* const> chunks);
  static constexpr std::size_t kMostTogether = 512;
  static constexpr std::size_t kMostTogetherBytes = std::size_t{4} << 20;

  /// Closes a session whose chunks a reader has hashed (hashOn); reads none itself, however long it is.
  /// kNotHashed: the hash is needed, and `known` is of other chunks than are stored: chunks came meanwhile.
  Result<Closed> closeHashed(const pb::CloseSession& request, std::int64_t now_unix_ns,
                             std::string_view station, const std::optional<HashedChunks>& known);
  /// The same with a hash of its own, for which it reads all chunks: not for the writer of a server.
  Result<Closed> close(const pb::CloseSession& request, std::int64_t now_unix_ns,
                       std::string_view station = {});

  /// Hash and sample count of chunks 0 … count−1 of the original, read back with their CRC. kCorrupt names
  /// the damaged chunk; kNotFound when there are fewer, or retention has removed them.
  Result<HashedChunks> hashChunks(const Uuid& session, std::uint64_t count);
  /// The same in pieces: goes on behind the chunks of `so_far` up to `count`, and ends earlier once it has
  /// read `most_bytes`, where a chunk counts kHashedChunkBytes besides its own. An error leaves in `so_far`
  /// what was read before.
  Status hashOn(const Uuid& session, std::uint64_t count, std::uint64_t most_bytes, HashSoFar& so_far);
  static constexpr std::uint64_t kHashedChunkBytes = 1024;

  /// First seq that is not stored. kNotFound: unknown session.
  Result<std::uint64_t> nextSeq(const Uuid& session);
  /// Returns n: a verified backup covers chunks 0 … n−1.
  Result<std::uint64_t> safeSeqs(const Uuid& session);
  /// How many of its chunks are Safe where an ack survives the loss of a disk: those before the first that
  /// cannot be decoded, which stays with its station. UINT64_MAX: there is none.
  Result<std::uint64_t> mostSafeSeqs(const Uuid& session);
  /// Of all sessions, the committed chunks that are not Safe: in no backup that counts or, where
  /// `acks_are_safe`, behind mostSafeSeqs(), too.
  Result<std::uint64_t> unsafeChunks(bool acks_are_safe);
  /// A station's newest kMaxWelcomed open sessions, oldest of them first. The station asks for others by
  /// OpenSession.
  Result<std::vector<pb::Welcome::OpenSession>> openSessions(std::string_view station);

  /// All stored facts of a session, including profile JSON and score. kNotFound.
  Result<pb::SessionInfo> info(const Uuid& session);
  /// Newest first, without profile JSON but with score and verdict. Ignores `wanted.page`; `after`: returns
  /// the sessions behind this one, for the next page. At most `limit` and kMaxListed; 0 means kMaxListed.
  /// `only_counted`: without sessions that count for nobody (unknown_trainees.h). `take` may change each
  /// before it is kept; false: this one and those behind it are not wanted, and hardly read.
  /// `held_at_unix_ns`: the verdict of an exam whose results are held back at this time is none (only the
  /// condition looks at it); 0: no verdict is held back. kInvalidInput:
  /// an unknown verdict, a search text that is not UTF-8.
  Result<std::vector<pb::SessionInfo>> list(const pb::ListSessions& wanted,
                                            const std::optional<Uuid>& after = {}, bool only_counted = false,
                                            const std::function<bool(pb::SessionInfo&)>& take = {},
                                            std::int64_t held_at_unix_ns = 0);

  /// Chunks from `from_seq` on, at most `max_chunks` and about `max_bytes` (at least one). Checks every CRC:
  /// kCorrupt names the first damaged chunk. Reads the stored recording, original or thinned; kNotFound gives
  /// the time and reason of a deletion.
  Result<std::vector<StoredChunk>> readChunks(const Uuid& session, std::uint64_t from_seq,
                                              std::uint32_t max_chunks, std::size_t max_bytes);
  /// As readChunks, but skips damaged chunks, which count for `max_chunks`.
  Result<ChunksAround> readAround(const Uuid& session, std::uint64_t from_seq, std::uint32_t max_chunks,
                                  std::size_t max_bytes);

  /// Reads a few chunks, however long the recording is: 3 or 4 when they are about equally long, at most
  /// about 2·log2 of their number. kNotFound: deleted, or empty; kCorrupt: chunk 0 is damaged.
  Result<SoughtChunk> seek(const Uuid& session, const SeekTo& to);

  /// Reads and checks the whole recording. A fault in the data is `ok == false`; an error means that the
  /// database could not be read.
  Result<SessionCheck> verify(const Uuid& session);
  /// The same in steps: goes on behind the chunks of `so_far`, and ends once it has read `most_bytes`, as
  /// hashOn() counts. Nothing: there is more, call it again. Between two steps chunks may come and the
  /// session may be closed; a recording that is thinned or removed meanwhile is begun anew, as what it is
  /// then.
  Result<std::optional<SessionCheck>> verifyOn(const Uuid& session, std::uint64_t most_bytes,
                                               SessionCheckSoFar& so_far);

  /// Stores the offset only when its round trip is smaller than the stored one, or none is stored.
  Status setClockOffset(const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns);
  /// Records that a verified backup contains chunks 0 … chunks−1. Never decreases.
  Status markSafe(const Uuid& session, std::uint64_t chunks);

 private:
  Connection& connection_;
};

}  // namespace needlelab
