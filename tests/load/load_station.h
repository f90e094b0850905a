/// One load station: generates, encodes and sends samples, keeps them until acknowledged, and reconnects
/// after a loss.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>

#include "client/net/link/server_link.h"
#include "common/base/histogram.h"
#include "common/gesture/chunk.h"
#include "tests/load/gesture_pool.h"
#include "tests/load/load_shared.h"

namespace needlelab::test {

/// Totals of the stations of one thread. Thread: one writes.
struct StationTotals {
  LatencyHistogram late;  ///< the generator's delay: from a frame's due time until it was made
  LatencyHistogram ack;   ///< from the due time of a chunk's last sample to its acknowledgement
  std::uint64_t samples_sent = 0, samples_acked = 0;  ///< each counted once
  std::uint64_t chunks_resent = 0;
  std::uint64_t chunk_bytes = 0;  ///< of the chunks made
  std::uint64_t live_frames = 0, status_lines = 0;
  std::uint64_t connections = 0;
  std::uint64_t unsent_peak = 0;  ///< largest number of unacknowledged chunks at one station

  /// Adds the totals of another thread.
  void add(const StationTotals& other);
};

/// Like the station's uplink (client/net), but in memory, without a spool on disk. Thread: its io_context's.
/// Life: connect(); step() at each frame's time; end() after the last; then close().
class LoadStation {
 public:
  LoadStation(LoadShared& shared, std::size_t index, StationTotals& totals, asio::io_context& io);

  /// Connects and reconnects until the session is closed or stop() is called.
  void connect();

  /// Makes and sends the due frame. Returns false after the last one.
  bool step(std::int64_t now_ns);
  /// Due time of the next frame, which is that of its last sample. Steady clock.
  [[nodiscard]] std::int64_t nextDue_ns() const;
  /// Stops making samples; sends the rest.
  void end();
  /// Allows the session to close once everything is acknowledged.
  void close();
  /// Gives up.
  void stop();
  /// Simulates a network fault on this side.
  void cut();

  [[nodiscard]] bool opened() const { return state_ == State::kOpen || state_ == State::kClosing; }
  /// Since when, by the steady clock, everything made before this connection is acknowledged; 0: it is not.
  [[nodiscard]] std::int64_t whole_ns() const { return whole_ns_; }
  [[nodiscard]] bool watched() const { return watched_; }
  [[nodiscard]] bool closed() const { return state_ == State::kClosed; }
  [[nodiscard]] bool finished() const { return closed() || !trouble_.empty(); }
  [[nodiscard]] std::uint64_t ticks() const { return next_tick_; }  ///< made so far
  /// The reason of an early end, in words.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  /// Why the last connection failed or was lost.
  [[nodiscard]] const std::string& lastError() const { return last_error_; }

 private:
  enum class State { kNew, kOpening, kOpen, kClosing, kClosed };
  struct Chunk {
    std::string bytes;
    std::uint64_t samples = 0;
    std::int64_t due_ns = 0;  // when its last sample is due
    bool sent = false;
  };

  LinkHandlers handlers();
  void onConnected();
  void onAway(const LinkEnd& end);
  void handle(const pb::Envelope& envelope);
  void onRefusal(const pb::Refusal& refusal);
  void committed(std::uint64_t seqs);
  void pump();
  void makeChunk();
  void sendLive(std::uint64_t first, std::uint64_t count);
  void sendStatus();
  [[nodiscard]] pb::Envelope openMessage() const;
  [[nodiscard]] pb::Envelope closeMessage() const;

  LoadShared& shared_;
  StationPlan& plan_;
  StationTotals& totals_;
  StationStream stream_;
  ServerLink link_;
  std::string session_id_;
  State state_ = State::kNew;
  bool watched_ = false, ended_ = false, may_close_ = false;
  std::uint64_t next_tick_ = 0, chunk_tick_ = 0;  // the first tick not yet in a frame, not yet in a chunk
  std::uint64_t frame_seq_ = 0, frames_ = 0;
  std::deque<Chunk> chunks_;                              // unacknowledged
  std::uint64_t committed_ = 0, sent_ = 0, backlog_ = 0;  // backlog_: made before this connection
  std::int64_t whole_ns_ = 0;
  std::uint64_t samples_closed_ = 0;
  SessionHash hash_;
  ClockProbe clock_;
  std::int64_t started_unix_ns_ = 0;
  std::string trouble_, last_error_;
};

}  // namespace needlelab::test
