/// A Falcon without USB: implements FalconLink and FalconBus with a processor that boots, echoes and answers.
/// For tests of the device above the bus; tests/support/falcon_emulator emulates the USB level.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_link.h"
#include "client/device/falcon/firmware_loader.h"
#include "common/base/clock.h"

namespace needlelab::falcon {

using Bytes = std::vector<std::uint8_t>;
using Requests = std::vector<std::array<std::uint16_t, 3>>;

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

  // seen
  int opened = 0, open_links = 0, loads = 0;
  Requests requests;
  Bytes loaded;
  std::vector<Command> commands;
  std::uint64_t arrivals_waited_for = 0;

  [[nodiscard]] Command last() {
    const std::scoped_lock lock(mutex);
    return commands.empty() ? Command{{-1, -1, -1}, 0xFF} : commands.back();
  }
  [[nodiscard]] std::size_t count() {
    const std::scoped_lock lock(mutex);
    return commands.size();
  }
};

/// Replies stand ready at once, in reads of at most 64 bytes with two modem bytes at the head.
class FakeLink final : public FalconLink {
 public:
  explicit FakeLink(std::shared_ptr<FakeFalcon> falcon) : falcon_(std::move(falcon)) {
    const std::scoped_lock lock(falcon_->mutex);
    ++falcon_->opened;
    ++falcon_->open_links;
  }
  ~FakeLink() override {
    const std::scoped_lock lock(falcon_->mutex);
    --falcon_->open_links;
  }

  Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) override {
    const std::scoped_lock lock(falcon_->mutex);
    if (!falcon_->plugged) return gone();
    falcon_->requests.push_back({request, value, index});
    if (request == kFtdiReset && value == kPurgeIn) out_.clear();
    // the reset line: the bootloader waits for its greeting
    if (request == kFtdiModemControl && value == kDtrHigh) falcon_->runs = false, boot_ = Boot::kGreeting;
    return {};
  }

  Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds) override {
    const std::scoped_lock lock(falcon_->mutex);
    if (!falcon_->plugged) return gone();
    hear(bytes);
    return {};
  }

  Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      if (!falcon_->plugged) return gone();
      if (!out_.empty()) return take(buffer);
    }
    // No data: wait at most 2 ms, to keep the test fast.
    std::this_thread::sleep_for(std::min(timeout, std::chrono::milliseconds(2)));
    return std::size_t{0};
  }

  Status startStream(LinkListener& listener) override {
    listener_ = &listener;
    const std::scoped_lock lock(falcon_->mutex);
    return falcon_->plugged ? Status() : Status(gone());
  }

  bool send(const Packet& packet) noexcept override {
    const std::scoped_lock lock(falcon_->mutex);
    if (!falcon_->plugged || sending_) return false;
    hear(packet);
    sending_ = true;
    return true;
  }

  void wait(std::int64_t until_ns) noexcept override {
    for (;;) {
      std::array<std::uint8_t, kUsbPacketBytes> buffer{};
      std::size_t got = 0;
      bool sent = false;
      {
        const std::scoped_lock lock(falcon_->mutex);
        lost_ = !falcon_->plugged;
        if (!lost_) {
          sent = std::exchange(sending_, false);
          if (!out_.empty()) got = take(buffer);
        }
      }
      if (sent) listener_->onSent(true);
      if (got > 0) listener_->onRead(std::span(buffer).first(got), steadyNowNs());
      const std::int64_t left_ns = until_ns - steadyNowNs();
      if (sent || got > 0 || lost_ || left_ns <= 0) return;
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min<std::int64_t>(left_ns, 200'000)));
    }
  }

  [[nodiscard]] bool lost() const noexcept override { return lost_; }
  void stopStream() noexcept override { listener_ = nullptr; }

 private:
  enum class Boot : std::uint8_t { kReset, kGreeting, kCall, kLoad };

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
      f.commands.push_back(command);
      if (f.garbage) {
        const std::string_view nonsense = "<BAA?BAAABAAAAA>";
        out_.insert(out_.end(), nonsense.begin(), nonsense.end());
        return;
      }
      const Packet reply = encodeReport({f.encoder, static_cast<std::uint8_t>(f.homed | f.buttons)});
      out_.insert(out_.end(), reply.begin(), reply.end());
      return;
    }
    const Bytes written(bytes.begin(), bytes.end());
    switch (boot_) {
      case Boot::kReset:
        return;
      case Boot::kGreeting:
        if (written == Bytes{0x0A, 0x43, 0x0D})
          out_.insert(out_.end(), {0x0A, 0x44, 0x2C, 0x0D}), boot_ = Boot::kCall;
        return;
      case Boot::kCall:
        if (written == Bytes{0x41}) out_.push_back(0x41), boot_ = Boot::kLoad, ++f.loads, f.loaded.clear();
        return;
      case Boot::kLoad:
        // zero torque after the last chunk: the firmware starts
        if (written.size() == kPacketBytes && written[0] == '<' && f.starts) {
          f.runs = true;
          hear(bytes);
          return;
        }
        for (const std::uint8_t byte : written) {
          const std::size_t at = f.loaded.size();
          f.loaded.push_back(byte);
          if (f.lost_at_byte == at) f.plugged = false;
          if (f.echo_missing && at >= *f.echo_missing) continue;
          out_.push_back(f.echo_wrong == at ? static_cast<std::uint8_t>(byte ^ 0x10) : byte);
        }
    }
  }

  std::size_t take(std::span<std::uint8_t> buffer) {
    std::size_t used = 0;
    while (used + kModemBytes < buffer.size() && !out_.empty()) {
      if (used % kUsbPacketBytes == 0) buffer[used++] = 0x01, buffer[used++] = 0x60;
      buffer[used++] = out_.front();
      out_.pop_front();
    }
    return used;
  }

  std::shared_ptr<FakeFalcon> falcon_;
  std::deque<std::uint8_t> out_;
  Boot boot_ = Boot::kReset;
  bool sending_ = false, lost_ = false;
  LinkListener* listener_ = nullptr;
};

class FakeBus final : public FalconBus {
 public:
  explicit FakeBus(std::shared_ptr<FakeFalcon> falcon) : falcon_(std::move(falcon)) {}
  Result<std::vector<FoundDevice>> list() override {
    return std::vector<FoundDevice>{{"falcon", "Novint Falcon", "", true}};
  }
  Result<std::unique_ptr<FalconLink>> open(const std::string&) override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      if (falcon_->open_error) return *falcon_->open_error;
      if (!falcon_->plugged)
        return Error{ErrorCode::kNotFound, "no Falcon is plugged in; plug in its USB cable"};
    }
    return std::unique_ptr<FalconLink>(std::make_unique<FakeLink>(falcon_));
  }
  void waitForArrival(std::chrono::milliseconds timeout) noexcept override {
    {
      const std::scoped_lock lock(falcon_->mutex);
      ++falcon_->arrivals_waited_for;
    }
    std::this_thread::sleep_for(std::min(timeout, std::chrono::milliseconds(5)));
  }

 private:
  std::shared_ptr<FakeFalcon> falcon_;
};

}  // namespace needlelab::falcon
