#include "common/haptics/force_gate.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

const char* phaseName(Phase phase) {
  switch (phase) {
    case Phase::kFree:
      return "FREE";
    case Phase::kInserting:
      return "INSERTING";
    case Phase::kStopped:
      return "STOPPED";
    case Phase::kWithdrawing:
      return "WITHDRAWING";
  }
  return "?";
}

const char* faultText(Fault fault) {
  switch (fault) {
    case Fault::kNone:
      return "no fault";
    case Fault::kSampleNotFinite:
      return "the device reported a position that is not a number";
    case Fault::kTipTooFast:
      return "the needle's tip jumped faster than 5 m/s";
    case Fault::kDeviceTooFast:
      return "the device moved faster than it may";
    case Fault::kDeviceSilent:
      return "the device stopped reporting its position";
    case Fault::kForceNotFinite:
      return "the computed force was not a number";
    case Fault::kOrientationInvalid:
      return "the device reported an orientation that is no rotation";
    case Fault::kEmergencyStop:
      return "the emergency stop is pressed";
    case Fault::kDeviceLost:
      return "the device is unplugged, or its link is broken";
    case Fault::kDeviceOverheated:
      return "the device's motors are too hot";
    case Fault::kDeviceTrouble:
      return "the device reported an error";
    case Fault::kProgramTrouble:
      return "another part of the program died";
  }
  return "unknown fault";
}

}  // namespace needlelab
