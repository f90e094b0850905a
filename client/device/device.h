/// The interface of every haptic device. To add one, derive from Device, fill DeviceInfo, and add a row to
/// the table in client/device/factory.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/device/turns.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// Where a device's plunger position comes from.
enum class PlungerSource : std::uint8_t {
  kNone,     ///< the device has neither a plunger nor buttons
  kButtons,  ///< the station's plunger moves while a button is pressed
  kAnalog,   ///< `DeviceReading::plunger` is measured (or recorded)
};

/// The button that takes the needle's cap off and puts it on, in a lesson with PALPATION.
inline constexpr int kCapButton = 2;

/// Properties and limits of a device.
struct DeviceInfo {
  std::string name;  ///< for a person, e.g. "simulated Virtuose 6D Desktop, hand 300 N/m"
  DeviceLimits limits;
  bool renders_force = true;  ///< false for a recording: the hand feels nothing
  bool renders_torque = true;
  bool has_orientation = true;  ///< false: `X_WH.q` is not measured (it is the identity)
  double max_rate_hz = 10'000;  ///< highest exchange rate; `open` refuses higher ones
  bool has_dead_man = false;    ///< the device senses whether a hand holds it
  PlungerSource plunger = PlungerSource::kNone;
  /// Delay from a reading to its force, in ticks, if known by construction; none: a station measures it.
  std::optional<double> delay_ticks = {};
};

/// One reading. Poses are of the handle H in W; the tool transform gives the tip.
struct DeviceReading {
  Pose X_WH;
  double speed_mps = 0;         ///< of the handle, as measured by the device; 0 if it does not report one
  double plunger = 0;           ///< 0-1
  std::uint32_t buttons = 0;    ///< bit i: button i pressed
  std::uint32_t condition = 0;  ///< DeviceFlag bits; valid in ticks without a fresh pose, too
};

enum class DeviceRead : std::uint8_t {
  kFresh,     ///< `reading` was filled
  kNoUpdate,  ///< nothing new in this tick; `reading` keeps its pose
  kFinished,  ///< a recording has ended, so the loop ends
};

/// Thread: open and close by the owner off the haptic thread, while no loop runs; read, write and skip by the
/// haptic thread, once a tick each, in that order; maintain and status by one other thread, also while the
/// loop runs. read, write and skip neither allocate, lock nor throw.
class Device {
 public:
  virtual ~Device() = default;
  [[nodiscard]] virtual const DeviceInfo& info() const = 0;
  /// Prepares for a loop of `rate_hz`. Error messages contain advice.
  virtual Status open(double rate_hz) = 0;
  virtual DeviceRead read(DeviceReading& reading) noexcept = 0;
  virtual void write(const GuardedWrench& at_handle_W) noexcept = 0;
  /// The loop missed `ticks` ticks since the last read, without reads and writes. Real devices need nothing;
  /// devices on virtual time (a recording, a simulation) catch up here. Returns how many of the ticks were
  /// before the motion's end: fewer than `ticks` if a recording or a plan ended meanwhile. Real-time safe.
  virtual std::uint64_t skip(std::uint64_t ticks) noexcept { return ticks; }
  /// Called about 20 times a second beside the loop, for slow work such as finding a lost device again.
  /// Meanwhile `read` returns kNoUpdate with kDeviceLost.
  virtual void maintain() {}
  /// Returns the device's state for a person, with advice; empty when all is well.
  [[nodiscard]] virtual std::string status() { return {}; }
  /// Sends zero force, then releases the device. May be called twice.
  virtual void close() noexcept = 0;
};

/// An entry of `--list-devices`: a device, or a way to reach one. Each kind of device has a listing function
/// such as `listFalcons`, which moves nothing and renders no force.
struct FoundDevice {
  std::string spec;    ///< the value for `--device`, e.g. "virtuose:127.0.0.1#53210"
  std::string name;    ///< for a person, e.g. "Virtuose 6D Desktop, library 3.98"
  std::string state;   ///< for a person: its state and, unless it is ready, advice
  bool ready = false;  ///< `--device spec` works now
};

/// Calls Device::maintain and Device::status about 20 times a second on its own thread, so that a slow call
/// delays neither the loop nor a stop. Thread: made and destroyed by one; `status` by any.
class DeviceMaintenance final : private Turns {
 public:
  /// `device` must be open; all arguments outlive this object.
  explicit DeviceMaintenance(Device& device, TimeSource& time = machineTime(),
                             TurnRunner& threads = machineThreads());
  /// Waits for a running `maintain`.
  ~DeviceMaintenance() override;
  DeviceMaintenance(const DeviceMaintenance&) = delete;
  DeviceMaintenance& operator=(const DeviceMaintenance&) = delete;

  /// Returns the device's status from the last poll.
  [[nodiscard]] std::string status() const;

 private:
  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override { time_.sleepUntilNs(until_ns); }

  Device& device_;
  TimeSource& time_;
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::string status_;
  std::unique_ptr<RunningTurns> running_;
};

// --- the packet without force that a device with its own thread sends when the program crashes

/// Sends the zero-force packet to the device behind the open file. Runs in a signal handler, possibly while
/// the device's own thread still runs: async-signal-safe, takes at most about 100 ms. Returns false when the
/// device did not accept the packet.
using CrashPacketSender = bool (*)(int file) noexcept;

/// Registers `sender` and `file` for the packet, and the calling thread as the device's own. Replaces an
/// earlier registration.
void registerCrashPacket(CrashPacketSender sender, int file) noexcept;
/// Call it before closing the file.
void unregisterCrashPacket() noexcept;

/// Returns the thread that registered; 0: none. Async-signal-safe.
[[nodiscard]] pid_t crashPacketThread() noexcept;
/// Returns false when no device is registered, or the device did not accept the packet. Async-signal-safe.
bool sendCrashPacket() noexcept;

/// Like `device`, but reports kDeviceTrouble for half a second from `at_s` on. The fault is the gate's own:
/// the force is removed and returns as after any other.
class RehearsedFault final : public Device {
 public:
  RehearsedFault(std::unique_ptr<Device> device, double at_s) : device_(std::move(device)), at_s_(at_s) {}

  [[nodiscard]] const DeviceInfo& info() const override { return device_->info(); }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override { device_->write(at_handle_W); }
  std::uint64_t skip(std::uint64_t ticks) noexcept override {
    tick_ += ticks;
    return device_->skip(ticks);
  }
  void maintain() override { device_->maintain(); }
  [[nodiscard]] std::string status() override;
  void close() noexcept override { device_->close(); }

 private:
  std::unique_ptr<Device> device_;
  double at_s_;
  std::uint64_t tick_ = 0, from_ = 0, until_ = 0;  // of the haptic thread while the loop runs
  std::atomic<bool> begun_{false};
};

}  // namespace needlelab
