// A channel's socket: handshake, reading, writing. TLS works in memory (tls.h), so one recv() reads all
// received records, and one send() writes all queued frames.
#include <poll.h>

#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <cerrno>
#include <memory>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/channel.h"

namespace needlelab {
namespace {

constexpr std::size_t kReadBytes = 64u << 10;
constexpr std::size_t kRecordBytes = 17u << 10;  // TLS may keep this much of an unfinished record
constexpr int kTlsHeaderBytes = 5;               // type, version, length (RFC 8446, 5.1)
constexpr std::uint8_t kTlsHandshakeRecord = 22;
constexpr int kWritesInARow = 16;  // then yield to other channels

/// Receive buffer for bytes from the network, which are decrypted at once: one buffer for all channels of a
/// thread.
std::span<std::uint8_t> landing() {
  thread_local const auto bytes = std::make_unique<std::array<std::uint8_t, kReadBytes>>();
  return *bytes;
}

bool isRetryable(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
}

std::string systemErrorText(int error) {
  return boost::system::error_code(error, boost::system::system_category()).message();
}

}  // namespace

Task<Status> Channel::handshake(asio::ssl::stream_base::handshake_type side, std::function<void()> waits) {
  auto self = shared_from_this();
  if (!std::exchange(watching_, true)) asio::co_spawn(socket_.get_executor(), watchLoop(self), rethrow);
  const Status shaken = co_await shake(side == asio::ssl::stream_base::server, waits);
  if (closed_) co_return closedError();
  if (!shaken.ok()) {
    close(CloseReason::kHandshake, shaken.error().message);
    co_return shaken.error();
  }
  times_.handshaken = true;
  times_.last_received_ns = steadyNowNs();
  if (!control_.empty() || !live_.empty() || times_.finishing) wakeWriter();
  co_return Status{};
}

Task<Status> Channel::peerSpoke() {
  auto self = shared_from_this();
  if (!std::exchange(watching_, true)) asio::co_spawn(socket_.get_executor(), watchLoop(self), rethrow);
  // the kernel wakes us when this many bytes have arrived: first the record's header, then the whole record
  const int fd = socket_.native_handle();
  std::array<std::uint8_t, kTlsHeaderBytes> header{};
  int wanted = kTlsHeaderBytes;
  for (int step = 0; step < 2; ++step) {
    ::setsockopt(fd, SOL_SOCKET, SO_RCVLOWAT, &wanted, sizeof wanted);
    auto [error] = co_await socket_.async_wait(Tcp::socket::wait_read, kUseTuple);
    if (closed_) co_return closedError();
    if (error) {
      close(CloseReason::kNetwork, error.message());
      co_return closedError();
    }
    const auto seen = ::recv(fd, header.data(), header.size(), MSG_PEEK | MSG_DONTWAIT);
    // return at once for a peer that has closed or does not speak TLS
    if (seen < kTlsHeaderBytes || header[0] != kTlsHandshakeRecord) break;
    wanted = kTlsHeaderBytes + (header[3] << 8 | header[4]);
  }
  wanted = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_RCVLOWAT, &wanted, sizeof wanted);
  co_return Status{};
}

bool Channel::peerHungUp() {
  pollfd asked{socket_.native_handle(), POLLRDHUP, 0};
  return ::poll(&asked, 1, 0) > 0;
}

Task<Status> Channel::shake(bool as_server, const std::function<void()>& waits) {
  const auto failed = [this](const std::string& why) {
    const bool certificate = SSL_get_verify_result(tls_.ssl()) != X509_V_OK;
    return Error{certificate ? ErrorCode::kDenied : ErrorCode::kUnavailable,
                 "TLS handshake with " + peer_ + " failed: " + tlsErrorText(tls_.ssl(), why)};
  };
  while (!closed_) {
    const TlsStep step = tls_.handshake(as_server);
    // bytes after the handshake must be processed before the next wait
    if (step == TlsStep::kDone) {
      const TlsStep rest = decrypt();
      if (rest == TlsStep::kFailed) co_return failed(tls_.failure());
    }
    // also send the last output: an alert tells the peer the reason
    while (!closed_ && !sendOutput()) {
      if (closed_) break;
      if (waits) waits();
      auto [error] = co_await socket_.async_wait(Tcp::socket::wait_write, kUseTuple);
      if (error) co_return failed(error.message());
    }
    if (closed_ || step == TlsStep::kDone) break;
    if (step == TlsStep::kFailed) co_return failed(tls_.failure());
    if (step == TlsStep::kEnded) co_return failed("the peer closed the connection");
    if (waits) waits();
    auto [error] = co_await socket_.async_wait(Tcp::socket::wait_read, kUseTuple);
    if (closed_) break;
    if (error) co_return failed(error.message());
    const auto room = landing();
    const ssize_t count = ::recv(socket_.native_handle(), room.data(), room.size(), 0);
    if (count == 0) co_return failed("the peer closed the connection");
    if (count < 0 && !isRetryable(errno)) co_return failed(systemErrorText(errno));
    tls_.feed(room.first(static_cast<std::size_t>(std::max<ssize_t>(count, 0))));
  }
  if (closed_) co_return closedError();
  co_return Status{};
}

