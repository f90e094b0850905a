/// Live frames: the bounded queue of one receiver, and a frame that the server forwards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>

#include "common/base/bytes.h"
#include "common/wire/protocol.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// The queue of live frames for one receiver. The newest frames matter most, so the queue drops and counts
/// the oldest. Limited by age and by bytes. A push never fails and never waits: a slow receiver loses only
/// its own oldest frames. The caller passes the times (steady clock, ns), so that tests can choose them.
/// Thread: one.
class LiveQueue {
 public:
  struct Item {
    Frame frame;
    bool counted = false;  ///< a LiveFrame: its loss is reported to the receiver (dropped_for_you)
    std::int64_t pushed_ns = 0;
  };

  LiveQueue(std::int64_t max_age_ns, std::size_t max_bytes)
      : max_age_ns_(max_age_ns), max_bytes_(max_bytes) {}

  void push(Frame frame, bool counted, std::int64_t now_ns);
  /// The oldest frame that is still young enough.
  std::optional<Item> pop(std::int64_t now_ns);

  [[nodiscard]] bool empty() const { return items_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Counted frames dropped so far.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Other frames (status lines) dropped so far.
  [[nodiscard]] std::uint64_t droppedStatus() const { return dropped_status_; }
  void clear();

 private:
  void dropOldest();
  void dropOverAged(std::int64_t now_ns);

  std::int64_t max_age_ns_;
  std::size_t max_bytes_;
  std::deque<Item> items_;
  std::size_t bytes_ = 0;
  std::uint64_t dropped_ = 0, dropped_status_ = 0;
};

/// A live frame that the server forwards as bytes, without a message object. Has the fields that a station
/// fills. Views into the bytes of the received envelope.
struct LiveFrameView {
  std::string_view session_id, data, cut_memory, paths;
  std::uint64_t frame_seq = 0;
  std::int64_t due_steady_ns = 0, capture_unix_ns = 0;
};

/// Returns the live frame in an Envelope that contains nothing else, and each station field at most once.
/// Returns nothing for any other bytes, even valid Protobuf (repeated or unknown fields, another body): then
/// decodeFrame() decides. Safe for any bytes.
std::optional<LiveFrameView> viewLiveFrame(ByteView envelope);
LiveFrameView viewOf(const pb::LiveFrame& frame);

/// Returns the bytes of the Envelope with this frame and `station` (UTF-8), identical to Protobuf's output.
/// Returns nothing when they would exceed kMaxFrameBytes.
Frame encodeLiveFrame(const LiveFrameView& frame, std::string_view station);

}  // namespace needlelab
