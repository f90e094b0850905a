/// A TLS connection that carries envelopes: one reader (the owner's coroutine) and one writer with two
/// bounded queues. In both directions, queued frames share TLS records and system calls.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"
#include "common/wire/live_frames.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

struct ChannelLimits {
  std::size_t frame_bytes = kMaxFrameBytesBeforeLogin;  ///< largest envelope accepted now
  std::size_t control_queue_bytes = 4u << 20;           ///< unsent control bytes; above → QUEUE_OVERFLOW
  std::size_t live_queue_bytes = 1u << 20;
  std::chrono::milliseconds live_age{100};              ///< older live frames are dropped
  std::chrono::milliseconds handshake_timeout{10'000};  ///< from the first byte to `established`
  std::chrono::milliseconds idle_timeout{30'000};       ///< nothing received for this long → TIMEOUT
  std::chrono::milliseconds write_timeout{10'000};      ///< one write takes this long → TIMEOUT
  std::chrono::milliseconds keepalive{10'000};          ///< nothing sent for this long → a Ping; 0: never
  std::chrono::milliseconds close_grace{1'000};         ///< for the last messages; then the socket is closed
  std::chrono::microseconds live_gather{2'000};         ///< live frames within this time are sent together
  int socket_buffer_bytes = 0;                          ///< SO_SNDBUF and SO_RCVBUF; 0: the system's choice
};

/// Why a channel ended.
enum class CloseReason {
  kNone,           ///< still open
  kPeerClosed,     ///< the peer ended the connection
  kNetwork,        ///< the network failed, or TLS did
  kHandshake,      ///< TLS handshake failed or took too long
  kIdle,           ///< nothing received for idle_timeout
  kWriteTimeout,   ///< the peer stopped reading
  kQueueOverflow,  ///< the peer reads its control messages too slowly
  kProtocol,       ///< the peer sent bytes that are not a frame or not an envelope, or too large a frame
  kRefused,        ///< the owner refused the peer (Refusal was sent)
  kLocal,          ///< the owner closed it
};
const char* nameOf(CloseReason reason);

/// The times that a channel's watch checks (steady clock, ns).
struct ChannelTimes {
  std::int64_t made_ns = 0, last_received_ns = 0, last_sent_ns = 0;
  std::int64_t write_started_ns = 0;   ///< 0: no write is under way
  std::int64_t finish_started_ns = 0;  ///< used only while `finishing`
  bool handshaken = false, established = false, reading = false, finishing = false;
};

/// What is due; if several, the first in this order.
enum class ChannelDue { kNothing, kCut, kHandshake, kWriteTimeout, kIdle, kPing };

/// A limit has passed when more than its time has elapsed. Only close_grace applies to a finishing channel.
ChannelDue dueAt(std::int64_t now_ns, const ChannelTimes& times, const ChannelLimits& limits);

/// The period of the watch: a quarter of the shortest limit that now applies, from 5 ms to 2.5 s. A limit is
/// noticed at most this long after it has passed.
std::chrono::milliseconds watchPeriod(const ChannelTimes& times, const ChannelLimits& limits);

/// Thread: all calls on the executor of the stream, which is one thread. Ownership: shared; coroutines keep
/// it alive. Lifecycle: make → handshake → receive / send (greeting, log-in) → established → … → finish or
/// close.
class Channel : public std::enable_shared_from_this<Channel> {
 public:
  /// One turn decrypts at most this many TLS records; then other channels of the thread have their turns.
  static constexpr int kRecordsATurn = 256;

  static std::shared_ptr<Channel> make(TlsStream stream, ChannelLimits limits);
  ~Channel();
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  /// Performs the TLS handshake, then starts the writer and the timeout watch. Call once. Errors:
  /// kUnavailable (network, timeout), kDenied (the peer's certificate); the channel is closed then. `waits`:
  /// called whenever the handshake has computed its next step and waits for the peer.
  Task<Status> handshake(asio::ssl::stream_base::handshake_type side, std::function<void()> waits = {});
  /// Optional, before `handshake`: waits until the peer's first TLS record is complete, bytes that are not
  /// TLS have arrived, or the peer has closed; at most handshake_timeout from the channel's creation. Reads
  /// nothing. Errors: as handshake.
  Task<Status> peerSpoke();
  /// Whether the peer has closed its side of the connection: asks the kernel and reads nothing.
  [[nodiscard]] bool peerHungUp();

  /// Returns the next envelope. Errors: kUnavailable once the channel is closed or closing (the message
  /// contains `closeText()`); kCorrupt or kInvalidInput for bytes that are not a frame: the caller must then
  /// finish or close. One caller at a time.
  Task<Result<pb::Envelope>> receive();

  /// receive() in two steps, for an owner that needs the bytes. next() returns the next complete frame in the
  /// buffer (valid until the next call of any of these functions), nothing when more bytes must be read, or
  /// an error as receive().
  Result<std::optional<ByteView>> next();
  /// Waits until more bytes arrive, from at most kRecordsATurn records. Errors: kUnavailable as receive().
  Task<Status> readMore();

  /// Queues a control message; it is never dropped. Returns false when the channel is closing, or when this
  /// message overflows the queue: then the peer gets Refusal QUEUE_OVERFLOW as its last message, and the
  /// channel closes.
  /// `until_sent` is released when the message was handed to the network or discarded.
  bool send(const pb::Envelope& envelope, std::shared_ptr<const void> until_sent = {});
  bool send(Frame frame, std::shared_ptr<const void> until_sent = {});
  /// Queues a live message; it is dropped when it gets too old. `counted`: the message is a LiveFrame, whose
  /// drops are reported to the receiver.
  void sendLive(Frame frame, bool counted);

  /// Sends the queued messages (and `last`, if any), then closes; cuts the connection after close_grace.
  /// Idempotent: the first reason is kept.
  void finish(CloseReason reason, std::string text, const pb::Envelope* last = nullptr);
  /// As finish, but sends these raw bytes last, for a peer that does not use frames.
  void finishWith(CloseReason reason, std::string text, std::string last);
  /// Returns once the channel is closed. The owner must keep the channel until then.
  Task<> untilClosed();
  /// Cuts the connection now.
  void close(CloseReason reason, std::string text);

  /// Call after log-in: accepts frames up to kMaxFrameBytes, and handshake_timeout no longer applies.
  void established();
  /// Replaces ChannelLimits::idle_timeout.
  void setIdleTimeout(std::chrono::milliseconds time) { limits_.idle_timeout = time; }
  [[nodiscard]] const ChannelLimits& limits() const { return limits_; }

  [[nodiscard]] bool closed() const { return closed_; }  ///< the socket is gone
  [[nodiscard]] bool closing() const { return times_.finishing || closed_; }
  [[nodiscard]] CloseReason closeReason() const { return reason_; }
  [[nodiscard]] const std::string& closeText() const { return reason_text_; }
  [[nodiscard]] const LiveQueue& live() const { return live_; }
  [[nodiscard]] std::size_t controlQueueBytes() const { return control_bytes_; }
  [[nodiscard]] std::uint64_t bytesReceived() const { return bytes_received_; }
  [[nodiscard]] std::uint64_t bytesSent() const { return bytes_sent_; }
  [[nodiscard]] const std::string& peerAddress() const { return peer_; }  ///< "127.0.0.1:40312"
  [[nodiscard]] Tcp::socket::executor_type executor() { return socket_.get_executor(); }
  [[nodiscard]] SSL* ssl() const { return tls_.ssl(); }

 private:
  static constexpr std::size_t kBatchBytes = 16u << 10;  // about one TLS record
  struct Control {
    Frame frame;
    std::shared_ptr<const void> until_sent;
    bool bare = false;  // without a frame's length: for a peer that speaks another protocol
  };

  Channel(TlsStream& stream, ChannelLimits limits);
  // static with a shared pointer by value: the coroutine keeps its channel alive
  static Task<> watchLoop(std::shared_ptr<Channel> self);
  static Task<> discardUntilPeerCloses(std::shared_ptr<Channel> self);
  Task<Status> shake(bool as_server, const std::function<void()>& waits);
  bool takeBytes();
  bool takeRecords();
  void delayAcks();
  TlsStep decrypt();
  void flush();
  bool sendOutput();
  void flushLater();
  bool fillBatch();
  void checkTimes();
  void wakeWriter();
  void wakeForLive(std::int64_t now_ns);
  void setReason(CloseReason reason, std::string text);
  Error closedError() const;

  Tcp::socket socket_;
  TlsEngine tls_;
  ChannelLimits limits_;
  std::string peer_;
  FrameSplitter splitter_;
  LiveQueue live_;
  std::deque<Control> control_;
  std::size_t control_bytes_ = 0;
  std::string batch_;  // the bytes of the current write: many small frames in one TLS record
  std::vector<std::shared_ptr<const void>> being_sent_;  // for the messages in that write
  asio::steady_timer gather_, watch_;
  asio::steady_timer open_;  // never expires; cancelled by close()
  bool watching_ = false, closed_ = false;
  bool flush_posted_ = false, gathering_ = false;  // a flush is scheduled
  bool write_blocked_ = false;                     // the flush waits until the socket accepts more
  bool discarding_ = false;
  CloseReason reason_ = CloseReason::kNone;
  std::string reason_text_;
  ChannelTimes times_;
  std::int64_t live_sent_ns_ = 0;  // when live frames last left
  std::uint64_t bytes_received_ = 0, bytes_sent_ = 0;
  unsigned reads_ = 0;
};

}  // namespace needlelab
