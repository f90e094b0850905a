#include "common/wire/framing.h"

#include <algorithm>
#include <cassert>

namespace needlelab {
namespace {

constexpr std::size_t kFirstBuffer = 16u << 10;  // one TLS record
constexpr std::size_t kKeptBuffer = 64u << 10;   // above, memory is given back when the buffer is empty

}  // namespace

Result<Frame> encodeFrame(const pb::Envelope& envelope) {
  if (envelope.body_case() == pb::Envelope::BODY_NOT_SET) {
    return Error{ErrorCode::kInvalidInput, "cannot send an envelope without a body"};
  }
  const std::size_t size = envelope.ByteSizeLong();
  if (size > kMaxFrameBytes) {
    return Error{ErrorCode::kInvalidInput, "cannot send a message of " + std::to_string(size) +
                                               " bytes: the limit is " + std::to_string(kMaxFrameBytes)};
  }
  auto bytes = std::make_shared<std::string>();
  if (!envelope.SerializeToString(bytes.get())) {
    return Error{ErrorCode::kInvalidInput, "cannot encode the message (text that is not UTF-8?)"};
  }
  return Frame(std::move(bytes));
}

Result<pb::Envelope> decodeFrame(ByteView bytes) {
  pb::Envelope envelope;
  if (bytes.size() > kMaxFrameBytes ||
      !envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return Error{ErrorCode::kCorrupt, "a frame of " + std::to_string(bytes.size()) + " bytes is no Envelope"};
  }
  return envelope;
}

void appendFrameHeader(std::string& out, std::size_t body_bytes) {
  assert(body_bytes > 0 && body_bytes <= kMaxFrameBytes);
  const auto n = static_cast<std::uint32_t>(body_bytes);
  for (const int shift : {24, 16, 8, 0}) out.push_back(static_cast<char>((n >> shift) & 0xff));
}

std::string droppedSuffix(std::uint64_t dropped) {
  pb::LiveFrame count;
  count.set_dropped_for_you(dropped);
  pb::Envelope envelope;
  *envelope.mutable_live_frame() = std::move(count);
  return envelope.SerializeAsString();
}

std::span<std::uint8_t> FrameSplitter::writable() {
  // move what is left to the front, so that the buffer does not creep
  if (begin_ > 0) {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
  }
  if (end_ == 0 && buffer_.size() > kKeptBuffer) {
    buffer_.resize(kFirstBuffer);
    buffer_.shrink_to_fit();
  }
  // grow by what has arrived, never by what was announced
  if (end_ == buffer_.size()) {
    buffer_.resize(std::clamp(buffer_.size() * 2, kFirstBuffer, kMostBytes));
  }
  assert(end_ < buffer_.size());
  return {buffer_.data() + end_, buffer_.size() - end_};
}

void FrameSplitter::wrote(std::size_t count) {
  assert(count <= buffer_.size() - end_);
  end_ += count;
}

Result<std::optional<ByteView>> FrameSplitter::next() {
  if (pending() < kFrameHeaderBytes) return std::optional<ByteView>{};
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < kFrameHeaderBytes; ++i) length = length << 8 | buffer_[begin_ + i];
  if (length == 0)
    return Error{ErrorCode::kInvalidInput, "a frame of length 0: every frame holds one Envelope"};
  if (length > limit_) {
    return Error{ErrorCode::kInvalidInput, "a frame of " + std::to_string(length) + " bytes: the limit is " +
                                               std::to_string(limit_) + " here"};
  }
  if (pending() < kFrameHeaderBytes + length) return std::optional<ByteView>{};
  const ByteView frame{buffer_.data() + begin_ + kFrameHeaderBytes, length};
  begin_ += kFrameHeaderBytes + length;
  return std::optional<ByteView>{frame};
}

}  // namespace needlelab
