#include "net/spool_writer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include "base/clock.h"
#include "gesture/chunk.h"

namespace needlelab {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(4);  // how often the ring is looked into
constexpr std::int64_t kPieceAge_ns = 20'000'000;     // a piece waits no longer for its samples
constexpr double kPiece_s = 0.02;
constexpr double kChunk_s = 1;
constexpr double kMostSamples = 1000;            // a lossless chunk then stays far below an envelope's 1 MiB
constexpr std::int64_t kRetry_ns = 500'000'000;  // between tries on a disk that refused
constexpr std::int64_t kCalm_ns = 400'000'000;   // without errors before the disk is called well

std::size_t samplesIn(double seconds, double rate_hz) {
  return static_cast<std::size_t>(std::clamp(std::round(seconds * rate_hz), 1.0, kMostSamples));
}

}  // namespace

SpoolWriter::SpoolWriter(SampleRing& ring, std::shared_ptr<SpoolSession> session, SpoolWriterOptions options,
                         Callbacks callbacks)
    : ring_(ring),
      session_(std::move(session)),
      options_(options),
      callbacks_(std::move(callbacks)),
      resolution_(resolutionOf(session_->description())),
      piece_samples_(samplesIn(kPiece_s, options.rate_hz)),
      chunk_samples_(samplesIn(kChunk_s, options.rate_hz)),
      seq_(session_->contents().chunks) {
  chunk_.reserve(chunk_samples_);
  piece_.reserve(piece_samples_);
  writer_ = std::thread([this] { run(); });
  syncer_ = std::thread([this] { runSync(); });
}

SpoolWriter::~SpoolWriter() {
  // without `finish` the owner gives up: what is on disk stays for the next start
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

void SpoolWriter::run() {
  GestureSample sample;
  for (;;) {
    // asked before draining: what was pushed before `finish` is then surely seen
    const bool last_round = finish_.load(std::memory_order_acquire);
    while (ring_.pop(sample)) takeSample(sample);
    if (!piece_.empty() && (last_round || steadyNowNs() - piece_began_ns_ >= kPieceAge_ns)) writePiece();
    if (!pending_.empty() && steadyNowNs() >= next_try_ns_) flushPending();
    if (last_round) return;
    std::this_thread::sleep_for(kPoll);
  }
}

void SpoolWriter::takeSample(const GestureSample& sample) {
  if (pending_bytes_ > options_.pending_bytes) {
    // the disk has been full for so long that memory is at its end too: these samples are lost, and said to
    // be
    const std::scoped_lock lock(mutex_);
    ++counts_.samples;
    ++counts_.samples_lost;
    return;
  }
  if (piece_.empty()) piece_began_ns_ = steadyNowNs();
  piece_.push_back(sample);
  chunk_.push_back(sample);
  {
    const std::scoped_lock lock(mutex_);
    ++counts_.samples;
  }
  if (piece_.size() >= piece_samples_ || chunk_.size() >= chunk_samples_) writePiece();
  if (chunk_.size() >= chunk_samples_) makeChunk();
}

void SpoolWriter::writePiece() {
  auto bytes = std::make_shared<const Bytes>(encodeChunk(resolution_, piece_));
  // while chunks wait for the disk, the tail is not asked as well: it would refuse too
  if (pending_.empty()) {
    Status status;
    if (in_tail_ + piece_.size() == chunk_.size()) {
      status = session_->appendPiece(seq_, *bytes);
    } else {
      // earlier pieces of this chunk were refused: they come along now
      const std::span<const GestureSample> missing(chunk_);
      status = session_->appendPiece(seq_, encodeChunk(resolution_, missing.subspan(in_tail_)));
    }
    if (status.ok()) in_tail_ = chunk_.size();
    noteDisk(status);
  }
  SamplePiece piece{std::move(bytes), piece_.back(), 0, 0};
  for (const GestureSample& sample : piece_) piece.flags |= sample.flags;
  piece_.clear();
  {
    const std::scoped_lock lock(mutex_);
    piece.samples_so_far = counts_.samples - counts_.samples_lost;
  }
  if (callbacks_.piece) callbacks_.piece(piece);
}

void SpoolWriter::makeChunk() {
  pending_.push_back({encodeChunk(resolution_, chunk_), chunk_.size()});
  pending_bytes_ += pending_.back().chunk.size();
  ++seq_;
  chunk_.clear();
  in_tail_ = 0;
  {
    const std::scoped_lock lock(mutex_);
    ++counts_.chunks;
    counts_.chunk_bytes += pending_.back().chunk.size();
  }
  if (pending_.size() == 1 || steadyNowNs() >= next_try_ns_) flushPending();
}

// chunks go to disk in order; when the last one is there, the tail begins anew
void SpoolWriter::flushPending() {
  bool wrote = false;
  while (!pending_.empty()) {
    const Status status = session_->appendChunk(pending_.front().chunk, pending_.front().samples);
    noteDisk(status);
    if (!status.ok()) {
      next_try_ns_ = steadyNowNs() + kRetry_ns;
      break;
    }
    pending_bytes_ -= pending_.front().chunk.size();
    pending_.pop_front();
    wrote = true;
  }
  if (pending_.empty()) noteDisk(session_->restartTail());
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
    const std::int64_t now_ns = steadyNowNs();
    if (!status.ok()) {
      ++counts_.disk_errors;
      last_disk_error_ns_ = now_ns;
      if (counts_.disk_error.empty())
        said = "the spool's disk refuses: " + status.error().message +
               "; the lesson goes on, its samples wait in memory. Make room on that disk";
      counts_.disk_error = status.error().message;
    } else if (!counts_.disk_error.empty() && now_ns - last_disk_error_ns_ > kCalm_ns) {
      counts_.disk_error.clear();
      said = "the spool's disk takes samples again";
    }
  }
  if (!said.empty() && callbacks_.trouble) callbacks_.trouble(said);
}

