#include "client/station/run/fault_watch.h"

#include <utility>

#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

constexpr double kNotAgain_s = 10;  // the same hold is not said more often
constexpr double kLongAgo_s = -1e9;

struct HoldWords {
  std::uint32_t flag;
  const char* begins;
  const char* ends;
};
constexpr std::array<HoldWords, 3> kHolds = {{
    {kDeviceReleased, "nobody holds the handle: no force", "the handle is held again: the force comes back"},
    {kDevicePowerOff, "the device's motors have no power: no force; switch them on",
     "the motors have power again: the force comes back"},
    {kDeviceNotReady, "the device is not ready yet: no force", "the device is ready: the force comes"},
}};

// the flag that stands for a fault of the device's own
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

// what stands in the way, when it is not what the fault began with
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
    : waits_(waits), how_to_acknowledge_(std::move(how_to_acknowledge)), device_said_s_(kLongAgo_s) {
  hold_said_s_.fill(kLongAgo_s);
}

std::string FaultWatch::whatToDo(const WatchedState& state) const {
  if (!waits_ || state.fault == Fault::kProgramTrouble) return "The lesson ends; it is stored";
  const std::string remedy = remedyOf(state.fault);
  return (remedy.empty() ? "Take" : "Please " + remedy + ", take") + " the needle out of the tissue, then " +
         how_to_acknowledge_;
}

void FaultWatch::lookAtFault(const WatchedState& state, std::vector<std::string>& said) {
  const bool raised = state.faults != faults_;
  if (raised && state.fault != Fault::kNone) {
    std::string text = std::string("FAULT: ") + faultText(state.fault);
    if (!state.device_words.empty()) text += " (" + state.device_words + ")";
    said.push_back(text + ". The force was taken away. " + whatToDo(state));
    device_words_ = state.device_words;
    waits_for_outside_ = false;
  } else if (raised) {
    said.push_back("there was a FAULT, which is over");
  } else if (fault_ != Fault::kNone && state.fault == Fault::kNone) {
    said.push_back("the fault is over: the force comes back");
  } else if (state.fault != Fault::kNone && state.acknowledge_pressed && state.cause_lasts) {
    std::string text = "not yet: " + causeNow(state);
    if (!state.device_words.empty()) text += " (" + state.device_words + ")";
    said.push_back(text + ". When that is over, " + how_to_acknowledge_ + " again");
  } else if (state.fault != Fault::kNone && state.acknowledged && !waits_for_outside_) {
    said.push_back("seen. The force comes back when the needle is outside the tissue");
    waits_for_outside_ = true;
  }
  if (!state.acknowledged) waits_for_outside_ = false;
  faults_ = state.faults;
  fault_ = state.fault;
}

void FaultWatch::lookAtHolds(const WatchedState& state, std::vector<std::string>& said) {
  for (std::size_t i = 0; i < kHolds.size(); ++i) {
    const std::uint32_t flag = kHolds[i].flag;
    const bool stands = (state.condition & flag) != 0;
    if (stands == ((held_ & flag) != 0)) continue;
    if (!stands) {
      held_ &= ~flag;
      if (state.fault == Fault::kNone && (state.condition & kDeviceHoldFlags) == 0)
        said.push_back(kHolds[i].ends);
    } else if ((state.condition & kDeviceEmergencyStop) != 0) {
      continue;  // the stop takes the power, too: first let it out
    } else if (state.now_s - hold_said_s_[i] >= kNotAgain_s) {
      // the device's own words say more than ours; once is enough
      if (state.device_words.empty())
        said.push_back(kHolds[i].begins);
      else if (state.device_words != device_words_)
        said.push_back(state.device_words + ": no force");
      device_words_ = state.device_words;
      hold_said_s_[i] = state.now_s;
      held_ |= flag;
    }
  }
}

// whatever else the device has to say; not again and again while it counts its attempts
void FaultWatch::lookAtDevice(const WatchedState& state, std::vector<std::string>& said) {
  const bool changed = state.condition != condition_;
  condition_ = state.condition;
  if (state.device_words == device_words_) return;
  if (state.device_words.empty()) {
    device_words_.clear();
    return;
  }
  if (!changed && state.now_s - device_said_s_ < kNotAgain_s) return;
  said.push_back("device: " + state.device_words);
  device_words_ = state.device_words;
  device_said_s_ = state.now_s;
}

std::string FaultWatch::trouble() const {
  return fault_ == Fault::kNone ? std::string() : std::string("FAULT: ") + faultText(fault_);
}

std::vector<std::string> FaultWatch::look(const WatchedState& state) {
  std::vector<std::string> said;
  lookAtFault(state, said);
  lookAtHolds(state, said);
  lookAtDevice(state, said);
  return said;
}

}  // namespace needlelab
