/// The condition that a device reports in each tick with its pose: the gate acts on it, and the recording
/// keeps it.
#pragma once

#include <cstdint>

namespace needlelab {

/// Bits 22-30 of a recorded sample's flags, next to StepFlag and GateFlag. Append only.
enum DeviceFlag : std::uint32_t {
  kDeviceEmergencyStop = 1u << 22,  ///< fault: the emergency stop is pressed
  kDeviceReleased = 1u << 23,       ///< hold: the dead-man sensor detects no hand
  kDevicePowerOff = 1u << 24,       ///< hold: the motors have no power
  kDeviceOverheated = 1u << 25,     ///< fault
  kDeviceSaturated = 1u << 26,  ///< reported and counted: the device renders less than the requested force
  kDeviceOverrun = 1u << 27,    ///< reported and counted: the device could not keep the rate
  kDeviceLost = 1u << 28,       ///< fault: unplugged, or its link is broken
  kDeviceTrouble = 1u << 29,    ///< fault: another error; `Device::status` has the text
  kDeviceNotReady = 1u << 30,   ///< hold: the device is homing or loads its firmware
};

/// All of them.
inline constexpr std::uint32_t kDeviceFlags = 0x7FC0'0000u;
/// Faults: the force fades out within 20 ms and returns only after the fault is over and acknowledged and the
/// tip is outside.
inline constexpr std::uint32_t kDeviceFaultFlags =
    kDeviceEmergencyStop | kDeviceOverheated | kDeviceLost | kDeviceTrouble;
/// Holds: the force fades out within 20 ms and fades in over 200 ms when the flag clears, without
/// acknowledgement.
inline constexpr std::uint32_t kDeviceHoldFlags = kDeviceReleased | kDevicePowerOff | kDeviceNotReady;

}  // namespace needlelab
