/// The local spool survives a crash: it keeps every sample of every session until the server has it.
/// client/net/README.md describes its files, and when each is written and synced.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool/spool_clock.h"
#include "client/net/spool/spool_file.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "common/gesture/sample.h"
#include "needlelab/session.pb.h"

namespace needlelab {

/// The resolution that a session's description declares.
Resolution resolutionOf(const pb::SessionDescription& description);
void setResolution(pb::SessionDescription& description, const Resolution& resolution);

/// Refuses a description that no server would accept; allows an empty station name, because a station without
/// a key has none yet. Errors: kInvalidInput, with the field.
Status checkSpoolDescription(const pb::SessionDescription& description);

/// 12 days: memory lasts for hours, and no lesson lasts for days. A file of the spool with a number that
/// would need a longer session counts as damaged.
inline constexpr double kLongestSession_s = 1u << 20;

/// Samples that never reached the spool: the disk refused writes until memory was full.
struct SpoolLoss {
  std::uint64_t samples = 0;
  std::uint64_t from_tick = 0;  ///< the first of them
  friend bool operator==(const SpoolLoss&, const SpoolLoss&) = default;
};

/// What the disk has lost from a session between readable records, through damage or a power cut.
struct SpoolDamage {
  std::uint64_t chunks = 0;  ///< missing completely
  std::uint64_t samples =
      0;  ///< missing, including those in the chunks; by the end's count, otherwise by the ticks
  std::uint64_t from_tick = 0;  ///< the first of them
  friend bool operator==(const SpoolDamage&, const SpoolDamage&) = default;
};

/// The part of a session that the spool holds.
struct SpoolContents {
  std::uint64_t chunks = 0;   ///< that the server will get: synced on disk, or already there (`settle`)
  std::uint64_t samples = 0;  ///< in those chunks
  std::uint64_t bytes = 0;    ///< of those chunks' data
  bool ended = false;         ///< no more chunks will come
  bool interrupted = false;  ///< the program died during the session and the next start wrote the end, or the
                             ///< number of samples that never reached the disk is unknown
  std::optional<Digest> hash;  ///< over the chunks' bytes in order, once ended; nothing if the server has a
                               ///< chunk that the disk lost and the end does not have the hash
  SpoolLoss loss;              ///< also kept on disk
  SpoolDamage damage;          ///< also kept on disk
};

/// The part of a session that the server has. Kept on disk so that a restart does not send it again.
struct SpoolReceipt {
  std::uint64_t committed = 0;    ///< chunks 0 … n−1 are committed
  std::uint64_t safe = 0;         ///< … and covered by a verified backup
  bool closed = false;            ///< the server has verified and closed the session
  std::int64_t closed_at_ns = 0;  ///< by the spool's clock
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
  /// Appends some samples, coded as a chunk, to the tail. From now on they survive a crash of the program;
  /// they survive a power cut only once their chunk is synced. `seq` is that of their future chunk. Errors:
  /// kUnavailable (disk full).
  Status appendPiece(std::uint64_t seq, ByteView piece);
  /// Appends the next chunk (its seq is the number of chunks before it). `contents` counts it once synced.
  /// Errors: kUnavailable.
  Status appendChunk(ByteView chunk, std::uint64_t samples);
  /// Empties the tail, once all of its samples are in chunks.
  Status restartTail();
  /// Syncs the chunks appended so far. After a failure the next call writes the unsynced chunks again first.
  Status sync();
  /// Records the loss so far, in place, so that it needs no free disk space. Thread: the writing one. Errors:
  /// kUnavailable; `contents` counts the loss nevertheless.
  Status setLoss(const SpoolLoss& loss);
  /// Ends the session. Requires that everything is synced. Errors: kUnavailable; may be called again.
  Status end(bool interrupted);

  // --- after damage ---
  /// Fixes the numbers of the chunks once the server's first missing one is known. The server's chunks keep
  /// their numbers; later ones close up, because the server accepts no gaps. Chunks that the disk lost but
  /// the server has are not lost. Does nothing without damage or if already settled. Errors: kUnavailable.
  Status settle(std::uint64_t next_seq);

