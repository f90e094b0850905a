/// What a device says of itself in a tick, beside its pose: the gate acts on it, and the recording keeps it.
#pragma once

#include <cstdint>

namespace needlelab {

/// Bits 22-30 of a recorded sample's flags, beside StepFlag and GateFlag. Append only.
enum DeviceFlag : std::uint32_t {
  kDeviceEmergencyStop = 1u << 22,  ///< fault: the emergency stop is pressed
  kDeviceReleased = 1u << 23,       ///< hold: the dead-man sensor says that no hand holds it
  kDevicePowerOff = 1u << 24,       ///< hold: the motors have no power
  kDeviceOverheated = 1u << 25,     ///< fault
  kDeviceSaturated = 1u << 26,      ///< said and counted: it renders less than it was asked for
  kDeviceOverrun = 1u << 27,        ///< said and counted: it could not keep the rate
  kDeviceLost = 1u << 28,           ///< fault: unplugged, or its link is broken
  kDeviceTrouble = 1u << 29,        ///< fault: another error; `Device::status` has the words
  kDeviceNotReady = 1u << 30,       ///< hold: it looks for its zero, or loads its firmware
};

/// All of them.
inline constexpr std::uint32_t kDeviceFlags = 0x7FC0'0000u;
/// Force goes within 20 ms and stays away until the fault is acknowledged, over, and the tip outside.
inline constexpr std::uint32_t kDeviceFaultFlags =
    kDeviceEmergencyStop | kDeviceOverheated | kDeviceLost | kDeviceTrouble;
/// Force goes within 20 ms and fades in again over 200 ms when the flag is gone: no acknowledgement.
inline constexpr std::uint32_t kDeviceHoldFlags = kDeviceReleased | kDevicePowerOff | kDeviceNotReady;

}  // namespace needlelab
