/// What the Virtuose's error codes, alarms and failures mean, in words, with what to do, and what the force
/// gate makes of them.
#pragma once

#include <cstdint>
#include <string>

namespace needlelab {

/// What `virtGetErrorCode` can say. Numbers and names are the vendor's (VirtuoseAPI 3.98).
enum VirtuoseError : int {
  kVirtNoError = 0,
  kVirtOutOfMemory = 1,
  kVirtCommunication = 2,
  kVirtInvalidContext = 3,
  kVirtFileNotFound = 4,
  kVirtWrongFormat = 5,
  kVirtTimeOut = 6,
  kVirtNotImplemented = 7,
  kVirtNotAvailable = 8,
  kVirtIncorrectValue = 9,
  kVirtSyntaxError = 10,
  kVirtHardwareError = 11,
  kVirtPositionDiscontinuity = 12,
  kVirtLibraryNotFound = 13,
  kVirtPeriodicFunction = 14,
  kVirtPerformanceCounter = 15,
  kVirtMajorMinorVersion = 16,
  kVirtWrongMode = 17,
  kVirtModeNotSupported = 18,
  kVirtCallTime = 19,
  kVirtIncompatibleVersion = 20,
  kVirtIncorrectVmType = 21,
  kVirtAlreadyCalled = 22,
};

/// Bits of `virtGetAlarm`.
enum VirtuoseAlarm : std::uint32_t {
  kVirtAlarmOverheat = 0x4000,
  kVirtAlarmSaturation = 0x8000,
  kVirtAlarmOverrun = 0x2'0000,
  kVirtAlarmPosition = 0x4'0000,
  kVirtAlarmLowBattery = 0x10'0000,
};

/// e.g. "error 19, the call came at the wrong time: …". `vendors_text` (may be null) is used for a code that
/// we do not know, and appended nowhere else.
std::string virtuoseErrorWords(int code, const char* vendors_text);

/// One sentence for each bit that is set; empty for 0. Bits that we do not know are given as a number.
std::string virtuoseAlarmWords(std::uint32_t alarm);
/// The same for `virtGetFailure`.
std::string virtuoseFailureWords(std::uint32_t failure);

/// All that a person should know or do, from the DeviceFlag bits, alarms and failures of a device that
/// answers; empty when all is well.
std::string virtuoseStateWords(std::uint32_t condition, std::uint32_t alarm, std::uint32_t failure);

/// The link is gone (only opening it again helps) rather than one call refused. Real-time safe.
bool virtuoseLinkIsLost(int code) noexcept;
/// DeviceFlag bits. Real-time safe.
std::uint32_t virtuoseConditionOfError(int code) noexcept;
std::uint32_t virtuoseConditionOfAlarm(std::uint32_t alarm) noexcept;
std::uint32_t virtuoseConditionOfFailure(std::uint32_t failure) noexcept;

}  // namespace needlelab
