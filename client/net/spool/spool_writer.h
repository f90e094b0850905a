/// Moves samples from the haptic thread's ring to the spool. One thread drains and writes, another syncs the
/// disk. Each repeats a pass that returns when it is due again; tests call the passes directly.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/net/spool/spool.h"
#include "common/base/bytes.h"
#include "common/base/time/time_source.h"
#include "common/base/wait_free.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// Ring between haptic thread and spool: 16 s at 1 kHz, 4 s at 4 kHz, so that a disk stall of seconds loses
/// nothing.
inline constexpr std::size_t kSampleRingCapacity = 16'384;
using SampleRing = SpscRing<GestureSample, kSampleRingCapacity>;

/// About 20 ms of samples for viewers and status lines. (The spool's tail gets its own pieces, more often.)
struct SamplePiece {
  std::shared_ptr<const std::vector<GestureSample>> samples;  ///< unchanged, as recorded; at least one
  GestureSample last;                                         ///< the newest of them
  std::uint64_t samples_so_far = 0;                           ///< of the session, this piece included
  std::uint32_t flags = 0;                                    ///< of all of its samples
  Bytes cut_memory{};  ///< LiveFrame's, after the last sample; the writer leaves it empty
  Bytes paths{};       ///< LiveFrame's, of these samples; the writer leaves it empty
};

/// Counts of the writer so far.
struct SpoolWriterCounts {
  std::uint64_t samples = 0;  ///< taken from the ring
  std::uint64_t chunks = 0;   ///< made from them, without lost ones
  std::uint64_t chunk_bytes = 0;
  std::uint64_t samples_lost = 0;     ///< neither on disk nor in memory: the disk was full for too long
  std::uint64_t samples_waiting = 0;  ///< in memory, because the disk refuses writes
  std::uint64_t disk_errors = 0;      ///< refused writes and syncs
  std::string disk_error;             ///< the current trouble as text; otherwise empty
};

struct SpoolWriterOptions {
  double rate_hz = 1000;
  std::size_t pending_bytes = 64u << 20;  ///< limit for chunks kept in memory while the disk is full
  TimeSource* time = &machineTime();      ///< must outlive the writer
  bool threads = true;                    ///< false: the owner calls writePass and syncPass when they are due
};

/// A crash of the program loses at most 20 ms: samples go to the tail when the oldest is 10 ms old; with the
/// period of 4 ms and the time to write, that stays below 20 ms. The writing thread has a low real-time
/// priority if allowed, far below the haptic loop, so that a busy machine does not delay it. Thread: one
/// thread creates, `finish`es and destroys it; any calls `counts`; the callbacks run on the writer's threads
/// and must not block.
class SpoolWriter {
 public:
  struct Callbacks {
    std::function<void(const SamplePiece&)> piece;    ///< every 20 ms
    std::function<void()> durable;                    ///< more chunks are on disk, or the session has ended
    std::function<void(const std::string&)> trouble;  ///< the disk refuses or works again; for a person
    /// Called with every sample, in order. If `wanted`, returns the memory of the cut after it, if any, for
    /// the sample's chunk (encodeChunk); otherwise nothing. May be empty: chunks without memories.
    std::function<Bytes(const GestureSample& sample, bool wanted)> cut_memory{};
    /// Called after `cut_memory` for each sample that goes into a chunk. Returns the list of paths that a
    /// reader needs at it, if any; `first`: the sample is its chunk's first. May be empty.
    std::function<Bytes(bool first)> paths{};
  };

  /// Returned by a pass that is due only after another event.
  static constexpr std::int64_t kNotDue_ns = std::numeric_limits<std::int64_t>::max();

  /// Starts both threads, unless `options` says otherwise. `ring` must outlive the writer.
  SpoolWriter(SampleRing& ring, std::shared_ptr<SpoolSession> session, SpoolWriterOptions options,
              Callbacks callbacks);
  ~SpoolWriter();
  SpoolWriter(const SpoolWriter&) = delete;
  SpoolWriter& operator=(const SpoolWriter&) = delete;

  /// Writes the rest of the ring, the last chunk and the session's end, and joins the threads. Call after the
  /// last push. Retries a refusing disk for `patience`. Errors: kUnavailable, with the loss. Samples in the
  /// tail are not lost: the session then stays open, and the next `Spool::open` makes its last chunk from the
  /// tail. May be called again.
  Status finish(std::chrono::milliseconds patience);

  /// One pass of the writing thread: takes the ring's samples and writes what is due. Returns when the next
  /// pass is due; kNotDue_ns after the last one, requested by `finish`.
  std::int64_t writePass();
  /// One pass of the syncing thread: syncs if chunks were written since the last pass, or if a retry is due.
  /// Returns when the next pass is due; kNotDue_ns: when chunks are written.
  std::int64_t syncPass();

  [[nodiscard]] SpoolWriterCounts counts() const;
  /// The disk's current trouble, for a person; otherwise empty. A loss remains in it until the end.
  [[nodiscard]] std::string trouble() const;

 private:
  void takeSample(const GestureSample& sample);
  void rememberCuts(const GestureSample& sample, bool wanted);
  void rememberPaths();
  [[nodiscard]] Bytes pathsFrom(std::size_t first) const;
  void writeTail();
  void showPiece();
  void noteLoss();
  void makeChunk();
  void flushPending();
  void noteDisk(const Status& status);
  void runSync();

  SampleRing& ring_;
  std::shared_ptr<SpoolSession> session_;
  SpoolWriterOptions options_;
  TimeSource& time_;
  Callbacks callbacks_;
  Resolution resolution_;
  std::size_t piece_samples_, tail_samples_, chunk_samples_;

  // used only by the writing thread
  std::vector<GestureSample> chunk_, piece_;
  std::size_t in_tail_ = 0;  // how many of chunk_'s samples are in the spool's tail
  Bytes cuts_;               // memory of the cut for chunk_; empty: not yet set
  std::size_t cuts_at_ = 0;  // after this many of chunk_'s samples
  struct PathsAt {
    std::size_t sample = 0;  // of chunk_
    Bytes list;
  };
  std::vector<PathsAt> paths_;  // for chunk_, ascending
  std::size_t path_bytes_ = 0;  // of them
  struct Pending {
    Bytes chunk;
    std::uint64_t samples = 0;
    std::uint64_t in_tail = 0;        // of those samples, the first ones that are in the tail
    std::uint64_t first_missing = 0;  // tick of the first one that is not in the tail
  };
  std::deque<Pending> pending_;  // complete, but refused by the disk so far
  std::size_t pending_bytes_ = 0;
  std::uint64_t seq_ = 0;         // of the chunk that is being filled
  std::int64_t next_try_ns_ = 0;  // for a disk that refused
  std::int64_t piece_began_ns_ = 0, tail_waits_since_ns_ = 0, tail_next_try_ns_ = 0;
  std::uint64_t last_tick_ = 0;
  std::uint64_t ring_dropped_before_;  // by earlier users of the ring
  std::uint64_t lost_ = 0;             // of those taken from the ring
  SpoolLoss loss_noted_;               // as last written to the session
  std::optional<std::uint64_t> lost_from_;

  mutable std::mutex mutex_;  // guards all that follows
  SpoolWriterCounts counts_;
  std::int64_t last_disk_error_ns_ = 0;
  bool sync_wanted_ = false, sync_stop_ = false;
  std::int64_t next_sync_ns_ = 0;  // for a disk that refused to sync
  std::condition_variable sync_wake_;

  std::atomic<bool> finish_{false};
  std::thread writer_, syncer_;
  bool finished_ = false;
  Status outcome_;
};

}  // namespace needlelab
