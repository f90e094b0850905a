#include "tests/support/falcon_emulator/direct_link.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "client/device/falcon/firmware_loader.h"

namespace needlelab::test {
namespace {

constexpr std::int64_t kNothingDue = std::numeric_limits<std::int64_t>::max();

Error gone() {
  return {ErrorCode::kUnavailable, "it was unplugged"};
}

}  // namespace

class DirectBus final : public falcon::FalconBus {
 public:
  DirectBus(std::shared_ptr<DirectFalcon> falcon, TimeSource& time)
      : falcon_(std::move(falcon)), time_(time) {}
  Result<std::vector<FoundDevice>> list() override {
    return std::vector<FoundDevice>{{"falcon", "Novint Falcon", "", true}};
  }
  Result<std::unique_ptr<falcon::FalconLink>> open(const std::string&) override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      falcon_->looks.push_back({time_.nowNs(), falcon_->plugged});
      if (!falcon_->plugged)
        return Error{ErrorCode::kNotFound, "no Falcon is plugged in; plug in its USB cable"};
    }
    return std::unique_ptr<falcon::FalconLink>(std::make_unique<DirectLink>(falcon_, time_));
  }
  /// Returns after 5 ms at the latest, to keep tests in real time fast.
  void waitForArrival(std::int64_t until_ns) noexcept override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      if (std::exchange(falcon_->arrived_, false)) return;
    }
    time_.sleepUntilNs(std::min(until_ns, time_.nowNs() + 5'000'000));
  }

 private:
  std::shared_ptr<DirectFalcon> falcon_;
  TimeSource& time_;
};

std::unique_ptr<falcon::FalconBus> DirectFalcon::bus(std::shared_ptr<DirectFalcon> falcon, TimeSource& time) {
  return std::make_unique<DirectBus>(std::move(falcon), time);
}

void DirectFalcon::unplug() {
  const std::scoped_lock lock(mutex);
  if (std::exchange(plugged, false)) ++times_unplugged_;
}

void DirectFalcon::plugIn() {
  const std::scoped_lock lock(mutex);
  arrived_ = !plugged;
  plugged = true;
}

std::int64_t DirectFalcon::nextEventNs() {
  const std::scoped_lock lock(mutex);
  if (streams != nullptr) return streams->nextEventNs();
  return arrived_ ? 0 : kNothingDue;
}

DirectLink::DirectLink(std::shared_ptr<DirectFalcon> falcon, TimeSource& time)
    : falcon_(std::move(falcon)), time_(time) {
  const std::scoped_lock lock(falcon_->mutex);
  ++falcon_->opened;
  ++falcon_->open_links;
  times_unplugged_ = falcon_->times_unplugged_;
  if (!falcon_->runs()) falcon_->forgetFirmware();
  falcon_->say = [this](std::uint8_t byte, std::int64_t at_ns) {
    if (!out_.empty()) at_ns = std::max(at_ns, out_.back().at_ns);
    out_.push_back({at_ns, byte});
  };
}

DirectLink::~DirectLink() {
  stopStream();
  const std::scoped_lock lock(falcon_->mutex);
  --falcon_->open_links;
}

bool DirectLink::isGone() const {
  return !falcon_->plugged || falcon_->times_unplugged_ != times_unplugged_;
}

Status DirectLink::control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  const std::scoped_lock lock(falcon_->mutex);
  if (isGone()) return gone();
  if (request == falcon::kFtdiReset && value == falcon::kPurgeIn) out_.clear();
  if (falcon_->request(request, value, index)) return {};
  return Error{ErrorCode::kUnavailable, "the chip has no such request"};
}

Status DirectLink::write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds) {
  const std::scoped_lock lock(falcon_->mutex);
  if (isGone()) return gone();
  if (falcon_->on_write) falcon_->on_write();
  falcon_->receive(bytes, time_.nowNs());
  return {};
}

