#include "client/net/spool/spool_writer.h"

#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>
#include <utility>

#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

constexpr std::int64_t kPoll_ns = 4'000'000;       // polling period of the ring
constexpr std::int64_t kPieceAge_ns = 20'000'000;  // longest wait of a live piece for its samples
constexpr double kPiece_s = 0.02;
constexpr std::int64_t kTailAge_ns = 10'000'000;  // longest wait of a sample for the tail
constexpr double kTail_s = 0.01;
constexpr double kChunk_s = 1;
constexpr double kMaxSamples = 1000;  // a lossless chunk then stays far below an envelope's 1 MiB
constexpr std::int64_t kTailRetry_ns = 20'000'000;
constexpr std::int64_t kRetry_ns = 500'000'000;      // between retries on a refusing disk
constexpr std::int64_t kLastRetry_ns = 100'000'000;  // likewise, once the lesson is over
constexpr std::int64_t kCalm_ns = 400'000'000;       // time without errors before the disk counts as working
constexpr int kPriority = 10;                        // SCHED_FIFO; the haptic loop has 80

std::size_t samplesIn(double seconds, double rate_hz) {
  return static_cast<std::size_t>(std::clamp(std::round(seconds * rate_hz), 1.0, kMaxSamples));
}

// without permission the thread keeps its normal priority, which matters only on a busy machine
void preferThisThread() {
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  [[maybe_unused]] const int refused = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters);
}

}  // namespace

SpoolWriter::SpoolWriter(SampleRing& ring, std::shared_ptr<SpoolSession> session, SpoolWriterOptions options,
                         Callbacks callbacks)
    : ring_(ring),
      session_(std::move(session)),
      options_(options),
      time_(*options.time),
      callbacks_(std::move(callbacks)),
      resolution_(resolutionOf(session_->description())),
      piece_samples_(samplesIn(kPiece_s, options.rate_hz)),
      tail_samples_(samplesIn(kTail_s, options.rate_hz)),
      chunk_samples_(samplesIn(kChunk_s, options.rate_hz)),
      seq_(session_->contents().chunks),
      ring_dropped_before_(ring.dropped()) {
  assert(options_.rate_hz > 0 && tail_samples_ > 0 && piece_samples_ > 0);
  chunk_.reserve(chunk_samples_);
  piece_.reserve(piece_samples_);
  if (!options_.threads) return;
  writer_ = std::thread([this] {
    preferThisThread();
    for (std::int64_t due_ns = writePass(); due_ns != kNotDue_ns; due_ns = writePass())
      time_.sleepUntilNs(due_ns);
  });
  syncer_ = std::thread([this] { runSync(); });
}

SpoolWriter::~SpoolWriter() {
  // without `finish` the owner has given up: the data on disk is kept for the next start
  finish_ = true;
  if (writer_.joinable()) writer_.join();
  {
    const std::scoped_lock lock(mutex_);
    sync_stop_ = true;
  }
  sync_wake_.notify_all();
  if (syncer_.joinable()) syncer_.join();
}

