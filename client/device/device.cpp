#include "client/device/device.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <utility>

#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

constexpr std::int64_t kPause_ns = 50'000'000;

}  // namespace

DeviceMaintenance::DeviceMaintenance(Device& device, TimeSource& time, TurnRunner& threads)
    : device_(device), time_(time), running_(threads.start(*this, {"maintenance", 0})) {}

DeviceMaintenance::~DeviceMaintenance() {
  stop_.store(true);
  running_.reset();
}

std::string DeviceMaintenance::status() const {
  const std::scoped_lock lock(mutex_);
  return status_;
}

std::optional<std::int64_t> DeviceMaintenance::turn() noexcept {
  if (stop_.load()) return std::nullopt;
  device_.maintain();
  std::string status = device_.status();
  {
    const std::scoped_lock lock(mutex_);
    status_ = std::move(status);
  }
  return time_.nowNs() + kPause_ns;
}

namespace {

// Never freed: a handler may read them at any instant. A file descriptor closed and reused meanwhile refuses
// a device's request.
std::atomic<CrashPacketSender> packet_sender{nullptr};
std::atomic<int> packet_file{-1};
std::atomic<pid_t> packet_thread{0};
static_assert(std::atomic<CrashPacketSender>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<pid_t>::is_always_lock_free);

}  // namespace

void registerCrashPacket(CrashPacketSender sender, int file) noexcept {
  unregisterCrashPacket();
  packet_file.store(file);
  packet_thread.store(static_cast<pid_t>(::syscall(SYS_gettid)));
  packet_sender.store(sender);
}

void unregisterCrashPacket() noexcept {
  packet_sender.store(nullptr);
  packet_thread.store(0);
  packet_file.store(-1);
}

pid_t crashPacketThread() noexcept {
  return packet_thread.load();
}

bool sendCrashPacket() noexcept {
  const CrashPacketSender sender = packet_sender.load();
  const int file = packet_file.load();
  return sender != nullptr && file >= 0 && sender(file);
}

Status RehearsedFault::open(double rate_hz) {
  constexpr double kLasts_s = 0.5;
  tick_ = 0;
  begun_ = false;
  from_ = static_cast<std::uint64_t>(std::llround(at_s_ * rate_hz));
  until_ = from_ + static_cast<std::uint64_t>(std::llround(kLasts_s * rate_hz));
  return device_->open(rate_hz);
}

DeviceRead RehearsedFault::read(DeviceReading& reading) noexcept {
  // a device without conditions does not change this field
  if (tick_ == until_) reading.condition &= ~kDeviceTrouble;
  const DeviceRead done = device_->read(reading);
  if (tick_ >= from_ && tick_ < until_) {
    reading.condition |= kDeviceTrouble;
    begun_.store(true, std::memory_order_relaxed);
  }
  ++tick_;
  return done;
}

std::string RehearsedFault::status() {
  std::string text = device_->status();
  if (text.empty() && begun_.load(std::memory_order_relaxed)) text = "a rehearsed fault: the device is well";
  return text;
}

}  // namespace needlelab
