#include "client/station/window/overlay_words.h"

#include "client/station/run/fault_watch.h"
#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

std::string sentence(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

Overlay faultOverlay(const LessonStanding& standing) {
  Overlay overlay;
  overlay.kind = Overlay::Kind::kFault;
  overlay.title = "The force was taken away";
  overlay.what = sentence(faultText(standing.fault));
  if (!standing.device_words.empty()) overlay.what += " " + sentence(standing.device_words);
  const std::string remedy = remedyOf(standing.fault);
  if (!standing.waits || standing.fault == Fault::kProgramTrouble)
    overlay.todo = "The lesson ends; everything up to here is stored.";
  else if (standing.acknowledged)
    overlay.todo = "Seen. Take the needle out of the tissue: then the force comes back.";
  else if (standing.cause_lasts)
    overlay.todo = "First " + (remedy.empty() ? std::string("wait until the cause is over") : remedy) +
                   ". Then take the needle out of the tissue and press Enter.";
  else {
    overlay.todo = "Take the needle out of the tissue, then press Enter: the force comes back.";
    overlay.can_acknowledge = true;
  }
  return overlay;
}

}  // namespace

Overlay overlayOf(const LessonStanding& standing) {
  if (standing.fault != Fault::kNone) return faultOverlay(standing);
  if (standing.hold.empty()) return {};
  Overlay overlay;
  overlay.kind = Overlay::Kind::kHold;
  overlay.title = "No force at the moment";
  overlay.what = sentence(standing.device_words.empty() ? standing.hold : standing.device_words);
  if ((standing.condition & kDeviceReleased) != 0)
    overlay.todo = "Take the handle: the force comes back by itself.";
  else if ((standing.condition & kDevicePowerOff) != 0)
    overlay.todo = "Switch the device's motors on: the force comes back by itself.";
  else if ((standing.condition & kDeviceNotReady) != 0)
    overlay.todo = "Wait a moment: the force comes when the device is ready.";
  else
    overlay.todo = "Draw the needle out of the tissue: then the force comes.";
  return overlay;
}

}  // namespace needlelab