SpoolWriterCounts SpoolWriter::counts() const {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

std::int64_t SpoolWriter::writePass() {
  // read before draining, so that all samples pushed before `finish` are seen
  const bool last_pass = finish_.load(std::memory_order_acquire);
  GestureSample sample;
  while (ring_.pop(sample)) takeSample(sample);
  const std::int64_t now_ns = time_.nowNs();
  if (in_tail_ < chunk_.size() && (last_pass || now_ns - tail_waits_since_ns_ >= kTailAge_ns)) writeTail();
  if (!piece_.empty() && (last_pass || now_ns - piece_began_ns_ >= kPieceAge_ns)) showPiece();
  if (!pending_.empty() && now_ns >= next_try_ns_) flushPending();
  noteLoss();
  return last_pass ? kNotDue_ns : time_.nowNs() + kPoll_ns;
}

void SpoolWriter::takeSample(const GestureSample& sample) {
  assert(in_tail_ <= chunk_.size() && chunk_.size() < chunk_samples_ && piece_.size() < piece_samples_);
  last_tick_ = sample.tick;
  if (piece_.empty()) piece_began_ns_ = time_.nowNs();
  piece_.push_back(sample);
  const bool lost = pending_bytes_ > options_.pending_bytes;
  rememberCuts(sample, !lost);
  if (lost) {
    // the disk has been full for so long that memory is full, too: these samples are lost and reported;
    // viewers still see them
    if (!lost_from_) lost_from_ = sample.tick;
    ++lost_;
  } else {
    if (in_tail_ == chunk_.size()) tail_waits_since_ns_ = time_.nowNs();
    rememberPaths();
    chunk_.push_back(sample);
  }
  {
    const std::scoped_lock lock(mutex_);
    ++counts_.samples;
    if (lost) ++counts_.samples_lost;
  }
  if (chunk_.size() - in_tail_ >= tail_samples_ || chunk_.size() >= chunk_samples_) writeTail();
  if (piece_.size() >= piece_samples_) showPiece();
  if (chunk_.size() >= chunk_samples_) makeChunk();
}

// a chunk has the memory after its first sample that has one. Samples dropped by the ring are unknown here,
// so later samples have no memory
void SpoolWriter::rememberCuts(const GestureSample& sample, bool wanted) {
  if (!callbacks_.cut_memory) return;
  Bytes memory = callbacks_.cut_memory(sample, wanted && cuts_.empty());
  if (memory.empty() || ring_.dropped() != ring_dropped_before_) return;
  cuts_ = std::move(memory);
  cuts_at_ = chunk_.size();
}

// before its sample is in chunk_. A chunk takes as many as it has room for; samples dropped by the ring are
// unknown here, so later samples have none
void SpoolWriter::rememberPaths() {
  if (!callbacks_.paths) return;
  Bytes list = callbacks_.paths(chunk_.empty());
  if (list.empty() || ring_.dropped() != ring_dropped_before_) return;
  if (path_bytes_ + list.size() > kMaxPathsBytes) return;
  path_bytes_ += list.size();
  paths_.push_back({chunk_.size(), std::move(list)});
}

// the paths of chunk_'s samples from `first` on
Bytes SpoolWriter::pathsFrom(std::size_t first) const {
  Bytes all;
  for (const PathsAt& paths : paths_)
    if (paths.sample >= first) all.insert(all.end(), paths.list.begin(), paths.list.end());
  return all;
}

// writes the samples that are not in the tail yet; skips the tail while chunks wait for the disk, because it
// would fail too
void SpoolWriter::writeTail() {
  if (!pending_.empty() || in_tail_ == chunk_.size() || time_.nowNs() < tail_next_try_ns_) return;
  assert(in_tail_ < chunk_.size());
  const std::span<const GestureSample> missing(chunk_);
  const ByteView cuts = cuts_at_ >= in_tail_ ? ByteView(cuts_) : ByteView();
  const Status status = session_->appendPiece(
      seq_, encodeChunk(resolution_, missing.subspan(in_tail_), cuts, pathsFrom(in_tail_)));
  if (status.ok())
    in_tail_ = chunk_.size();
  else
    tail_next_try_ns_ = time_.nowNs() + kTailRetry_ns;
  noteDisk(status);
}

// passes the piece unencoded: only the uplink knows whether there are viewers
void SpoolWriter::showPiece() {
  assert(!piece_.empty());
  SamplePiece piece{std::make_shared<const std::vector<GestureSample>>(piece_), piece_.back(), 0, 0, {}, {}};
  for (const GestureSample& sample : piece_) piece.flags |= sample.flags;
  piece_.clear();
  {
    const std::scoped_lock lock(mutex_);
    piece.samples_so_far = counts_.samples;
  }
  if (callbacks_.piece) callbacks_.piece(piece);
}

// writes the loss into the session, so that it survives a crash of this program
void SpoolWriter::noteLoss() {
  assert(ring_.dropped() >= ring_dropped_before_);
  const std::uint64_t dropped = ring_.dropped() - ring_dropped_before_;
  if (dropped > 0 && !lost_from_) lost_from_ = last_tick_ + 1;
  const SpoolLoss loss{lost_ + dropped, lost_from_.value_or(0)};
  if (loss == loss_noted_) return;
  assert(loss.samples > loss_noted_.samples && lost_from_);
  if (loss_noted_.samples == 0 && callbacks_.trouble)
    callbacks_.trouble(
        "samples are LOST from now on: the spool's disk has refused them for longer than memory lasts. The "
        "force continues; make room on that disk");
  loss_noted_ = loss;
  // its space is reserved, so success does not mean that there is space for samples
  if (const Status status = session_->setLoss(loss); !status.ok()) noteDisk(status);
}

void SpoolWriter::makeChunk() {
  assert(!chunk_.empty() && in_tail_ <= chunk_.size());
  pending_.push_back({encodeChunk(resolution_, chunk_, cuts_, pathsFrom(0)), chunk_.size(), in_tail_,
                      in_tail_ < chunk_.size() ? chunk_[in_tail_].tick : chunk_.back().tick + 1});
  pending_bytes_ += pending_.back().chunk.size();
  ++seq_;
  chunk_.clear();
  cuts_.clear();
  paths_.clear();
  path_bytes_ = 0;
  in_tail_ = 0;
  {
    const std::scoped_lock lock(mutex_);
    ++counts_.chunks;
    counts_.chunk_bytes += pending_.back().chunk.size();
    counts_.samples_waiting += pending_.back().samples;
  }
  if (pending_.size() == 1 || time_.nowNs() >= next_try_ns_) flushPending();
}

// writes chunks to disk in order; after the last one, empties the tail
void SpoolWriter::flushPending() {
  bool wrote = false;
  while (!pending_.empty()) {
    const Status status = session_->appendChunk(pending_.front().chunk, pending_.front().samples);
    noteDisk(status);
    if (!status.ok()) {
      next_try_ns_ = time_.nowNs() + kRetry_ns;
      break;
    }
    assert(pending_bytes_ >= pending_.front().chunk.size());
    pending_bytes_ -= pending_.front().chunk.size();
    pending_.pop_front();
    wrote = true;
  }
  assert(pending_.empty() == (pending_bytes_ == 0));
  if (pending_.empty()) noteDisk(session_->restartTail());
  {
    const std::scoped_lock lock(mutex_);
    counts_.samples_waiting = 0;
    for (const Pending& chunk : pending_) counts_.samples_waiting += chunk.samples;
  }
  if (!wrote) return;
  {
    const std::scoped_lock lock(mutex_);
    sync_wanted_ = true;
  }
  sync_wake_.notify_one();
}

void SpoolWriter::noteDisk(const Status& status) {
  std::string said;
  {
    const std::scoped_lock lock(mutex_);
    const std::int64_t now_ns = time_.nowNs();
    if (!status.ok()) {
      ++counts_.disk_errors;
      last_disk_error_ns_ = now_ns;
      if (counts_.disk_error.empty())
        said =
            "the spool's disk refuses: " + status.error().message +
            "; the lesson continues, its samples wait in memory. Make room on that disk, or see whether it "
            "fails";
      counts_.disk_error = status.error().message;
    } else if (!counts_.disk_error.empty() && now_ns - last_disk_error_ns_ > kCalm_ns) {
      counts_.disk_error.clear();
      said = "the spool's disk takes samples again";
    }
  }
  if (!said.empty() && callbacks_.trouble) callbacks_.trouble(said);
}

std::string SpoolWriter::trouble() const {
  const SpoolWriterCounts now = counts();
  std::string text;
  if (!now.disk_error.empty())
    text = fmt::format("the spool's disk refuses ({}), {} samples wait in memory", now.disk_error,
                       now.samples_waiting);
  const std::uint64_t lost = session_->contents().loss.samples;
  if (lost > 0)
    text += fmt::format("{}{} samples are lost, the disk was full", text.empty() ? "" : "; ", lost);
  return text;
}

std::int64_t SpoolWriter::syncPass() {
  {
    const std::scoped_lock lock(mutex_);
    if (!sync_wanted_) return kNotDue_ns;
    if (!sync_stop_ && time_.nowNs() < next_sync_ns_) return next_sync_ns_;
    sync_wanted_ = false;
  }
  const Status status = session_->sync();
  if (status.ok()) {
    if (callbacks_.durable) callbacks_.durable();
    const std::scoped_lock lock(mutex_);
    return sync_wanted_ ? time_.nowNs() : kNotDue_ns;
  }
  noteDisk(status);
  const std::scoped_lock lock(mutex_);
  sync_wanted_ = true;
  next_sync_ns_ = time_.nowNs() + kRetry_ns;
  return next_sync_ns_;
}

void SpoolWriter::runSync() {
  for (bool stop = false; !stop;) {
    const std::int64_t due_ns = syncPass();
    std::unique_lock lock(mutex_);
    time_.waitUntilNs(sync_wake_, lock, due_ns,
                      [this] { return sync_stop_ || (sync_wanted_ && time_.nowNs() >= next_sync_ns_); });
    stop = sync_stop_;
  }
  syncPass();
}

Status SpoolWriter::finish(std::chrono::milliseconds patience) {
  if (finished_) return outcome_;
  finished_ = true;
  finish_.store(true, std::memory_order_release);
  if (writer_.joinable())
    writer_.join();
  else
    writePass();
  // from here on this thread acts as the writing one
  if (!chunk_.empty()) makeChunk();
  const std::int64_t deadline_ns = time_.nowNs() + std::chrono::nanoseconds(patience).count();
  while (!pending_.empty() && time_.nowNs() < deadline_ns) {
    time_.sleepForNs(kLastRetry_ns);
    flushPending();
  }
  {
    const std::scoped_lock lock(mutex_);
    sync_stop_ = true;
  }
  sync_wake_.notify_all();
  if (syncer_.joinable()) syncer_.join();

  std::uint64_t lost = 0;
  for (const Pending& chunk : pending_) lost += chunk.samples - chunk.in_tail;
  if (lost > 0) {
    lost_ += lost;
    lost_from_ = std::min(lost_from_.value_or(UINT64_MAX), pending_.front().first_missing);
    const std::scoped_lock lock(mutex_);
    counts_.samples_lost += lost;
    counts_.samples_waiting = 0;
    assert(counts_.chunks >= pending_.size() && counts_.chunk_bytes >= pending_bytes_);
    // their chunks no longer count either
    counts_.chunks -= pending_.size();
    for (const Pending& chunk : pending_) counts_.chunk_bytes -= chunk.chunk.size();
  }
  noteLoss();
  outcome_ = session_->sync();
  while (!outcome_.ok() && time_.nowNs() < deadline_ns) {
    time_.sleepForNs(kLastRetry_ns);
    outcome_ = session_->sync();
  }
  // the tail keeps the samples of a refused chunk, from which the next start makes a chunk
  const bool tail_is_needed = !pending_.empty() && pending_.front().in_tail > 0;
  if (outcome_.ok() && !tail_is_needed) outcome_ = session_->end(false);
  if (outcome_.ok() && !tail_is_needed) outcome_ = session_->restartTail();
  if (callbacks_.durable) callbacks_.durable();
  if (outcome_.ok() && tail_is_needed && loss_noted_.samples == 0)
    outcome_ = Error{ErrorCode::kUnavailable,
                     "the session could not be ended, the spool's disk is full; its samples are safe"};
  if (outcome_.ok() && loss_noted_.samples > 0)
    outcome_ =
        Error{ErrorCode::kUnavailable, fmt::format("{} samples are lost: the spool's disk was full ({})",
                                                   loss_noted_.samples, counts().disk_error)};
  return outcome_;
}

}  // namespace needlelab