  // --- reading ---
  /// The copy of the chunk file (or else of the tail) as found on disk, if part of it could not be read or
  /// used; otherwise empty.
  [[nodiscard]] const std::filesystem::path& damaged() const { return damaged_; }
  /// Whether the description was loaded from the copy, because session.json was damaged.
  [[nodiscard]] bool restored() const { return restored_; }
  /// Whether loading wrote the session's end, because it was missing after a crash, a power cut or disk
  /// damage.
  [[nodiscard]] bool mended() const { return mended_; }
  /// A message about a damaged file `lost`, unless the server has closed the session; otherwise empty.
  [[nodiscard]] std::string lossNote() const;
  [[nodiscard]] SpoolContents contents() const;
  /// Returns the number of samples in the first `chunks` chunks.
  [[nodiscard]] std::uint64_t samplesIn(std::uint64_t chunks) const;
  /// Returns the number of bytes in the first `chunks` chunks.
  [[nodiscard]] std::uint64_t bytesIn(std::uint64_t chunks) const;
  /// Whether every chunk that `contents` counts is on disk; if not, the server has those lost to damage.
  [[nodiscard]] bool allOnDisk() const;
  /// Returns the bytes of a synced chunk. Errors: kCorrupt, kUnavailable, kNotFound.
  [[nodiscard]] Result<Bytes> readChunk(std::uint64_t seq) const;

  // --- state at the server ---
  /// The spool's clock, for the receipt's `closed_at_ns`.
  [[nodiscard]] SpoolClock& clock() const { return *clock_; }
  [[nodiscard]] SpoolReceipt receipt() const;
  /// Prepares a closed session that the server has lost for sending again: reads its chunks unless already
  /// loaded. Do not call it while another thread writes the session. Errors: kUnavailable, kCorrupt.
  Status reload();
  /// Writes the receipt to disk if it has changed. A lost receipt costs only a question to the server.
  Status setReceipt(const SpoolReceipt& receipt);

 private:
  friend class Spool;
  struct Entry {
    std::uint64_t offset = 0;
    std::uint64_t seq = 0;                                 // as recorded; damage leaves gaps
    std::uint64_t samples_through = 0, bytes_through = 0;  // of this chunk and all before it
    std::uint64_t first_tick = 0, last_tick = 0;           // only for a loaded chunk
  };
  /// The session's end as recorded before the disk was damaged.
  struct End {
    std::uint64_t chunks = 0, samples = 0;
    Digest hash{};
    bool interrupted = false;
  };
  SpoolSession() = default;
  static Result<std::shared_ptr<SpoolSession>> create(const std::filesystem::path& spool,
                                                      const pb::SessionDescription& description,
                                                      std::shared_ptr<SpoolClock> clock);
  static Result<std::shared_ptr<SpoolSession>> load(const std::filesystem::path& folder,
                                                    std::shared_ptr<SpoolClock> clock);
  Status loadDescription();
  Status loadChunks();
  bool agreesWithEnd();
  Status keepDamaged(const std::string& name);
  Status recoverTail();
  void loadLoss();
  Status syncLoss() const;
  void loadEnd();
  Status writeEnd(bool interrupted);
  // the following need the mutex
  [[nodiscard]] bool lossUnknown(std::uint64_t chunks) const { return !loss_read_ && chunks > 0; }
  void addEntry(const Entry& entry, std::uint64_t samples, std::uint64_t bytes);
  [[nodiscard]] SpoolContents contentsNow() const;
  [[nodiscard]] std::uint64_t recordedChunks() const;
  [[nodiscard]] std::uint64_t firstHole() const;
  [[nodiscard]] std::uint64_t kept() const;
  [[nodiscard]] std::size_t entriesBefore(std::uint64_t seq) const;
  [[nodiscard]] std::size_t entriesAmong(std::uint64_t chunks) const;
  [[nodiscard]] SpoolDamage damageFrom(std::uint64_t seq) const;
  [[nodiscard]] std::uint64_t chunksNow() const;

