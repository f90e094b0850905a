/// Live frames: bounded queues of those that wait for a receiver, and a frame on its way through the server.
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

/// Live frames that wait for one receiver: the newest are worth most, so the oldest are dropped and counted.
/// Bounded by age and by bytes. A push never fails and never waits: a slow receiver loses its own oldest
/// frames only. Times are of the steady clock (ns) and come from the caller, so that tests choose them.
/// Thread: one.
class LiveQueue {
 public:
  struct Item {
    Frame frame;
    bool counted = false;  ///< a LiveFrame: its loss is told to the receiver (dropped_for_you)
    std::int64_t pushed_ns = 0;
  };

  LiveQueue(std::int64_t max_age_ns, std::size_t max_bytes)
      : max_age_ns_(max_age_ns), max_bytes_(max_bytes) {}

  void push(Frame frame, bool counted, std::int64_t now_ns);
  /// The oldest frame that is young enough.
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

/// A live frame on its way through the server, passed on as bytes without a message object: its fields as a
/// station fills them. Views into the bytes it was found in.
struct LiveFrameView {
  std::string_view session_id, data;
  std::uint64_t frame_seq = 0;
  std::int64_t due_steady_ns = 0, capture_unix_ns = 0;
};

/// The live frame in the bytes of an Envelope, when they hold just that: each field that stations fill at
/// most once and nothing else. Everything else that Protobuf would take (fields that come twice or that we do
/// not know, a body of another kind) and everything that it would not take gives nothing: then decodeFrame()
/// judges. Safe for any bytes.
std::optional<LiveFrameView> viewLiveFrame(ByteView envelope);
LiveFrameView viewOf(const pb::LiveFrame& frame);

/// The bytes of the Envelope with this frame and `station` (UTF-8) in it: those that Protobuf would write.
/// Nothing when they would be more than kMaxFrameBytes.
Frame encodeLiveFrame(const LiveFrameView& frame, std::string_view station);

}  // namespace needlelab
