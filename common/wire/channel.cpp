#include "common/wire/channel.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

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

ChannelDue dueAt(std::int64_t now_ns, const ChannelTimes& times, const ChannelLimits& limits) {
  const auto over = [now_ns](std::int64_t since_ns, std::chrono::milliseconds limit) {
    return now_ns - since_ns > nsOf(limit);
  };
  if (times.finishing)
    return over(times.finish_started_ns, limits.close_grace) ? ChannelDue::kCut : ChannelDue::kNothing;
  if (!times.established && over(times.made_ns, limits.handshake_timeout)) return ChannelDue::kHandshake;
  if (times.write_started_ns != 0 && over(times.write_started_ns, limits.write_timeout))
    return ChannelDue::kWriteTimeout;
  if (times.reading && over(times.last_received_ns, limits.idle_timeout)) return ChannelDue::kIdle;
  if (times.handshaken && limits.keepalive.count() > 0 && over(times.last_sent_ns, limits.keepalive))
    return ChannelDue::kPing;
  return ChannelDue::kNothing;
}

std::chrono::milliseconds watchPeriod(const ChannelTimes& times, const ChannelLimits& limits) {
  using std::chrono::milliseconds;
  milliseconds shortest = std::min(limits.idle_timeout, limits.write_timeout);
  if (limits.keepalive.count() > 0) shortest = std::min(shortest, limits.keepalive);
  if (!times.established) shortest = std::min(shortest, limits.handshake_timeout);
  if (times.finishing) shortest = std::min(shortest, limits.close_grace);
  return std::clamp(shortest / 4, milliseconds(5), milliseconds(2500));
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
      open_(socket_.get_executor(), asio::steady_timer::time_point::max()) {
  times_.made_ns = times_.last_received_ns = times_.last_sent_ns = steadyNowNs();
  // send small messages at once; unsent bytes wait in our queues, where they can be dropped, not in the
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
  times_.established = true;
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

bool Channel::send(const pb::Envelope& envelope, std::shared_ptr<const void> until_sent) {
  auto frame = encodeFrame(envelope);
  if (!frame.ok()) {
    // a message that we cannot send is our fault; the peer would wait in vain, so report it to both sides and
    // close
    pb::Envelope last;
    *last.mutable_refusal() = makeRefusal(pb::Refusal::INTERNAL, frame.error().message, true);
    finish(CloseReason::kLocal, frame.error().message, &last);
    return false;
  }
  return send(std::move(*frame), std::move(until_sent));
}

bool Channel::send(Frame frame, std::shared_ptr<const void> until_sent) {
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
  control_.push_back({std::move(frame), std::move(until_sent), false});
  wakeWriter();
  return true;
}

void Channel::sendLive(Frame frame, bool counted) {
  if (closing()) return;
  const std::int64_t now = steadyNowNs();
  live_.push(std::move(frame), counted, now);
  wakeForLive(now);
}

void Channel::finishWith(CloseReason reason, std::string text, std::string last) {
  if (!closing()) control_.push_back({std::make_shared<const std::string>(std::move(last)), nullptr, true});
  finish(reason, std::move(text));
}

void Channel::finish(CloseReason reason, std::string text, const pb::Envelope* last) {
  if (closing()) return;
  setReason(reason, std::move(text));
  if (!times_.handshaken) {
    close(reason, reason_text_);
    return;
  }
  live_.clear();
  if (last != nullptr) {
    if (auto frame = encodeFrame(*last); frame.ok()) control_.push_back({std::move(*frame), nullptr, false});
  }
  times_.finishing = true;
  times_.finish_started_ns = steadyNowNs();
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
  being_sent_.clear();
  control_bytes_ = 0;
  live_.clear();
  gather_.cancel();
  watch_.cancel();
  open_.cancel();
}

Task<> Channel::untilClosed() {
  while (!closed_) co_await open_.async_wait(kUseTuple);
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
  batch_.clear();
  while (!control_.empty() && batch_.size() < kBatchBytes) {
    const auto [frame, until_sent, bare] = std::move(control_.front());
    control_.pop_front();
    if (until_sent) being_sent_.push_back(until_sent);
    control_bytes_ -= std::min(control_bytes_, frame->size());
    if (!bare) appendFrameHeader(batch_, frame->size());
    batch_ += *frame;
  }
  if (times_.finishing) return !batch_.empty();
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

Task<> Channel::watchLoop(std::shared_ptr<Channel> self) {
  while (!self->closed_) {
    self->watch_.expires_after(watchPeriod(self->times_, self->limits_));
    co_await self->watch_.async_wait(kUseTuple);
    self->checkTimes();
  }
}

void Channel::checkTimes() {
  if (closed_) return;
  const std::int64_t now = steadyNowNs();
  const auto timeOut = [&](CloseReason reason, const std::string& text) {
    pb::Envelope last;
    *last.mutable_refusal() = makeRefusal(pb::Refusal::TIMEOUT, text, true);
    finish(reason, text, &last);
  };
  const auto in_ms = [](std::chrono::milliseconds time) { return fmt::format("{} ms", time.count()); };
  switch (dueAt(now, times_, limits_)) {
    case ChannelDue::kNothing:
      break;
    case ChannelDue::kCut:
      close(reason_, reason_text_);
      break;
    case ChannelDue::kHandshake:
      timeOut(CloseReason::kHandshake, "no log-in within " + in_ms(limits_.handshake_timeout));
      break;
    case ChannelDue::kWriteTimeout:
      close(CloseReason::kWriteTimeout, "the peer read nothing for " + in_ms(limits_.write_timeout));
      break;
    case ChannelDue::kIdle:
      timeOut(CloseReason::kIdle, "nothing received for " + in_ms(limits_.idle_timeout));
      break;
    case ChannelDue::kPing: {
      pb::Envelope ping;
      ping.mutable_ping()->set_sender_steady_ns(now);
      send(ping);
      break;
    }
  }
}

}  // namespace needlelab