Result<std::size_t> DirectLink::read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) {
  {
    const std::scoped_lock lock(falcon_->mutex);
    if (isGone()) return gone();
    if (const std::size_t got = take(buffer, time_.nowNs()); got > 0) return got;
  }
  // No data: wait at most 2 ms, to keep the test fast.
  time_.sleepForNs(std::min<std::int64_t>(std::chrono::nanoseconds(timeout).count(), 2'000'000));
  return std::size_t{0};
}

Status DirectLink::startStream(falcon::LinkListener& listener) {
  listener_ = &listener;
  const std::scoped_lock lock(falcon_->mutex);
  falcon_->streams = this;
  if (falcon_->on_stream) falcon_->on_stream();
  return isGone() ? Status(gone()) : Status();
}

bool DirectLink::send(const falcon::Packet& packet) noexcept {
  const std::scoped_lock lock(falcon_->mutex);
  if (sending_) ++falcon_->refused;
  if (isGone() || sending_) return false;
  const std::int64_t now_ns = time_.nowNs();
  if (falcon::Command command; falcon_->on_send && decodeCommand(packet, command))
    falcon_->on_send(command, now_ns);
  falcon_->receive(packet, now_ns);
  sending_ = true;
  sent_ns_ = now_ns + falcon_->write_ns;
  return true;
}

void DirectLink::wait(std::int64_t until_ns) noexcept {
  for (;;) {
    const std::int64_t now_ns = time_.nowNs();
    std::array<std::uint8_t, falcon::kUsbPacketBytes> buffer{};
    std::size_t got = 0;
    bool sent = false;
    {
      const std::scoped_lock lock(falcon_->mutex);
      lost_ = lost_ || isGone();
      if (!lost_) {
        sent = sending_ && sent_ns_ <= now_ns;
        if (sent) sending_ = false;
        got = take(buffer, now_ns);
      }
    }
    if (sent) listener_->onSent(true);
    if (got > 0) listener_->onRead(std::span(buffer).first(got), now_ns);
    if (sent || got > 0 || lost_ || until_ns <= now_ns) return;
    // the test may unplug it at any time
    time_.sleepUntilNs(std::min(until_ns, now_ns + 200'000));
  }
}

void DirectLink::stopStream() noexcept {
  listener_ = nullptr;
  const std::scoped_lock lock(falcon_->mutex);
  if (falcon_->streams == this) falcon_->streams = nullptr;
}

std::int64_t DirectLink::nextEventNs() const {
  if (lost_) return kNothingDue;
  if (isGone()) return 0;
  return std::min(sending_ ? sent_ns_ : kNothingDue, out_.empty() ? kNothingDue : out_.front().at_ns);
}

std::size_t DirectLink::take(std::span<std::uint8_t> buffer, std::int64_t now_ns) {
  std::size_t used = 0;
  while (used + falcon::kModemBytes < buffer.size() && !out_.empty() && out_.front().at_ns <= now_ns) {
    if (used % falcon::kUsbPacketBytes == 0) buffer[used++] = 0x01, buffer[used++] = 0x60;
    const std::uint8_t byte = out_.front().byte;
    buffer[used++] = byte;
    out_.pop_front();
    if (listener_ != nullptr && falcon_->on_reply) observe(byte, now_ns);
  }
  return used;
}

void DirectLink::observe(std::uint8_t byte, std::int64_t now_ns) {
  if (byte == '<') answer_.clear();
  answer_.push_back(byte);
  if (byte != '>') return;
  falcon::Packet packet{};
  falcon::Report report;
  const bool is_whole = answer_.size() == packet.size();
  if (is_whole) std::copy(answer_.begin(), answer_.end(), packet.begin());
  const bool is_good = is_whole && decodeReport(packet, report);
  falcon_->on_reply(is_good ? std::optional(report) : std::nullopt, now_ns);
}

}  // namespace needlelab::test
