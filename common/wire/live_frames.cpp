#include "common/wire/live_frames.h"

#include <bit>
#include <cstring>
#include <memory>

#include "common/wire/wire_reader.h"

namespace needlelab {
namespace {

// Protobuf's wire format: a field begins with its number and its wire type
constexpr std::uint8_t kVarint = 0, kBytes = 2;
constexpr std::uint8_t tag(int number, std::uint8_t kind) {
  return static_cast<std::uint8_t>(number << 3 | kind);
}
constexpr std::uint8_t kEnvelopeLiveFrame = tag(3, kBytes);
constexpr std::uint8_t kStation = tag(1, kBytes), kSession = tag(2, kBytes), kSeq = tag(3, kVarint),
                       kData = tag(4, kBytes), kDue = tag(5, kVarint), kCapture = tag(6, kVarint),
                       kCuts = tag(8, kBytes), kPaths = tag(9, kBytes);
static_assert(pb::LiveFrame::kStationFieldNumber == 1 && pb::LiveFrame::kSessionIdFieldNumber == 2 &&
              pb::LiveFrame::kFrameSeqFieldNumber == 3 && pb::LiveFrame::kDataFieldNumber == 4 &&
              pb::LiveFrame::kDueSteadyNsFieldNumber == 5 && pb::LiveFrame::kCaptureUnixNsFieldNumber == 6 &&
              pb::LiveFrame::kCutMemoryFieldNumber == 8 && pb::LiveFrame::kPathsFieldNumber == 9);

std::size_t varintBytes(std::uint64_t value) {
  return (static_cast<std::size_t>(std::bit_width(value | 1)) + 6) / 7;
}

// fields with their default value are not written
std::size_t sizeOf(std::uint64_t value) {
  return value == 0 ? 0 : 1 + varintBytes(value);
}
std::size_t sizeOf(std::string_view value) {
  return value.empty() ? 0 : 1 + varintBytes(value.size()) + value.size();
}

char* put(char* at, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) *at++ = static_cast<char>(value | 0x80);
  *at++ = static_cast<char>(value);
  return at;
}
char* putField(char* at, std::uint8_t tag, std::uint64_t value) {
  if (value == 0) return at;
  *at++ = static_cast<char>(tag);
  return put(at, value);
}
char* putField(char* at, std::uint8_t tag, std::string_view value) {
  if (value.empty()) return at;
  *at++ = static_cast<char>(tag);
  at = put(at, value.size());
  std::memcpy(at, value.data(), value.size());
  return at + value.size();
}

}  // namespace

std::optional<LiveFrameView> viewLiveFrame(ByteView envelope) {
  WireReader outer(textOf(envelope));
  std::uint8_t found = 0;
  std::string_view body;
  if (!outer.byte(found) || found != kEnvelopeLiveFrame || !outer.bytes(body) || !outer.atEnd()) return {};

  LiveFrameView frame;
  unsigned seen = 0;
  for (WireReader fields(body); !fields.atEnd();) {
    if (!fields.byte(found)) return {};
    const unsigned bit = 1u << (found >> 3 & 31);
    if ((seen & bit) != 0) return {};
    seen |= bit;
    std::uint64_t number = 0;
    switch (found) {
      case kSession:
        if (!fields.bytes(frame.session_id)) return {};
        break;
      case kData:
        if (!fields.bytes(frame.data)) return {};
        break;
      case kSeq:
        if (!fields.varint(frame.frame_seq)) return {};
        break;
      case kDue:
        if (!fields.varint(number)) return {};
        frame.due_steady_ns = static_cast<std::int64_t>(number);
        break;
      case kCapture:
        if (!fields.varint(number)) return {};
        frame.capture_unix_ns = static_cast<std::int64_t>(number);
        break;
      case kCuts:
        if (!fields.bytes(frame.cut_memory)) return {};
        break;
      case kPaths:
        if (!fields.bytes(frame.paths)) return {};
        break;
      default:
        return {};
    }
  }
  return frame;
}

LiveFrameView viewOf(const pb::LiveFrame& frame) {
  return {frame.session_id(), frame.data(),          frame.cut_memory(),     frame.paths(),
          frame.frame_seq(),  frame.due_steady_ns(), frame.capture_unix_ns()};
}

Frame encodeLiveFrame(const LiveFrameView& frame, std::string_view station) {
  const auto due = static_cast<std::uint64_t>(frame.due_steady_ns);
  const auto capture = static_cast<std::uint64_t>(frame.capture_unix_ns);
  const std::size_t body = sizeOf(station) + sizeOf(frame.session_id) + sizeOf(frame.frame_seq) +
                           sizeOf(frame.data) + sizeOf(due) + sizeOf(capture) + sizeOf(frame.cut_memory) +
                           sizeOf(frame.paths);
  const std::size_t whole = 1 + varintBytes(body) + body;
  if (whole > kMaxFrameBytes) return nullptr;
  auto bytes = std::make_shared<std::string>(whole, '\0');
  char* at = bytes->data();
  *at++ = static_cast<char>(kEnvelopeLiveFrame);
  at = put(at, body);
  at = putField(at, kStation, station);
  at = putField(at, kSession, frame.session_id);
  at = putField(at, kSeq, frame.frame_seq);
  at = putField(at, kData, frame.data);
  at = putField(at, kDue, due);
  at = putField(at, kCapture, capture);
  at = putField(at, kCuts, frame.cut_memory);
  putField(at, kPaths, frame.paths);
  return bytes;
}

void LiveQueue::push(Frame frame, bool counted, std::int64_t now_ns) {
  dropOverAged(now_ns);
  bytes_ += frame->size();
  items_.push_back({std::move(frame), counted, now_ns});
  // the newest frame stays, even if it alone exceeds the limit
  while (bytes_ > max_bytes_ && items_.size() > 1) dropOldest();
}

std::optional<LiveQueue::Item> LiveQueue::pop(std::int64_t now_ns) {
  dropOverAged(now_ns);
  if (items_.empty()) return std::nullopt;
  Item item = std::move(items_.front());
  items_.pop_front();
  bytes_ -= item.frame->size();
  return item;
}

void LiveQueue::clear() {
  items_.clear();
  bytes_ = 0;
}

void LiveQueue::dropOldest() {
  const Item& oldest = items_.front();
  ++(oldest.counted ? dropped_ : dropped_status_);
  bytes_ -= oldest.frame->size();
  items_.pop_front();
}

void LiveQueue::dropOverAged(std::int64_t now_ns) {
  while (!items_.empty() && now_ns - items_.front().pushed_ns > max_age_ns_) dropOldest();
}

}  // namespace needlelab
