/// A live frame on its way through the server: looked at and passed on as bytes, without a message object.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "common/base/bytes.h"
#include "common/wire/framing.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// A LiveFrame's fields as a station fills them. Views into the bytes it was found in.
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
