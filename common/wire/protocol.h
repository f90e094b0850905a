/// What goes over the wire (proto/README.md): frames, the protocol's version, and refusals.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {

/// The frame of the wire: a 4-byte big-endian length, then so many bytes of one Protobuf Envelope.
inline constexpr std::size_t kFrameHeaderBytes = 4;
inline constexpr std::size_t kMaxFrameBytes = 1u << 20;         ///< an Envelope after log-in
inline constexpr std::size_t kMaxFrameBytesBeforeLogin = 4096;  ///< an Envelope before log-in

/// The bytes of one Envelope, without the length. Immutable, so that one copy serves every receiver.
using Frame = std::shared_ptr<const std::string>;

/// Errors: kInvalidInput when the envelope has no body or more than kMaxFrameBytes.
Result<Frame> encodeFrame(const pb::Envelope& envelope);

/// Errors: kCorrupt when the bytes are not an Envelope. An unknown body (of a newer minor) is not an error:
/// BODY_NOT_SET.
Result<pb::Envelope> decodeFrame(ByteView bytes);

/// Appends the length of a frame of `body_bytes` (at most kMaxFrameBytes, asserted).
void appendFrameHeader(std::string& out, std::size_t body_bytes);

/// Bytes which, put behind an Envelope with a live_frame, set its dropped_for_you: Protobuf merges a message
/// field that comes twice. So all viewers share one encoded frame, and each still hears its own count.
std::string droppedSuffix(std::uint64_t dropped);

/// Cuts a stream of bytes into frames. Bounded: a length is checked against the limit before anything is
/// allocated for it, and memory grows with what arrived, not with what was announced. Use: read into
/// `writable()`, tell `wrote(n)`, take frames with `next()` until there is none.
class FrameSplitter {
 public:
  /// No more can be in it: a whole frame, and what one read brings behind it.
  static constexpr std::size_t kMostBytes = kMaxFrameBytes + (64u << 10);

  explicit FrameSplitter(std::size_t limit) : limit_(limit) {}

  void setLimit(std::size_t limit) { limit_ = limit; }
  [[nodiscard]] std::size_t limit() const { return limit_; }

  /// Room for at least one byte more. Valid until the next call of any member.
  std::span<std::uint8_t> writable();
  void wrote(std::size_t count);

  /// A whole frame's bytes (valid until `writable()`), nothing when more must be read, or an error after
  /// which the stream is lost: kInvalidInput for a length of zero or above the limit.
  Result<std::optional<ByteView>> next();

  /// Bytes that arrived and are not yet taken.
  [[nodiscard]] std::size_t pending() const { return end_ - begin_; }
  [[nodiscard]] std::size_t capacity() const { return buffer_.size(); }

 private:
  std::size_t limit_;
  Bytes buffer_;
  std::size_t begin_ = 0, end_ = 0;
};

/// Peers with different majors refuse each other; a minor adds only what others may ignore.
inline constexpr std::uint32_t kProtocolMajor = 1;
inline constexpr std::uint32_t kProtocolMinor = 2;

pb::Version ourVersion();
std::string versionText(const pb::Version& version);
/// "needlelab-NAME 0.1.0"
std::string programText(const std::string& name);

/// kVersion, naming both, unless the majors are the same.
Status checkVersion(const pb::Version& ours, const pb::Version& theirs);

/// Refusals of the wire and errors of the program, translated both ways.
pb::Refusal makeRefusal(pb::Refusal::Reason reason, std::string text, bool fatal = false);
/// The reason that fits an error: kInvalidInput → INVALID, kNotFound → NOT_FOUND, kDenied → ROLE, others
/// INTERNAL.
pb::Refusal refusalOf(const Error& error);
/// What a peer's refusal means to us; the message names the reason, and both versions where they are given.
Error errorOf(const pb::Refusal& refusal);
/// "LOGIN", "GAP", …
std::string reasonName(pb::Refusal::Reason reason);

/// Silences Protobuf, which otherwise prints a line on standard error for each text that is not UTF-8, that
/// is for each such message of a hostile peer. The code that parsed the message gets an Error anyway. Each
/// program that reads from a network or a database calls it first, before it starts threads.
void keepProtobufQuiet();

}  // namespace needlelab
