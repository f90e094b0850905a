/// The interface of every haptic device. To add one, derive from Device, fill DeviceInfo, and add a row to
/// the table in client/device/factory.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// Where a device's plunger position comes from.
enum class PlungerSource : std::uint8_t {
  kNone,     ///< it has neither a plunger nor buttons
  kButtons,  ///< the station's plunger moves while a button is pressed
  kAnalog,   ///< `DeviceReading::plunger` is measured (or recorded)
};

/// Properties and limits of a device.
struct DeviceInfo {
  std::string name;  ///< for a person, e.g. "simulated Virtuose 6D Desktop, hand 300 N/m"
  DeviceLimits limits;
  bool renders_force = true;  ///< false for a recording: the hand feels nothing
  bool renders_torque = true;
  bool has_orientation = true;  ///< false: `X_WH.q` is not measured (it is the identity)
  double max_rate_hz = 10'000;  ///< highest rate of exchange; `open` refuses more
  bool has_dead_man = false;    ///< it knows whether a hand holds it
  PlungerSource plunger = PlungerSource::kNone;
};

/// One reading. Poses are of the handle H in W; the tool transform makes the tip of it.
struct DeviceReading {
  Pose X_WH;
  double speed_mps = 0;         ///< of the handle, as the device itself reports it; 0 when it does not
  double plunger = 0;           ///< 0-1
  std::uint32_t buttons = 0;    ///< bit i: button i pressed
  std::uint32_t condition = 0;  ///< DeviceFlag bits; counts in ticks without a fresh pose, too
};

enum class DeviceRead : std::uint8_t {
  kFresh,     ///< `reading` was filled
  kNoUpdate,  ///< the device gave nothing new in this tick; `reading` is as it was
  kFinished,  ///< a recording has ended: the loop ends too
};

/// Thread: open and close by the owner off the haptic thread, while no loop runs; read, write and skip by the
/// haptic thread, once a tick each, in that order; maintain and status by one other thread, also while the
/// loop runs. read, write and skip neither allocate, lock nor throw.
class Device {
 public:
  virtual ~Device() = default;
  [[nodiscard]] virtual const DeviceInfo& info() const = 0;
  /// Prepares for a loop of `rate_hz`. Errors say what to do.
  virtual Status open(double rate_hz) = 0;
  virtual DeviceRead read(DeviceReading& reading) noexcept = 0;
  virtual void write(const GuardedWrench& at_handle_W) noexcept = 0;
  /// The loop missed `ticks` ticks since the last read: no read and no write happened in them. Real devices
  /// go on by themselves; those that live by the tick (a recording, a simulation) catch up here. Real-time
  /// safe.
  virtual void skip(std::uint64_t ticks) noexcept { static_cast<void>(ticks); }
  /// Called about 20 times a second beside the loop, for work that may take long, such as finding a lost
  /// device again. Until it is found `read` returns kNoUpdate with kDeviceLost.
  virtual void maintain() {}
  /// The device's state for a person, with advice; empty when all is well.
  [[nodiscard]] virtual std::string status() { return {}; }
  /// Zero force, then lets go. May be called twice.
  virtual void close() noexcept = 0;
};

/// An entry of `--list-devices`: a device, or a way to reach one. Each kind of device has a function that
/// lists them, such as `listFalcons`; it moves nothing and gives no force.
struct FoundDevice {
  std::string spec;    ///< the value for `--device`, e.g. "virtuose:127.0.0.1#53210"
  std::string name;    ///< for a person, e.g. "Virtuose 6D Desktop, library 3.98"
  std::string state;   ///< for a person: its state and, unless it is ready, advice
  bool ready = false;  ///< `--device spec` would work now
};

/// Calls Device::maintain and Device::status about 20 times a second on a thread of its own, so that a slow
/// one holds up neither the loop nor a stop. Thread: made and destroyed by one; `status` by any.
class DeviceMaintenance {
 public:
  /// `device` is open, and outlives the keeper.
  explicit DeviceMaintenance(Device& device);
  /// Waits for a `maintain` that is under way.
  ~DeviceMaintenance();
  DeviceMaintenance(const DeviceMaintenance&) = delete;
  DeviceMaintenance& operator=(const DeviceMaintenance&) = delete;

  /// The device's status at the last look.
  [[nodiscard]] std::string status() const;

 private:
  void run();

  Device& device_;
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::string status_;
  std::thread thread_;
};

}  // namespace needlelab
