#include <fmt/core.h>
#include <string>

#include <string_view>

#include "client/station/run/summary.h"
#include "common/base/text.h"
#include "common/haptics/device_condition.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "common/haptics/force_gate.h"

namespace needlelab {
namespace {

struct FlagWords {
  std::uint32_t flag;
  bool warning;
  std::string_view text;
};

constexpr FlagWords kFlagWords[] = {
    {kFlagEntry, false, "entries into the tissue"},
    {kFlagExit, false, "exits from the tissue"},
    {kFlagLayerChange, false, "changes of layer"},
    {kFlagRupture, false, "membranes ruptured"},
    {kFlagTurn, false, "turns of the trajectory"},
    {kFlagClampCapped, true, "clamping force at its maximum"},
    {kFlagForceCapped, true, "force cut to the profile's maximum"},
    {kFlagTorque, false, "torque of the orientation limit"},
    {kFlagNotStepped, true, "tick not computed (bad sample, or after a fault)"},
    {kFlagStartedInside, true, "in the tissue from the start: no force until the needle was outside once"},
    {kFlagBeyondNeedle, true, "inserted deeper than the needle is long"},
    {kGateSampleRejected, true, "sample of the device rejected"},
    {kGatePeakLimited, true, "force cut to what the device can render"},
    {kGateThermalLimited, true, "force lowered so that the motors stay cool"},
    {kGateSlewLimited, true, "force rising more slowly than computed"},
    {kGateStartRamp, false, "start: force fading in"},
    {kGateFaulted, true, "FAULT: force taken away"},
    {kDeviceEmergencyStop, true, "emergency stop pressed"},
    {kDeviceReleased, false, "nobody held the handle: no force"},
    {kDevicePowerOff, true, "motors without power: no force"},
    {kDeviceOverheated, true, "motors too hot"},
    {kDeviceSaturated, true, "device rendered less than it was asked for"},
    {kDeviceOverrun, true, "device could not keep the rate"},
    {kDeviceLost, true, "device lost"},
    {kDeviceTrouble, true, "device reported an error"},
    {kDeviceNotReady, true, "device not ready: no force"},
};

const FlagWords* wordsOf(unsigned bit) {
  for (const FlagWords& words : kFlagWords)
    if (words.flag == (1u << bit)) return &words;
  return nullptr;
}

}  // namespace

std::string_view flagText(unsigned bit) {
  const FlagWords* words = wordsOf(bit);
  return words == nullptr ? std::string_view() : words->text;
}

bool isWarningFlag(unsigned bit) {
  const FlagWords* words = wordsOf(bit);
  return words != nullptr && words->warning;
}

const char* servoEndText(ServoEnd end) {
  switch (end) {
    case ServoEnd::kNotYet:
      return "did not run";
    case ServoEnd::kStopped:
      return "stopped";
    case ServoEnd::kTicksDone:
      return "time is over";
    case ServoEnd::kDeviceFinished:
      return "the device's motion is over";
    case ServoEnd::kFault:
      return "FAULT";
    case ServoEnd::kCrash:
      return "another part of the program died";
  }
  return "?";
}

std::string stopText(const std::optional<StopCause>& stopped) {
  if (!stopped) return {};
  return (stopped->by.empty() ? std::string("stopped at the window") : "stopped by " + stopped->by) +
         (stopped->reason.empty() ? "" : ": " + stopped->reason);
}

std::string effectCostsText(const EffectCosts& costs) {
  std::string text = formatted("%.1f ns a tick", costs.tick_ns);
  const char* before = "; beside the others each adds: ";
  for (const EffectCost& cost : costs.effects) {
    text += before + fmt::format("{} {:.1f} ns", effectName(cost.effect), cost.ns);
    before = ", ";
  }
  return text;
}

}  // namespace needlelab