void SpoolWriter::runSync() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      sync_wake_.wait(lock, [this] { return sync_wanted_ || sync_stop_; });
      if (!sync_wanted_ && sync_stop_) return;
      sync_wanted_ = false;
    }
    const Status status = session_->sync();
    if (status.ok()) {
      if (callbacks_.durable) callbacks_.durable();
      continue;
    }
    noteDisk(status);
    std::unique_lock lock(mutex_);
    if (sync_stop_) return;
    // again later; the next chunk asks as well
    sync_wake_.wait_for(lock, std::chrono::nanoseconds(kRetry_ns), [this] { return sync_stop_; });
    sync_wanted_ = true;
  }
}

Status SpoolWriter::finish(std::chrono::milliseconds patience) {
  if (finished_) return outcome_;
  finished_ = true;
  finish_.store(true, std::memory_order_release);
  writer_.join();
  // from here on this thread is the writing one
  if (!chunk_.empty()) makeChunk();
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!pending_.empty() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    flushPending();
  }
  {
    const std::scoped_lock lock(mutex_);
    sync_stop_ = true;
  }
  sync_wake_.notify_all();
  syncer_.join();

  std::uint64_t lost = 0;
  for (const Pending& chunk : pending_) lost += chunk.samples;
  if (lost > 0) {
    const std::scoped_lock lock(mutex_);
    counts_.samples_lost += lost;
    // what was made of them counts no more either
    counts_.chunks -= pending_.size();
    for (const Pending& chunk : pending_) counts_.chunk_bytes -= chunk.chunk.size();
  }
  outcome_ = session_->sync();
  while (!outcome_.ok() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    outcome_ = session_->sync();
  }
  if (outcome_.ok()) outcome_ = session_->end(false);
  if (outcome_.ok()) outcome_ = session_->restartTail();
  if (callbacks_.durable) callbacks_.durable();
  if (outcome_.ok() && counts().samples_lost > 0)
    outcome_ = Error{ErrorCode::kUnavailable, std::to_string(counts().samples_lost) +
                                                  " samples are lost: the spool's disk was full (" +
                                                  counts().disk_error + ")"};
  return outcome_;
}

}  // namespace needlelab
