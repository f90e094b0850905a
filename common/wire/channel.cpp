
#include "common/wire/channel.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::size_t kBatchBytes = 16u << 10;  // about one TLS record

std::int64_t nsOf(std::chrono::milliseconds time) {
  return std::chrono::nanoseconds(time).count();
}

std::string addressText(Tcp::socket& socket) {
  boost::system::error_code error;
  const auto peer = socket.remote_endpoint(error);
  if (error) return "unknown";
  const std::string address = peer.address().to_string();
  return fmt::format("{}:{}", (peer.address().is_v6() ? "[" + address + "]" : address), peer.port());
}

}  // namespace

const char* nameOf(CloseReason reason) {
  switch (reason) {
    case CloseReason::kNone:
      return "open";
    case CloseReason::kPeerClosed:
      return "peer_closed";
    case CloseReason::kNetwork:
      return "network";
    case CloseReason::kHandshake:
      return "handshake";
    case CloseReason::kIdle:
      return "idle";
    case CloseReason::kWriteTimeout:
      return "write_timeout";
    case CloseReason::kQueueOverflow:
      return "queue_overflow";
    case CloseReason::kProtocol:
      return "protocol";
    case CloseReason::kRefused:
      return "refused";
    case CloseReason::kLocal:
      return "local";
  }
  return "?";
}

std::shared_ptr<Channel> Channel::make(TlsStream stream, ChannelLimits limits) {
  return std::shared_ptr<Channel>(new Channel(stream, limits));
}

Channel::Channel(TlsStream& stream, ChannelLimits limits)
    : socket_(std::move(stream.next_layer())),
      tls_(stream.native_handle()),
      limits_(limits),
      peer_(addressText(socket_)),
      splitter_(limits.frame_bytes),
      live_(nsOf(limits.live_age), limits.live_queue_bytes),
      gather_(socket_.get_executor()),
      watch_(socket_.get_executor()),
      made_ns_(steadyNowNs()),
      last_received_ns_(made_ns_),
      last_sent_ns_(made_ns_) {
  // send small messages at once; unsent bytes wait in our queues, where they can be dropped, and not in the
  // kernel
  boost::system::error_code ignored;
  socket_.native_non_blocking(true, ignored);
  socket_.set_option(Tcp::no_delay(true), ignored);
  if (limits_.socket_buffer_bytes > 0) {
    socket_.set_option(asio::socket_base::send_buffer_size(limits_.socket_buffer_bytes), ignored);
    socket_.set_option(asio::socket_base::receive_buffer_size(limits_.socket_buffer_bytes), ignored);
  }
}

Channel::~Channel() = default;

void Channel::established() {
  established_ = true;
  splitter_.setLimit(kMaxFrameBytes);
}

Result<std::optional<ByteView>> Channel::next() {
  if (closing()) return closedError();
  return splitter_.next();
}

Task<Result<pb::Envelope>> Channel::receive() {
  for (;;) {
    auto cut = next();
    if (!cut.ok()) co_return cut.error();
    if (cut->has_value()) co_return decodeFrame(**cut);
    if (Status more = co_await readMore(); !more.ok()) co_return more.error();
  }
}

bool Channel::send(const pb::Envelope& envelope) {
  auto frame = encodeFrame(envelope);
  if (!frame.ok()) {
    // a message that we cannot send is our fault; the peer would wait in vain, so report it to both sides and
    // close
    pb::Envelope last;
    *last.mutable_refusal() = makeRefusal(pb::Refusal::INTERNAL, frame.error().message, true);
    finish(CloseReason::kLocal, frame.error().message, &last);
    return false;
  }
  return send(std::move(*frame));
}

bool Channel::send(Frame frame) {
  if (closing()) return false;
  if (control_bytes_ + frame->size() > limits_.control_queue_bytes) {
    control_.clear();
    control_bytes_ = 0;
    const std::string text = fmt::format("the control queue would exceed {} bytes: the peer reads too slowly",
                                         limits_.control_queue_bytes);
    pb::Envelope last;
    *last.mutable_refusal() = makeRefusal(pb::Refusal::QUEUE_OVERFLOW, text, true);
    finish(CloseReason::kQueueOverflow, text, &last);
    return false;
  }
  control_bytes_ += frame->size();
  control_.push_back(std::move(frame));
  wakeWriter();
  return true;
}

void Channel::sendLive(Frame frame, bool counted) {
  if (closing()) return;
  const std::int64_t now = steadyNowNs();
  live_.push(std::move(frame), counted, now);
  wakeForLive(now);
}

