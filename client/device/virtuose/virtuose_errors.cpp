#include "client/device/virtuose/virtuose_errors.h"

#include <fmt/core.h>

#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

struct ErrorRow {
  int code;
  const char* what;
  const char* to_do;
};

// advice for the person at the machine; errors of our program say so
constexpr const char* kOurs = "this is a fault of needlelab: report it, with this line";
constexpr ErrorRow kErrors[] = {
    {kVirtNoError, "the library gives no reason", "look into the vendor's log"},
    {kVirtOutOfMemory, "the library ran out of memory", "close other programs, or start the computer again"},
    {kVirtCommunication, "nothing answers there",
     "see that the device is on, its Ethernet cable plugged in, the vendor's service running, no other "
     "program "
     "using the device, and that the address is the one in the service's settings"},
    {kVirtInvalidContext, "the connection is not valid any more",
     "the vendor's service was stopped or cut the link; it is opened again by itself"},
    {kVirtFileNotFound, "the library misses a file of its own", "install the vendor's software again"},
    {kVirtWrongFormat, "the library cannot read a file of its own", "install the vendor's software again"},
    {kVirtTimeOut, "the device did not answer in time",
     "see to the Ethernet cable, and that the vendor's service is not starved by other programs"},
    {kVirtNotImplemented, "this library does not have that function",
     "install the vendor's current VirtuoseAPI"},
    {kVirtNotAvailable, "the device does not have that value", "see that it is a Virtuose 6D"},
    {kVirtIncorrectValue, "the library refuses the value", kOurs},
    {kVirtSyntaxError, "the library does not understand the address",
     "give it as HOST#PORT, e.g. 127.0.0.1#53210"},
    {kVirtHardwareError, "the device reports a hardware error",
     "switch it off and on again; if it comes back, note the code on its display and call the vendor"},
    {kVirtPositionDiscontinuity, "the measured position jumped",
     "put the handle into its rest, switch the device off and on again; if it comes back, call the vendor"},
    {kVirtLibraryNotFound, "the vendor's library misses a part of its own",
     "install the vendor's software again"},
    {kVirtPeriodicFunction, "the library's own loop could not start", kOurs},
    {kVirtPerformanceCounter, "the library finds no clock on this computer", "call the vendor"},
    {kVirtMajorMinorVersion, "the library's version is unknown to the device",
     "install the VirtuoseAPI that belongs to the device's software"},
    {kVirtWrongMode, "the device is not in the mode for that call", kOurs},
    {kVirtModeNotSupported, "this device cannot render forces that a program computes",
     "see that it is a Virtuose 6D, not a passive arm"},
    {kVirtCallTime, "the call came at the wrong time", kOurs},
    {kVirtIncompatibleVersion, "library and device are of versions that do not fit together",
     "install the VirtuoseAPI that belongs to the device's software"},
    {kVirtIncorrectVmType, "the library refuses the mechanism", kOurs},
    {kVirtAlreadyCalled, "the library was asked for that already", kOurs},
};

struct AlarmRow {
  std::uint32_t bit;
  std::uint32_t condition;
  const char* text;
};

constexpr AlarmRow kAlarms[] = {
    {kVirtAlarmOverheat, kDeviceOverheated,
     "a motor is too hot, the device reduces its force: let it rest for some minutes, then acknowledge"},
    {kVirtAlarmSaturation, kDeviceSaturated,
     "the motors are at their limit: less force is felt than the tissue asks for; press more gently"},
    {kVirtAlarmOverrun, kDeviceOverrun,
     "the device gets its commands too fast or too late: lower --rate, or close other programs (--self-test "
     "measures the computer)"},
    {kVirtAlarmPosition, kDeviceTrouble,
     "the device does not believe its own position: put the handle into its rest and switch it off and on "
     "again"},
    {kVirtAlarmLowBattery, 0, "the battery of the device is low: it will lose its zero; have it replaced"},
};

constexpr int kMotors = 8;

std::string joined(std::string text, const std::string& sentence) {
  if (!text.empty()) text += "; ";
  return text + sentence;
}

std::string bitsText(const char* what, std::uint32_t bits) {
  return fmt::format("{} 0x{:X}, which needlelab does not know: see the vendor's manual", what, bits);
}

}  // namespace

std::string virtuoseErrorText(int code, const char* vendors_text) {
  const std::string number = fmt::format("error {}, ", code);
  for (const ErrorRow& row : kErrors)
    if (row.code == code) return number + row.what + ": " + row.to_do;
  const bool said = vendors_text != nullptr && *vendors_text != '\0';
  return number + "which needlelab does not know; the vendor's library says " +
         (said ? "\"" + std::string(vendors_text) + "\"" : "nothing of it") + ": see the vendor's manual";
}

std::string virtuoseAlarmText(std::uint32_t alarm) {
  std::string text;
  for (const AlarmRow& row : kAlarms) {
    if ((alarm & row.bit) != 0) text = joined(text, row.text);
    alarm &= ~row.bit;
  }
  return alarm == 0 ? text : joined(text, bitsText("alarm", alarm));
}

std::string virtuoseFailureText(std::uint32_t failure) {
  std::string text;
  for (int motor = 1; motor <= kMotors; ++motor)
    if ((failure & (1u << (motor - 1))) != 0)
      text = joined(text, fmt::format("motor or encoder {} has failed: switch the device off and on again; "
                                      "if it comes back, call the vendor",
                                      motor));
  failure &= ~((1u << kMotors) - 1);
  return failure == 0 ? text : joined(text, bitsText("failure", failure));
}

bool virtuoseLinkIsLost(int code) noexcept {
  return code == kVirtCommunication || code == kVirtInvalidContext || code == kVirtTimeOut;
}

std::uint32_t virtuoseConditionOfError(int code) noexcept {
  return virtuoseLinkIsLost(code) ? kDeviceLost : kDeviceTrouble;
}

std::uint32_t virtuoseConditionOfAlarm(std::uint32_t alarm) noexcept {
  std::uint32_t condition = 0;
  for (const AlarmRow& row : kAlarms)
    if ((alarm & row.bit) != 0) condition |= row.condition;
  return condition;
}

std::string virtuoseStateText(std::uint32_t condition, std::uint32_t alarm, std::uint32_t failure) {
  std::string text;
  if ((condition & kDeviceEmergencyStop) != 0)
    text =
        "the emergency stop is pressed (see that all is safe, release it, and press the power switch of the "
        "device again)";
  else if ((condition & kDeviceReleased) != 0)
    text = "no one holds the handle (take it so that its sensor feels the hand)";
  else if ((condition & kDevicePowerOff) != 0)
    text = "the motors have no power (press the power switch of the device, and hold the handle)";
  if (alarm != 0) text = joined(text, virtuoseAlarmText(alarm));
  if (failure != 0) text = joined(text, virtuoseFailureText(failure));
  return text;
}

std::uint32_t virtuoseConditionOfFailure(std::uint32_t failure) noexcept {
  return failure != 0 ? kDeviceTrouble : 0u;
}

}  // namespace needlelab
