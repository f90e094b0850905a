/// A haptic device, behind the same small interface whatever it is. To write your own: derive, fill
/// DeviceInfo, done.
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"
#include "haptics/force_gate.h"

namespace needlelab {

/// What a device is, as data.
struct DeviceInfo {
  std::string name;  ///< for a person, e.g. "simulated Virtuose 6D Desktop, hand 300 N/m"
  DeviceLimits limits;
  bool renders_force = true;  ///< false for a recording: the hand feels nothing
  bool renders_torque = true;
  bool has_orientation = true;
};

/// One reading. Poses are of the handle H in W; the tool transform makes the tip of it.
struct DeviceReading {
  Pose X_WH;
  double speed_mps = 0;       ///< of the handle, as the device itself reports it; 0 when it does not
  double plunger = 0;         ///< 0-1
  std::uint32_t buttons = 0;  ///< bit i: button i pressed
};

enum class DeviceRead : std::uint8_t {
  kFresh,     ///< `reading` was filled
  kNoUpdate,  ///< the device gave nothing new in this tick; `reading` is as it was
  kFinished,  ///< a recording has ended: the loop ends too
};

/// Thread: open and close by the owner off the haptic thread; read and write by the haptic thread, once a
/// tick each, in that order. read and write neither allocate, lock nor throw.
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
  /// Zero force, then lets go. May be called twice.
  virtual void close() noexcept = 0;
};

}  // namespace needlelab