/// When a peer only sends for a long time, TCP acknowledges each small frame separately, which costs the
/// receiver more than reading it. With this option the kernel waits for one more frame (at most 40 ms). The
/// kernel resets the option, so we set it repeatedly.
void Channel::delayAcks() {
  constexpr unsigned kEvery = 4;
  if (reads_++ % kEvery != 0) return;
  const int off = 0;
  ::setsockopt(socket_.native_handle(), IPPROTO_TCP, TCP_QUICKACK, &off, sizeof off);
}

Task<Status> Channel::readMore() {
  auto self = shared_from_this();
  while (!closing()) {
    // the last turn left records: let other channels have their turns first
    if (tls_.hasInput()) {
      co_await asio::post(socket_.get_executor(), asio::use_awaitable);
      if (closing()) break;
      if (takeRecords()) co_return Status{};
      continue;
    }
    // a peer counts as idle only if it sends nothing while we read; while the owner is busy we do not read
    times_.last_received_ns = steadyNowNs();
    times_.reading = true;
    auto [error] = co_await socket_.async_wait(Tcp::socket::wait_read, kUseTuple);
    times_.reading = false;
    if (closing()) break;
    if (error) {
      close(CloseReason::kNetwork, "reading failed: " + error.message());
      break;
    }
    if (takeBytes()) co_return Status{};
  }
  co_return closedError();
}

/// Call when TLS has no input left. Returns true when new plaintext is available; false: wait again, unless
/// the channel was closed.
bool Channel::takeBytes() {
  // never more than the splitter can take together with the bytes kept by TLS
  const auto room =
      landing().first(std::min(kReadBytes, FrameSplitter::kMostBytes - splitter_.pending() - kRecordBytes));
  const ssize_t count = ::recv(socket_.native_handle(), room.data(), room.size(), 0);
  if (count < 0 && isRetryable(errno)) return false;
  if (count <= 0) {
    const bool ended = count == 0;
    close(ended ? CloseReason::kPeerClosed : CloseReason::kNetwork,
          ended ? "the peer closed the connection" : "reading failed: " + systemErrorText(errno));
    return false;
  }
  delayAcks();
  times_.last_received_ns = steadyNowNs();
  tls_.feed(room.first(static_cast<std::size_t>(count)));
  return takeRecords();
}

/// Decrypts one turn's records; returns as takeBytes().
bool Channel::takeRecords() {
  const std::size_t before = splitter_.pending();
  const TlsStep step = decrypt();
  // TLS may have produced an answer
  if (!tls_.output().empty()) wakeWriter();
  const bool more = splitter_.pending() > before;
  if (step == TlsStep::kFailed) {
    close(CloseReason::kNetwork, "reading failed: " + tls_.failure());
    return false;
  }
  // bytes before the end still count; the next read sees the end again
  if (step == TlsStep::kEnded && !more) close(CloseReason::kPeerClosed, "the peer closed the connection");
  return more;
}

/// Decrypts the input, at most kRecordsATurn records; copies the rest, because all channels share the landing
/// buffer.
TlsStep Channel::decrypt() {
  // one read takes at most one record with data; OpenSSL limits the empty records that precede it
  for (int records = 0; tls_.hasInput(); ++records) {
    if (records == kRecordsATurn) {
      tls_.keepInput();
      break;
    }
    const auto room = splitter_.writable();
    std::size_t count = 0;
    const TlsStep step = tls_.read(room, count);
    if (step != TlsStep::kDone) return step;
    splitter_.wrote(count);
    bytes_received_ += count;
  }
  return TlsStep::kWantsInput;
}

