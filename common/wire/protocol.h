/// The wire protocol (proto/README.md): frames, version, and refusals.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {

/// A frame is a 4-byte big-endian length, followed by one Protobuf Envelope of that length.
inline constexpr std::size_t kFrameHeaderBytes = 4;
inline constexpr std::size_t kMaxFrameBytes = 1u << 20;         ///< an Envelope after log-in
inline constexpr std::size_t kMaxFrameBytesBeforeLogin = 4096;  ///< an Envelope before log-in

/// The bytes of one Envelope, without the length. Immutable, so that all receivers can share one copy.
using Frame = std::shared_ptr<const std::string>;

/// Errors: kInvalidInput when the envelope has no body or more than kMaxFrameBytes.
Result<Frame> encodeFrame(const pb::Envelope& envelope);

/// Errors: kCorrupt when the bytes are not an Envelope. An unknown body (from a newer minor version) is not
/// an error: the body is BODY_NOT_SET.
Result<pb::Envelope> decodeFrame(ByteView bytes);

/// Appends the length of a frame of `body_bytes` (at most kMaxFrameBytes, asserted).
void appendFrameHeader(std::string& out, std::size_t body_bytes);

/// Returns bytes that set dropped_for_you when they are appended to an Envelope with a live_frame: Protobuf
/// merges a message field that occurs twice. All viewers can thus share one encoded frame and still get their
/// own counts.
std::string droppedSuffix(std::uint64_t dropped);

/// FrameSplitter's error text for an HTTP request.
inline constexpr std::string_view kHttpRequestCame =
    "a browser or another HTTP client used the port for stations and programs: the console uses the other "
    "one (usually 7751)";

/// Splits a stream of bytes into frames. Bounded: checks a length against the limit before it allocates, and
/// memory grows with the bytes received, not with the announced length. Use: read into `writable()`, call
/// `wrote(n)`, take frames with `next()` until it returns none.
class FrameSplitter {
 public:
  /// The buffer's maximum size: a complete frame and the rest of one read.
  static constexpr std::size_t kMostBytes = kMaxFrameBytes + (64u << 10);

  explicit FrameSplitter(std::size_t limit) : limit_(limit) {}

  void setLimit(std::size_t limit) { limit_ = limit; }
  [[nodiscard]] std::size_t limit() const { return limit_; }

  /// Returns free space for at least one byte. Valid until the next call of any member.
  std::span<std::uint8_t> writable();
  void wrote(std::size_t count);

  /// Returns the bytes of a complete frame (valid until `writable()`), nothing when more bytes must be read,
  /// or an error, after which the stream is unusable: kInvalidInput for a length of zero or above the limit.
  Result<std::optional<ByteView>> next();

  /// Bytes received but not yet taken.
  [[nodiscard]] std::size_t pending() const { return end_ - begin_; }
  [[nodiscard]] std::size_t capacity() const { return buffer_.size(); }

 private:
  std::size_t limit_;
  Bytes buffer_;
  std::size_t begin_ = 0, end_ = 0;
};

/// Peers with different major versions refuse each other; a minor version adds only features that others may
/// ignore.
inline constexpr std::uint32_t kProtocolMajor = 1;
inline constexpr std::uint32_t kProtocolMinor = 0;

pb::Version ourVersion();
std::string versionText(const pb::Version& version);
/// "needlelab-NAME 0.1.0"
std::string programText(const std::string& name);

/// Error kVersion, with both versions, unless the major versions are equal.
Status checkVersion(const pb::Version& ours, const pb::Version& theirs);

/// The maximum length of a refusal's text; longer texts are cut off.
inline constexpr std::size_t kMaxRefusalBytes = 1000;
/// Translates refusals into errors and errors into refusals.
pb::Refusal makeRefusal(pb::Refusal::Reason reason, std::string text, bool fatal = false);
/// Names the session that a refusal is about, so that the peer finds its message. Only 16 bytes are an id;
/// anything else, possibly a megabyte, is not repeated.
void nameSession(pb::Refusal& refusal, std::string_view session_id);
/// Returns the reason for an error: kInvalidInput → INVALID, kNotFound → NOT_FOUND, kDenied → ROLE,
/// kCode → CODE, kNoRoom → NO_ROOM …, all others → INTERNAL.
pb::Refusal refusalOf(const Error& error);
/// Returns the error for a peer's refusal; the message names the reason, and both versions if the refusal has
/// them. For CODE it is just the peer's text.
Error errorOf(const pb::Refusal& refusal);
/// "LOGIN", "GAP", …
std::string reasonName(pb::Refusal::Reason reason);

/// Silences Protobuf's log: it prints a line on standard error for each text that is not UTF-8, so a hostile
/// peer could flood it. The caller that parsed the message still gets an Error. Every program that reads from
/// a network or a database calls this first, before it starts threads.
void keepProtobufQuiet();

}  // namespace needlelab
