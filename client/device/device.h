/// A haptic device, behind the same small interface whatever it is. To write your own: derive, fill
/// DeviceInfo, done.
#pragma once

#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// How a device tells where the syringe's plunger is.
enum class PlungerSource : std::uint8_t {
  kNone,     ///< it has neither a plunger nor buttons
  kButtons,  ///< the station's plunger moves while a button is pressed
  kAnalog,   ///< `DeviceReading::plunger` is measured (or recorded)
};

/// What a device is, as data.
struct DeviceInfo {
  std::string name;  ///< for a person, e.g. "simulated Virtuose 6D Desktop, hand 300 N/m"
  DeviceLimits limits;
  bool renders_force = true;  ///< false for a recording: the hand feels nothing
  bool renders_torque = true;
  bool has_orientation = true;  ///< false: `X_WH.q` is not measured (it is the identity)
  double max_rate_hz = 10'000;  ///< what it can exchange; `open` refuses more
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
  /// About 20 times a second beside the loop: whatever may take its time, such as finding a lost device
  /// again. Until that is done `read` says kNoUpdate with kDeviceLost.
  virtual void maintain() {}
  /// How the device is, in words for a person, with what to do; empty when all is well.
  [[nodiscard]] virtual std::string status() { return {}; }
  /// Zero force, then lets go. May be called twice.
  virtual void close() noexcept = 0;
};

}  // namespace needlelab