void Channel::finish(CloseReason reason, std::string text, const pb::Envelope* last) {
  if (closing()) return;
  setReason(reason, std::move(text));
  if (!handshaken_) {
    close(reason, reason_text_);
    return;
  }
  live_.clear();
  if (last != nullptr) {
    if (auto frame = encodeFrame(*last); frame.ok()) control_.push_back(std::move(*frame));
  }
  finishing_ = true;
  finish_started_ns_ = steadyNowNs();
  wakeWriter();
  watch_.cancel();  // its period is now shorter
}

void Channel::close(CloseReason reason, std::string text) {
  if (closed_) return;
  setReason(reason, std::move(text));
  closed_ = true;
  boost::system::error_code ignored;
  socket_.close(ignored);
  control_.clear();
  control_bytes_ = 0;
  live_.clear();
  gather_.cancel();
  watch_.cancel();
}

void Channel::setReason(CloseReason reason, std::string text) {
  if (reason_ != CloseReason::kNone) return;
  reason_ = reason;
  reason_text_ = std::move(text);
}

Error Channel::closedError() const {
  return {ErrorCode::kUnavailable,
          "connection with " + peer_ + " ended (" + nameOf(reason_) + "): " + reason_text_};
}

bool Channel::fillBatch() {
  // release the large buffer of a large message
  if (batch_.capacity() > 4 * kBatchBytes) std::string().swap(batch_);
  batch_.clear();
  while (!control_.empty() && batch_.size() < kBatchBytes) {
    const Frame frame = std::move(control_.front());
    control_.pop_front();
    control_bytes_ -= std::min(control_bytes_, frame->size());
    appendFrameHeader(batch_, frame->size());
    batch_ += *frame;
  }
  if (finishing_) return !batch_.empty();
  const std::int64_t now = steadyNowNs();
  while (batch_.size() < kBatchBytes) {
    const auto item = live_.pop(now);
    if (!item) break;
    std::string suffix;
    if (item->counted && live_.dropped() > 0) suffix = droppedSuffix(live_.dropped());
    if (item->frame->size() + suffix.size() > kMaxFrameBytes) suffix.clear();
    appendFrameHeader(batch_, item->frame->size() + suffix.size());
    batch_ += *item->frame;
    batch_ += suffix;
    live_sent_ns_ = now;
  }
  return !batch_.empty();
}

std::chrono::milliseconds Channel::watchPeriod() const {
  using std::chrono::milliseconds;
  milliseconds shortest = std::min(limits_.idle_timeout, limits_.write_timeout);
  if (limits_.keepalive.count() > 0) shortest = std::min(shortest, limits_.keepalive);
  if (!established_) shortest = std::min(shortest, limits_.handshake_timeout);
  if (finishing_) shortest = std::min(shortest, limits_.close_grace);
  return std::clamp(shortest / 4, milliseconds(5), milliseconds(2500));
}

Task<> Channel::watchLoop(std::shared_ptr<Channel> self) {
  while (!self->closed_) {
    self->watch_.expires_after(self->watchPeriod());
    co_await self->watch_.async_wait(kUseTuple);
    self->checkTimes();
  }
}

void Channel::checkTimes() {
  if (closed_) return;
  const std::int64_t now = steadyNowNs();
  const auto over = [now](std::int64_t since, std::chrono::milliseconds limit) {
    return now - since > nsOf(limit);
  };
  if (finishing_) {
    if (over(finish_started_ns_, limits_.close_grace)) close(reason_, reason_text_);
    return;
  }
  const auto timeOut = [&](CloseReason reason, const std::string& text) {
    pb::Envelope last;
    *last.mutable_refusal() = makeRefusal(pb::Refusal::TIMEOUT, text, true);
    finish(reason, text, &last);
  };
  const auto in_ms = [](std::chrono::milliseconds time) { return fmt::format("{} ms", time.count()); };
  if (!established_ && over(made_ns_, limits_.handshake_timeout)) {
    timeOut(CloseReason::kHandshake, "no log-in within " + in_ms(limits_.handshake_timeout));
  } else if (write_started_ns_ != 0 && over(write_started_ns_, limits_.write_timeout)) {
    close(CloseReason::kWriteTimeout, "the peer read nothing for " + in_ms(limits_.write_timeout));
  } else if (reading_ && over(last_received_ns_, limits_.idle_timeout)) {
    timeOut(CloseReason::kIdle, "nothing received for " + in_ms(limits_.idle_timeout));
  } else if (handshaken_ && limits_.keepalive.count() > 0 && over(last_sent_ns_, limits_.keepalive)) {
    pb::Envelope ping;
    ping.mutable_ping()->set_sender_steady_ns(now);
    send(ping);
  }
}

}  // namespace needlelab