void Channel::wakeWriter() {
  if (flush_posted_ || write_blocked_ || !times_.handshaken || closed_) return;
  flush_posted_ = true;
  // posted after all ready work, so that simultaneous messages are sent together
  asio::post(socket_.get_executor(), [self = shared_from_this()] {
    self->flush_posted_ = false;
    self->flush();
  });
}

void Channel::wakeForLive(std::int64_t now_ns) {
  if (flush_posted_ || gathering_ || write_blocked_) return;
  const auto gather_ns = std::chrono::nanoseconds(limits_.live_gather).count();
  if (now_ns - live_sent_ns_ >= gather_ns) {
    wakeWriter();
    return;
  }
  gathering_ = true;
  gather_.expires_after(std::chrono::nanoseconds(live_sent_ns_ + gather_ns - now_ns));
  gather_.async_wait([self = shared_from_this()](const boost::system::error_code&) {
    self->gathering_ = false;
    self->flush();
  });
}

void Channel::flush() {
  if (write_blocked_ || !times_.handshaken) return;
  for (int writes = 0; !closed_; ++writes) {
    if (!sendOutput()) {
      flushLater();
      return;
    }
    if (closed_ || !fillBatch()) break;
    if (writes == kWritesInARow) {
      // yield to other channels; the batch is already encrypted and is sent first
      wakeWriter();
    }
    bytes_sent_ += batch_.size();
    times_.write_started_ns = steadyNowNs();
    if (tls_.write(batch_) != TlsStep::kDone)
      close(CloseReason::kNetwork, "writing failed: " + tls_.failure());
    // already encrypted: release the large buffer of a large message
    if (batch_.capacity() > 4 * kBatchBytes) std::string().swap(batch_);
    if (writes == kWritesInARow) return;
  }
  if (closed_ || !times_.finishing || std::exchange(discarding_, true)) return;
  asio::co_spawn(socket_.get_executor(), discardUntilPeerCloses(shared_from_this()), rethrow);
}

/// Returns true when nothing is left to send or the channel was closed.
bool Channel::sendOutput() {
  while (!tls_.output().empty()) {
    const std::string_view output = tls_.output();
    const ssize_t count = ::send(socket_.native_handle(), output.data(), output.size(), MSG_NOSIGNAL);
    if (count < 0) {
      if (errno == EINTR) continue;
      if (isRetryable(errno)) return false;
      close(times_.handshaken ? CloseReason::kNetwork : CloseReason::kHandshake,
            "writing failed: " + systemErrorText(errno));
      return true;
    }
    tls_.sent(static_cast<std::size_t>(count));
  }
  being_sent_.clear();
  if (times_.write_started_ns != 0) {
    times_.write_started_ns = 0;
    times_.last_sent_ns = steadyNowNs();
  }
  return true;
}

void Channel::flushLater() {
  write_blocked_ = true;
  socket_.async_wait(Tcp::socket::wait_write,
                     [self = shared_from_this()](const boost::system::error_code& error) {
                       self->write_blocked_ = false;
                       if (error && !self->closed_)
                         self->close(CloseReason::kNetwork, "writing failed: " + error.message());
                       self->flush();
                     });
}

Task<> Channel::discardUntilPeerCloses(std::shared_ptr<Channel> self) {
  // Closing a socket with unread bytes resets the connection, and the peer might never read our last message.
  // So shut down our direction, then read and discard until the peer closes; checkTimes ends this after
  // close_grace.
  Channel& channel = *self;
  boost::system::error_code ignored;
  channel.socket_.shutdown(Tcp::socket::shutdown_send, ignored);
  while (!channel.closed_) {
    const auto nothing = landing();
    const ssize_t count = ::recv(channel.socket_.native_handle(), nothing.data(), nothing.size(), 0);
    if (count > 0) continue;
    if (count == 0 || !isRetryable(errno)) break;
    auto [error] = co_await channel.socket_.async_wait(Tcp::socket::wait_read, kUseTuple);
    if (error) break;
  }
  channel.close(channel.reason_, channel.reason_text_);
}

}  // namespace needlelab
