#include "client/station/run/loop/fault_watch.h"

#include <utility>

#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

constexpr double kNotAgain_s = 10;  // shortest time between messages about the same hold
constexpr double kNever_s = -1e9;

struct HoldText {
  std::uint32_t flag;
  const char* begins;
  const char* ends;
};
constexpr std::array<HoldText, 3> kHoldTexts = {{
    {kDeviceReleased, "no one holds the handle: no force", "the handle is held again: the force comes back"},
    {kDevicePowerOff, "the device's motors have no power: no force; switch them on",
     "the motors have power again: the force comes back"},
    {kDeviceNotReady, "the device is not ready yet: no force", "the device is ready: the force comes"},
}};

// the flag for a device fault
std::uint32_t flagOf(Fault fault) {
  switch (fault) {
    case Fault::kEmergencyStop:
      return kDeviceEmergencyStop;
    case Fault::kDeviceLost:
      return kDeviceLost;
    case Fault::kDeviceOverheated:
      return kDeviceOverheated;
    case Fault::kDeviceTrouble:
      return kDeviceTrouble;
    default:
      return 0;
  }
}

// the present obstacle; it may differ from the fault's first cause
std::string causeNow(const WatchedState& state) {
  for (const Fault fault :
       {Fault::kEmergencyStop, Fault::kDeviceLost, Fault::kDeviceOverheated, Fault::kDeviceTrouble})
    if ((state.condition & flagOf(fault)) != 0) return faultText(fault);
  return faultText(state.fault);
}

}  // namespace

std::string remedyOf(Fault fault) {
  switch (fault) {
    case Fault::kEmergencyStop:
      return "let the emergency stop out";
    case Fault::kDeviceLost:
      return "plug the device in, or mend its link";
    case Fault::kDeviceOverheated:
      return "let the motors cool";
    case Fault::kDeviceSilent:
      return "check the device's cable and power";
    case Fault::kTipTooFast:
    case Fault::kDeviceTooFast:
      return "hold the handle still";
    default:
      return {};
  }
}

FaultWatch::FaultWatch(bool waits, std::string how_to_acknowledge)
    : waits_(waits), how_to_acknowledge_(std::move(how_to_acknowledge)), device_message_s_(kNever_s) {
  hold_message_s_.fill(kNever_s);
}

std::string FaultWatch::instructionFor(const WatchedState& state) const {
  if (!waits_ || state.fault == Fault::kProgramTrouble) return "The lesson ends; it is stored";
  const std::string remedy = remedyOf(state.fault);
  return (remedy.empty() ? "Take" : "Please " + remedy + ", take") + " the needle out of the tissue, then " +
         how_to_acknowledge_;
}

void FaultWatch::updateFault(const WatchedState& state, std::vector<std::string>& messages) {
  const bool raised = state.faults != faults_;
  if (raised && state.fault != Fault::kNone) {
    std::string text = std::string("FAULT: ") + faultText(state.fault);
    if (!state.device_status.empty()) text += " (" + state.device_status + ")";
    messages.push_back(text + ". The force was taken away. " + instructionFor(state));
    device_status_ = state.device_status;
    waits_for_outside_ = false;
  } else if (raised) {
    messages.push_back("there was a FAULT, which is over");
  } else if (fault_ != Fault::kNone && state.fault == Fault::kNone) {
    messages.push_back("the fault is over: the force comes back");
  } else if (state.fault != Fault::kNone && state.acknowledge_pressed && state.cause_lasts) {
    std::string text = "not yet: " + causeNow(state);
    if (!state.device_status.empty()) text += " (" + state.device_status + ")";
    messages.push_back(text + ". When that is over, " + how_to_acknowledge_ + " again");
  } else if (state.fault != Fault::kNone && state.acknowledged && !waits_for_outside_) {
    messages.push_back("seen. The force comes back when the needle is outside the tissue");
    waits_for_outside_ = true;
  }
  if (!state.acknowledged) waits_for_outside_ = false;
  faults_ = state.faults;
  fault_ = state.fault;
}

void FaultWatch::updateHolds(const WatchedState& state, std::vector<std::string>& messages) {
  for (std::size_t i = 0; i < kHoldTexts.size(); ++i) {
    const std::uint32_t flag = kHoldTexts[i].flag;
    const bool stands = (state.condition & flag) != 0;
    if (stands == ((held_ & flag) != 0)) continue;
    if (!stands) {
      held_ &= ~flag;
      if (state.fault == Fault::kNone && (state.condition & kDeviceHoldFlags) == 0)
        messages.push_back(kHoldTexts[i].ends);
    } else if ((state.condition & kDeviceEmergencyStop) != 0) {
      continue;  // the stop also cuts the power and must be released first
    } else if (state.now_s - hold_message_s_[i] >= kNotAgain_s) {
      // the device's own status is more precise than our text; reports it only once
      if (state.device_status.empty())
        messages.push_back(kHoldTexts[i].begins);
      else if (state.device_status != device_status_)
        messages.push_back(state.device_status + ": no force");
      device_status_ = state.device_status;
      hold_message_s_[i] = state.now_s;
      held_ |= flag;
    }
  }
}

// reports other device status; does not repeat it while the device counts its attempts
void FaultWatch::updateDevice(const WatchedState& state, std::vector<std::string>& messages) {
  const bool changed = state.condition != condition_;
  condition_ = state.condition;
  if (state.device_status == device_status_) return;
  if (state.device_status.empty()) {
    device_status_.clear();
    return;
  }
  if (!changed && state.now_s - device_message_s_ < kNotAgain_s) return;
  messages.push_back("device: " + state.device_status);
  device_status_ = state.device_status;
  device_message_s_ = state.now_s;
}

std::string FaultWatch::trouble() const {
  return fault_ == Fault::kNone ? std::string() : std::string("FAULT: ") + faultText(fault_);
}

std::vector<std::string> FaultWatch::update(const WatchedState& state) {
  std::vector<std::string> messages;
  updateFault(state, messages);
  updateHolds(state, messages);
  updateDevice(state, messages);
  return messages;
}

}  // namespace needlelab