  std::shared_ptr<SpoolClock> clock_;
  std::filesystem::path folder_;
  std::filesystem::path damaged_;
  bool mended_ = false, restored_ = false;
  bool loss_read_ = true;  // false: the file `lost` is unreadable
  Uuid id_{};
  pb::SessionDescription description_;
  SpoolFile chunks_, tail_;       // written by the writing thread
  std::uint64_t tail_seq_ = 0;    // of the last piece
  std::uint32_t tail_parts_ = 0;  // pieces of that seq so far
  SessionHash hash_;
  bool sync_failed_ = false;

  mutable std::mutex mutex_;  // guards all that follows
  std::vector<Entry> entries_;
  std::uint64_t next_seq_ = 0;            // of the next chunk to be recorded
  std::uint64_t synced_ = 0;              // entries 0 … synced−1 are on disk
  std::optional<End> whole_;              // for a session that was damaged after its end
  SpoolDamage tail_damage_;               // between the pieces of a tail
  std::optional<std::uint64_t> settled_;  // chunks 0 … n−1 keep their numbers
  bool ended_ = false, interrupted_ = false;
  Digest end_hash_{};
  SpoolLoss loss_;
  SpoolContents ended_contents_;     // of a closed session, because its chunks are not read again
  std::uint64_t ended_records_ = 0;  // chunks on disk at the end
  SpoolReceipt receipt_;
};

/// How long the spool keeps closed sessions.
struct SpoolKeep {
  std::int64_t age_s = 14 * 86'400;  ///< by the spool's clock, since the server closed them
  std::uint64_t quota_bytes = std::uint64_t{4}
                              << 30;  ///< of the whole spool; removes the oldest closed sessions first
  /// Minimum free space on the spool's disk. Below it the spool also removes closed sessions, to make room
  /// for unsent ones.
  std::uint64_t min_free_bytes = std::uint64_t{256} << 20;
};

/// The unsent recordings in the spool, and the free space.
struct SpoolUsage {
  std::uint64_t unsent_sessions = 0;  ///< with samples that the server has not committed
  std::uint64_t unsent_bytes = 0;     ///< of their uncommitted chunks
  std::uint64_t free_bytes = 0;       ///< on the spool's disk, for this user
  std::uint64_t unsent_samples = 0;   ///< in them
};

/// The spool folder. Thread: one; SpoolSession states its own.
class Spool {
 public:
  /// Creates the folder if needed, locks it, and repairs sessions after a crash: drops torn ends, makes the
  /// tail the last chunk, and ends such sessions as interrupted. `notes()` lists the repairs and the
  /// unreadable files. Errors: kUnavailable (the folder cannot be created or written; another station uses
  /// it).
  static Result<std::unique_ptr<Spool>> open(const std::filesystem::path& folder);
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  /// Creates a session, ready for writing, and syncs its folder and description to disk.
  Result<std::shared_ptr<SpoolSession>> create(const pb::SessionDescription& description);
  /// All sessions that the server has not closed, oldest first (UUIDv7 sort by time).
  [[nodiscard]] std::vector<std::shared_ptr<SpoolSession>> unfinished() const;
  /// The closed sessions that no verified backup covers, oldest first. A server restored from an older backup
  /// lacks them, so the uplink asks for them.
  [[nodiscard]] std::vector<std::shared_ptr<SpoolSession>> closedButNotSafe() const;
  /// Removes closed sessions that are Safe, older than `keep.age_s`, or over the quota. Never removes a
  /// session that the server has not closed. Does not use this machine's clock, which may be wrong by years.
  /// Returns a text per removed session.
  std::vector<std::string> cleanUp(const SpoolKeep& keep);
  /// Measures the age of closed sessions. The uplink reports the server's time to it.
  [[nodiscard]] SpoolClock& clock() const { return *clock_; }
  /// Errors: kUnavailable if the disk cannot be queried.
  [[nodiscard]] Result<SpoolUsage> usage() const;
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  Spool() = default;
  std::filesystem::path folder_;
  int lock_fd_ = -1;
  std::shared_ptr<SpoolClock> clock_;
  std::vector<std::string> notes_;
  std::vector<std::shared_ptr<SpoolSession>> sessions_;  // oldest first
};

}  // namespace needlelab
