/// A Falcon without USB: implements FalconLink and FalconBus with a processor that boots, echoes and answers.
/// For tests of the device above the bus, in any time; tests/support/falcon_emulator emulates the USB level.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_link.h"
#include "client/device/falcon/firmware_loader.h"
#include "common/base/time_source.h"

namespace needlelab::falcon {

using Bytes = std::vector<std::uint8_t>;
using Requests = std::vector<std::array<std::uint16_t, 3>>;

/// What becomes of a command on its way and of its answer.
struct Fate {
  bool arrives = true;        ///< the device hears the command
  bool is_answered = true;    ///< and its answer arrives
  bool is_garbled = false;    ///< with a byte that no packet has
  std::int64_t reply_ns = 0;  ///< after the command; answers keep their order
};

struct Look {
  std::int64_t at_ns;
  bool is_found;
};

class FakeLink;

/// The Falcon's state, shared by all links to it and by the test. Thread: any, under its mutex.
struct FakeFalcon {
  std::mutex mutex;
  bool plugged = true;
  bool runs = true;           ///< the firmware is running
  std::uint8_t homed = 0x70;  ///< as in a report
  std::uint8_t buttons = 0;
  std::array<std::int16_t, 3> encoder{};
  bool silent = false;                      ///< answers nothing
  bool garbage = false;                     ///< answers nonsense
  bool starts = true;                       ///< the firmware answers after a load
  std::optional<std::size_t> echo_wrong;    ///< this byte of the firmware comes back changed
  std::optional<std::size_t> echo_missing;  ///< from this byte on nothing comes back
  std::optional<std::size_t> lost_at_byte;  ///< unplugged in mid-load
  std::optional<Error> open_error;
  std::int64_t write_ns = 0;   ///< a write of the stream takes so long
  bool keeps_commands = true;  ///< in `commands`
  std::function<Fate()> fate;  ///< of each command to the running firmware; empty: none is lost

  // for an observer; called under the mutex, may be empty
  std::function<void()> on_stream;                                      ///< a stream begins
  std::function<void(const Command&, std::int64_t now_ns)> on_send;     ///< the host sends, heard or not
  std::function<void(const Command&, std::int64_t now_ns)> on_command;  ///< the device has heard it
  /// The host is about to read an answer of the stream; nothing: one that cannot be read.
  std::function<void(const std::optional<Report>&, std::int64_t now_ns)> on_reply;

  std::function<void()> on_load;  ///< the host writes a part of the firmware

  // seen
  int opened = 0, open_links = 0, loads = 0;
  Requests requests;
  Bytes loaded;
  std::vector<Command> commands;
  std::vector<Look> looks;      ///< when the bus was asked to open it
  FakeLink* streams = nullptr;  ///< the link with a stream
  bool arrived = false;         ///< plugged in since the host last waited for that
  int times_unplugged = 0;      ///< a link from before is lost, however soon it is plugged in again

