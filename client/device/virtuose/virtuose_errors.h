/// The Virtuose's error codes, alarms and failures: their text for a person, with advice, and their
/// DeviceFlag bits for the force gate.
#pragma once

#include <cstdint>
#include <string>

namespace needlelab {

/// Results of `virtGetErrorCode`. Numbers and names are the vendor's (VirtuoseAPI 3.98).
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

/// e.g. "error 19, the call came at the wrong time: …". `vendors_text` (may be null) is used only for unknown
/// codes.
std::string virtuoseErrorText(int code, const char* vendors_text);

/// Returns one sentence per set bit; empty for 0. Shows unknown bits as a number.
std::string virtuoseAlarmText(std::uint32_t alarm);
/// Likewise for `virtGetFailure`.
std::string virtuoseFailureText(std::uint32_t failure);

/// Returns the state of a responding device as text, from its DeviceFlag bits, alarms and failures; empty
/// when all is well.
std::string virtuoseStateText(std::uint32_t condition, std::uint32_t alarm, std::uint32_t failure);

/// Whether the link is lost and must be reopened, rather than one call refused. Real-time safe.
bool virtuoseLinkIsLost(int code) noexcept;
/// DeviceFlag bits. Real-time safe.
std::uint32_t virtuoseConditionOfError(int code) noexcept;
std::uint32_t virtuoseConditionOfAlarm(std::uint32_t alarm) noexcept;
std::uint32_t virtuoseConditionOfFailure(std::uint32_t failure) noexcept;

}  // namespace needlelab
