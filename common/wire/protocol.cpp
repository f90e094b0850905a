#include "common/wire/protocol.h"

#include <fmt/core.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"

namespace needlelab {
namespace {

constexpr std::size_t kFirstBuffer = 16u << 10;  // one TLS record
constexpr std::size_t kKeptBuffer = 64u << 10;   // above this, memory is released when the buffer is empty

}  // namespace

Result<Frame> encodeFrame(const pb::Envelope& envelope) {
  if (envelope.body_case() == pb::Envelope::BODY_NOT_SET) {
    return Error{ErrorCode::kInvalidInput, "cannot send an envelope without a body"};
  }
  const std::size_t size = envelope.ByteSizeLong();
  if (size > kMaxFrameBytes) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("cannot send a message of {} bytes: the limit is {}", size, kMaxFrameBytes)};
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
    return Error{ErrorCode::kCorrupt, fmt::format("a frame of {} bytes is not an Envelope", bytes.size())};
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
  // move the remaining bytes to the front, so that the buffer does not grow
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
  // grow with the received bytes, never with the announced length
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

namespace {

/// The message for a length that is the beginning of HTTP: the peer used the wrong port. Empty for other
/// lengths.
std::string otherPortText(std::uint32_t length) {
  const char text[] = {static_cast<char>(length >> 24), static_cast<char>(length >> 16),
                       static_cast<char>(length >> 8), static_cast<char>(length)};
  const std::string_view begin(text, sizeof text);
  if (begin == "HTTP")
    return "this is the port for browsers (usually 7751): stations and programs use the other one (usually "
           "7750)";
  for (const std::string_view method : {"GET ", "HEAD", "POST", "PUT ", "PATC", "DELE", "OPTI", "CONN"})
    if (begin == method) return std::string(kHttpRequestCame);
  return {};
}

}  // namespace

Result<std::optional<ByteView>> FrameSplitter::next() {
  if (pending() < kFrameHeaderBytes) return std::optional<ByteView>{};
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < kFrameHeaderBytes; ++i) length = length << 8 | buffer_[begin_ + i];
  if (length == 0)
    return Error{ErrorCode::kInvalidInput, "a frame of length 0: every frame holds one Envelope"};
  if (length > limit_) {
    if (std::string other = otherPortText(length); !other.empty())
      return Error{ErrorCode::kInvalidInput, std::move(other)};
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("a frame of {} bytes: the limit is {} here", length, limit_)};
  }
  if (pending() < kFrameHeaderBytes + length) return std::optional<ByteView>{};
  const ByteView frame{buffer_.data() + begin_ + kFrameHeaderBytes, length};
  begin_ += kFrameHeaderBytes + length;
  return std::optional<ByteView>{frame};
}

pb::Version ourVersion() {
  pb::Version version;
  version.set_major(kProtocolMajor);
  version.set_minor(kProtocolMinor);
  return version;
}

std::string versionText(const pb::Version& version) {
  return fmt::format("{}.{}", version.major(), version.minor());
}

std::string programText(const std::string& name) {
  return "needlelab-" + name + " " + programVersion();
}

Status checkVersion(const pb::Version& ours, const pb::Version& theirs) {
  if (ours.major() == theirs.major()) return {};
  return Error{ErrorCode::kVersion, "protocol versions do not fit: we speak " + versionText(ours) +
                                        ", the peer " + versionText(theirs) +
                                        "; install the same release on both sides"};
}

pb::Refusal makeRefusal(pb::Refusal::Reason reason, std::string text, bool fatal) {
  pb::Refusal refusal;
  refusal.set_reason(reason);
  // the text may repeat a request of a megabyte, and may wait for a peer that does not read
  if (text.size() > kMaxRefusalBytes) text = printable(text.substr(0, kMaxRefusalBytes)) + " …";
  refusal.set_text(std::move(text));
  refusal.set_fatal(fatal);
  return refusal;
}

void nameSession(pb::Refusal& refusal, std::string_view session_id) {
  if (session_id.size() == Uuid{}.size()) refusal.set_session_id(std::string(session_id));
}

pb::Refusal refusalOf(const Error& error) {
  const auto reason = [&] {
    switch (error.code) {
      case ErrorCode::kInvalidInput:
        return pb::Refusal::INVALID;
      case ErrorCode::kNotFound:
        return pb::Refusal::NOT_FOUND;
      case ErrorCode::kAlreadyExists:
        return pb::Refusal::CONFLICT;
      case ErrorCode::kConflict:
        return pb::Refusal::REVISION_CONFLICT;
      case ErrorCode::kDenied:
        return pb::Refusal::ROLE;
      case ErrorCode::kCode:
        return pb::Refusal::CODE;
      case ErrorCode::kVersion:
        return pb::Refusal::VERSION;
      case ErrorCode::kNoRoom:
        return pb::Refusal::NO_ROOM;
      case ErrorCode::kDeposed:
        return pb::Refusal::DEPOSED;
      case ErrorCode::kUnavailable:
      case ErrorCode::kCorrupt:
      case ErrorCode::kFailed:
        break;
    }
    return pb::Refusal::INTERNAL;
  }();
  auto refusal = makeRefusal(reason, error.message);
  refusal.set_current_revision(error.current_revision);
  return refusal;
}

Error errorOf(const pb::Refusal& refusal) {
  const auto code = [&] {
    switch (refusal.reason()) {
      case pb::Refusal::VERSION:
        return ErrorCode::kVersion;
      case pb::Refusal::LOGIN:
      case pb::Refusal::ROLE:
        return ErrorCode::kDenied;
      case pb::Refusal::CODE:
        return ErrorCode::kCode;
      case pb::Refusal::INVALID:
      case pb::Refusal::TOO_LARGE:
        return ErrorCode::kInvalidInput;
      case pb::Refusal::UNKNOWN_SESSION:
      case pb::Refusal::NOT_FOUND:
        return ErrorCode::kNotFound;
      case pb::Refusal::CONTRADICTION:
      case pb::Refusal::CONFLICT:
        return ErrorCode::kAlreadyExists;
      case pb::Refusal::REVISION_CONFLICT:
        return ErrorCode::kConflict;
      case pb::Refusal::NO_ROOM:
        return ErrorCode::kNoRoom;
      case pb::Refusal::DEPOSED:
        return ErrorCode::kDeposed;
      case pb::Refusal::RATE_LIMITED:
      case pb::Refusal::QUEUE_OVERFLOW:
      case pb::Refusal::TIMEOUT:
      case pb::Refusal::SHUTTING_DOWN:
        return ErrorCode::kUnavailable;
      default:
        return ErrorCode::kFailed;
    }
  }();
  // this text is for the trainee: pass it on unchanged
  if (refusal.reason() == pb::Refusal::CODE) return {code, refusal.text()};
  std::string text = "the peer refused (" + reasonName(refusal.reason()) + "): " + refusal.text();
  if (refusal.reason() == pb::Refusal::VERSION) {
    text += " [peer " + versionText(refusal.ours()) + ", we " + versionText(refusal.theirs()) + "]";
  }
  return {code, std::move(text), refusal.current_revision()};
}

std::string reasonName(pb::Refusal::Reason reason) {
  const std::string& name = pb::Refusal::Reason_Name(reason);
  return name.empty() ? fmt::format("reason {}", static_cast<int>(reason)) : name;
}

void keepProtobufQuiet() {
  google::protobuf::SetLogHandler(nullptr);
}

}  // namespace needlelab
