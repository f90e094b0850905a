/// The local spool that survives: every sample of every session lies here until the server has it.
/// Its files, and when each is written and synced: client/net/README.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "client/net/spool_file.h"
#include "common/base/uuid.h"
#include "common/gesture/sample.h"
#include "common/gesture/session_hash.h"
#include "needlelab/session.pb.h"

namespace needlelab {

/// The resolution that a session's description declares.
Resolution resolutionOf(const pb::SessionDescription& description);
void setResolution(pb::SessionDescription& description, const Resolution& resolution);

/// Samples of a session that never reached its spool, because the disk refused for longer than memory lasted.
struct SpoolLoss {
  std::uint64_t samples = 0;
  std::uint64_t from_tick = 0;  ///< the first of them
  friend bool operator==(const SpoolLoss&, const SpoolLoss&) = default;
};

/// The part of a session that the spool holds.
struct SpoolContents {
  std::uint64_t chunks = 0;   ///< on disk, synced: these may be sent
  std::uint64_t samples = 0;  ///< in those chunks
  std::uint64_t bytes = 0;    ///< of those chunks' data
  bool ended = false;         ///< nothing will come
  bool interrupted = false;   ///< the program died in the session: the end was made at the next start
  Digest hash{};              ///< over the chunks' bytes in order; once ended
  SpoolLoss loss;             ///< survives the program as well
};

/// The part of a session that the server has. Kept on disk so that a restart does not send it again.
struct SpoolReceipt {
  std::uint64_t committed = 0;  ///< chunks 0 … n−1 are committed
  std::uint64_t safe = 0;       ///< … and covered by a verified backup
  bool closed = false;          ///< the server has verified and closed the session
  std::int64_t closed_unix_ns = 0;
};

/// One session in the spool. Thread: the writing functions by one thread at a time, `sync` by one thread
/// (another may be writing), the others by any.
class SpoolSession {
 public:
  [[nodiscard]] const Uuid& id() const { return id_; }
  [[nodiscard]] std::string idText() const { return uuidText(id_); }
  [[nodiscard]] const pb::SessionDescription& description() const { return description_; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

  // --- writing ---
  /// Appends some samples, coded as a chunk, to the tail: they survive the death of this program from now on,
  /// and a power cut only when their chunk was synced. `seq` is that of the chunk they will be in. Errors:
  /// kUnavailable (disk full).
  Status appendPiece(std::uint64_t seq, ByteView piece);
  /// Appends the next chunk (seq = how many there were). It counts in `contents` once synced. Errors:
  /// kUnavailable.
  Status appendChunk(ByteView chunk, std::uint64_t samples);
  /// Empties the tail: all that is in it stands in chunks.
  Status restartTail();
  /// Syncs the chunks appended so far. After a failure the unsynced ones are written again before the next
  /// try.
  Status sync();
  /// Notes how many samples are lost so far; written in place, so that the disk need not have room. Thread:
  /// the writing one. Errors: kUnavailable; it counts in `contents` nevertheless.
  Status setLoss(const SpoolLoss& loss);
  /// No more chunks. Everything was synced before. Errors: kUnavailable; may be tried again.
  Status end(bool interrupted);

  // --- reading ---
  /// The file that keeps the chunks as they were found, when some of them could not be read; else empty.
  [[nodiscard]] const std::filesystem::path& damaged() const { return damaged_; }
  /// Its end was made when it was read: a crash, a power cut or a damaged disk left none.
  [[nodiscard]] bool mended() const { return mended_; }
  [[nodiscard]] SpoolContents contents() const;
  /// Samples in the first `chunks` of them.
  [[nodiscard]] std::uint64_t samplesIn(std::uint64_t chunks) const;
  /// Bytes of the first `chunks` of them.
  [[nodiscard]] std::uint64_t bytesIn(std::uint64_t chunks) const;
  /// The bytes of a synced chunk. Errors: kCorrupt, kUnavailable, kNotFound.
  [[nodiscard]] Result<Bytes> readChunk(std::uint64_t seq) const;

  // --- what the server has ---
  [[nodiscard]] SpoolReceipt receipt() const;
  /// A closed session that the server has lost is to be sent again: reads its chunks, where that was not done
  /// when the spool was opened. Not while somebody writes it. Errors: kUnavailable, kCorrupt.
  Status loadAgain();
  /// Writes the receipt to disk when it differs from what stands there. Losing one costs nothing but a
  /// question to the server.
  Status setReceipt(const SpoolReceipt& receipt);

 private:
  friend class Spool;
  struct Entry {
    std::uint64_t offset = 0;
    std::uint64_t samples_through = 0, bytes_through = 0;  // of this chunk and all before it
  };
  SpoolSession() = default;
  static Result<std::shared_ptr<SpoolSession>> create(const std::filesystem::path& spool,
                                                      const pb::SessionDescription& description);
  static Result<std::shared_ptr<SpoolSession>> load(const std::filesystem::path& folder);
  Status loadChunks();
  Status keepDamaged();
  Status recoverTail();
  void loadLoss();
  Status syncLoss() const;
  void addEntry(std::uint64_t offset, std::uint64_t samples, std::uint64_t bytes);

  std::filesystem::path folder_;
  std::filesystem::path damaged_;
  bool mended_ = false;
  Uuid id_{};
  pb::SessionDescription description_;
  SpoolFile chunks_, tail_;       // written by the writing thread
  std::uint64_t tail_seq_ = 0;    // of the last piece
  std::uint32_t tail_parts_ = 0;  // pieces of that seq so far
  SessionHash hash_;
  bool sync_failed_ = false;

  mutable std::mutex mutex_;  // guards all that follows
  std::vector<Entry> entries_;
  std::uint64_t synced_ = 0;  // entries 0 … synced−1 are on disk
  bool ended_ = false, interrupted_ = false;
  Digest end_hash_{};
  SpoolLoss loss_;
  SpoolContents ended_contents_;  // of a closed session: its chunks are not read again
  SpoolReceipt receipt_;
};

/// How long acknowledged sessions stay.
struct SpoolKeep {
  std::int64_t age_s = 14 * 86'400;  ///< since the server closed them
  std::uint64_t quota_bytes = std::uint64_t{4}
                              << 30;  ///< of the whole spool; the oldest closed ones go first
  /// Free on the spool's disk: below this, too, closed ones go, so that what no server has yet finds room.
  std::uint64_t min_free_bytes = std::uint64_t{256} << 20;
};

/// The recordings in the spool that no server has, and the free space.
struct SpoolUsage {
  std::uint64_t unsent_sessions = 0;  ///< with samples that the server has not committed
  std::uint64_t unsent_bytes = 0;     ///< of their chunks that are not committed
  std::uint64_t free_bytes = 0;       ///< on the spool's disk, for this user
  std::uint64_t unsent_samples = 0;   ///< in them
};

/// The folder. Thread: one, but `sessions` by any.
class Spool {
 public:
  /// Makes the folder if need be, locks it, and mends what a crash left: torn ends are dropped, a tail
  /// becomes the last chunk, such sessions are ended as interrupted. `notes()` says what was done and what
  /// could not be read. Errors: kUnavailable (the folder cannot be made or written; another station uses it).
  static Result<std::unique_ptr<Spool>> open(const std::filesystem::path& folder);
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  /// A new session, ready to be written; its folder and description are synced to disk.
  Result<std::shared_ptr<SpoolSession>> create(const pb::SessionDescription& description);
  /// All sessions that the server has not closed, oldest first (UUIDv7 sort by time).
  [[nodiscard]] std::vector<std::shared_ptr<SpoolSession>> unfinished() const;
  /// Those that the server has closed and no verified backup covers, oldest first. A server that was restored
  /// from an older backup lacks them: the uplink asks.
  [[nodiscard]] std::vector<std::shared_ptr<SpoolSession>> closedButNotSafe() const;
  /// Removes closed sessions that are Safe, older than `keep.age_s`, or over the quota. What the server has
  /// not closed is never touched. Says what it removed.
  std::vector<std::string> cleanUp(const SpoolKeep& keep, std::int64_t now_unix_ns);
  /// Errors: kUnavailable when the disk cannot be asked.
  [[nodiscard]] Result<SpoolUsage> usage() const;
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  Spool() = default;
  std::filesystem::path folder_;
  int lock_fd_ = -1;
  std::vector<std::string> notes_;
  std::vector<std::shared_ptr<SpoolSession>> sessions_;  // oldest first
};

}  // namespace needlelab