  void unplug() {
    const std::scoped_lock lock(mutex);
    if (std::exchange(plugged, false)) ++times_unplugged;
  }
  void plugIn() {
    const std::scoped_lock lock(mutex);
    arrived = !plugged;
    plugged = true;
  }
  /// When something will happen that the host's USB thread waits for; the greatest int64: nothing.
  [[nodiscard]] std::int64_t nextEventNs();
  [[nodiscard]] Command last() {
    const std::scoped_lock lock(mutex);
    return commands.empty() ? Command{{-1, -1, -1}, 0xFF} : commands.back();
  }
  [[nodiscard]] std::size_t count() {
    const std::scoped_lock lock(mutex);
    return commands.size();
  }
};

/// Replies stand ready at once unless `fate` says otherwise, in reads of at most 64 bytes with two modem
/// bytes at the head.
class FakeLink final : public FalconLink {
 public:
  explicit FakeLink(std::shared_ptr<FakeFalcon> falcon, TimeSource& time = machineTime())
      : falcon_(std::move(falcon)), time_(time) {
    const std::scoped_lock lock(falcon_->mutex);
    ++falcon_->opened;
    ++falcon_->open_links;
    times_unplugged_ = falcon_->times_unplugged;
  }
  ~FakeLink() override {
    stopStream();
    const std::scoped_lock lock(falcon_->mutex);
    --falcon_->open_links;
  }

  Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) override {
    const std::scoped_lock lock(falcon_->mutex);
    if (isGone()) return gone();
    falcon_->requests.push_back({request, value, index});
    if (request == kFtdiReset && value == kPurgeIn) out_.clear();
    // the reset line: the bootloader waits for its greeting
    if (request == kFtdiModemControl && value == kDtrHigh) falcon_->runs = false, boot_ = Boot::kGreeting;
    return {};
  }

  Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds) override {
    const std::scoped_lock lock(falcon_->mutex);
    if (isGone()) return gone();
    hear(bytes);
    return {};
  }

  Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      if (isGone()) return gone();
      if (const std::size_t got = take(buffer, time_.nowNs()); got > 0) return got;
    }
    // No data: wait at most 2 ms, to keep the test fast.
    time_.sleepForNs(std::min<std::int64_t>(std::chrono::nanoseconds(timeout).count(), 2'000'000));
    return std::size_t{0};
  }

  Status startStream(LinkListener& listener) override {
    listener_ = &listener;
    const std::scoped_lock lock(falcon_->mutex);
    falcon_->streams = this;
    if (falcon_->on_stream) falcon_->on_stream();
    return isGone() ? Status(gone()) : Status();
  }

  bool send(const Packet& packet) noexcept override {
    const std::scoped_lock lock(falcon_->mutex);
    if (isGone() || sending_) return false;
    const std::int64_t now_ns = time_.nowNs();
    if (Command command; falcon_->on_send && decodeCommand(packet, command))
      falcon_->on_send(command, now_ns);
    hear(packet);
    sending_ = true;
    sent_ns_ = now_ns + falcon_->write_ns;
    return true;
  }

  void wait(std::int64_t until_ns) noexcept override {
    for (;;) {
      const std::int64_t now_ns = time_.nowNs();
      std::array<std::uint8_t, kUsbPacketBytes> buffer{};
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

  [[nodiscard]] bool lost() const noexcept override { return lost_; }
  void stopStream() noexcept override {
    listener_ = nullptr;
    const std::scoped_lock lock(falcon_->mutex);
    if (falcon_->streams == this) falcon_->streams = nullptr;
  }
  /// As FakeFalcon::nextEventNs; the caller holds the mutex.
  [[nodiscard]] std::int64_t nextEventNs() const {
    if (lost_) return std::numeric_limits<std::int64_t>::max();
    if (isGone()) return 0;
    return std::min(sending_ ? sent_ns_ : std::numeric_limits<std::int64_t>::max(),
                    out_.empty() ? std::numeric_limits<std::int64_t>::max() : out_.front().at_ns);
  }

 private:
  enum class Boot : std::uint8_t { kReset, kGreeting, kCall, kLoad };

  [[nodiscard]] bool isGone() const {
    return !falcon_->plugged || falcon_->times_unplugged != times_unplugged_;
  }
  static Error gone() { return {ErrorCode::kUnavailable, "it was unplugged"}; }

  // The caller of this and of the next function holds the mutex.
  void hear(std::span<const std::uint8_t> bytes) {
    FakeFalcon& f = *falcon_;
    if (f.silent) return;
    if (f.runs) {
      Packet packet{};
      if (bytes.size() != kPacketBytes) return;
      std::copy(bytes.begin(), bytes.end(), packet.begin());
      Command command;
      if (!decodeCommand(packet, command)) return;
      const Fate fate = f.fate ? f.fate() : Fate{};
      if (!fate.arrives) return;
      if (f.keeps_commands) f.commands.push_back(command);
      if (f.on_command) f.on_command(command, time_.nowNs());
      if (!fate.is_answered) return;
      const std::int64_t at_ns = time_.nowNs() + fate.reply_ns;
      if (f.garbage || fate.is_garbled) {
        say(std::string_view("<BAA?BAAABAAAAA>"), at_ns);
        return;
      }
      say(encodeReport({f.encoder, static_cast<std::uint8_t>(f.homed | f.buttons)}), at_ns);
      return;
    }
    const Bytes written(bytes.begin(), bytes.end());
    switch (boot_) {
      case Boot::kReset:
        return;
      case Boot::kGreeting:
        if (written == Bytes{0x0A, 0x43, 0x0D}) say(Bytes{0x0A, 0x44, 0x2C, 0x0D}), boot_ = Boot::kCall;
        return;
      case Boot::kCall:
        if (written == Bytes{0x41}) say(Bytes{0x41}), boot_ = Boot::kLoad, ++f.loads, f.loaded.clear();
        return;
      case Boot::kLoad:
        // zero torque after the last chunk: the firmware starts
        if (written.size() == kPacketBytes && written[0] == '<' && f.starts) {
          f.runs = true;
          hear(bytes);
          return;
        }
        if (f.on_load) f.on_load();
        for (const std::uint8_t byte : written) {
          const std::size_t at = f.loaded.size();
          f.loaded.push_back(byte);
          if (f.lost_at_byte == at) f.plugged = false;
          if (f.echo_missing && at >= *f.echo_missing) continue;
          say(Bytes{f.echo_wrong == at ? static_cast<std::uint8_t>(byte ^ 0x10) : byte});
        }
    }
  }

  struct Said {
    std::int64_t at_ns;
    std::uint8_t byte;
  };

  template <typename Bytes>
  void say(const Bytes& bytes, std::int64_t at_ns = 0) {
    if (!out_.empty()) at_ns = std::max(at_ns, out_.back().at_ns);
    for (const auto byte : bytes) out_.push_back({at_ns, static_cast<std::uint8_t>(byte)});
  }

  std::size_t take(std::span<std::uint8_t> buffer, std::int64_t now_ns) {
    std::size_t used = 0;
    while (used + kModemBytes < buffer.size() && !out_.empty() && out_.front().at_ns <= now_ns) {
      if (used % kUsbPacketBytes == 0) buffer[used++] = 0x01, buffer[used++] = 0x60;
      const std::uint8_t byte = out_.front().byte;
      buffer[used++] = byte;
      out_.pop_front();
      if (listener_ != nullptr && falcon_->on_reply) observe(byte, now_ns);
    }
    return used;
  }

  void observe(std::uint8_t byte, std::int64_t now_ns) {
    if (byte == '<') answer_.clear();
    answer_.push_back(byte);
    if (byte != '>') return;
    Packet packet{};
    Report report;
    const bool is_whole = answer_.size() == kPacketBytes;
    if (is_whole) std::copy(answer_.begin(), answer_.end(), packet.begin());
    const bool is_good = is_whole && decodeReport(packet, report);
    falcon_->on_reply(is_good ? std::optional(report) : std::nullopt, now_ns);
  }

  std::shared_ptr<FakeFalcon> falcon_;
  TimeSource& time_;
  std::deque<Said> out_;
  Bytes answer_;  // so far
  Boot boot_ = Boot::kReset;
  bool sending_ = false, lost_ = false;
  std::int64_t sent_ns_ = 0;
  int times_unplugged_ = 0;
  LinkListener* listener_ = nullptr;
};

inline std::int64_t FakeFalcon::nextEventNs() {
  const std::scoped_lock lock(mutex);
  if (streams != nullptr) return streams->nextEventNs();
  return arrived ? 0 : std::numeric_limits<std::int64_t>::max();
}

class FakeBus final : public FalconBus {
 public:
  explicit FakeBus(std::shared_ptr<FakeFalcon> falcon, TimeSource& time = machineTime())
      : falcon_(std::move(falcon)), time_(time) {}
  Result<std::vector<FoundDevice>> list() override {
    return std::vector<FoundDevice>{{"falcon", "Novint Falcon", "", true}};
  }
  Result<std::unique_ptr<FalconLink>> open(const std::string&) override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      falcon_->looks.push_back({time_.nowNs(), falcon_->plugged});
      if (falcon_->open_error) return *falcon_->open_error;
      if (!falcon_->plugged)
        return Error{ErrorCode::kNotFound, "no Falcon is plugged in; plug in its USB cable"};
    }
    return std::unique_ptr<FalconLink>(std::make_unique<FakeLink>(falcon_, time_));
  }
  /// Returns at the latest after 5 ms, to keep tests in real time fast.
  void waitForArrival(std::int64_t until_ns) noexcept override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      if (std::exchange(falcon_->arrived, false)) return;
    }
    time_.sleepUntilNs(std::min(until_ns, time_.nowNs() + 5'000'000));
  }

 private:
  std::shared_ptr<FakeFalcon> falcon_;
  TimeSource& time_;
};

}  // namespace needlelab::falcon
