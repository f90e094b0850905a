/// The loop's policy in FAULT, and messages to a person about faults and holds.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// The loop's reaction after the gate removed the force.
enum class FaultPolicy : std::uint8_t {
  kEnd,   ///< the loop ends 50 ms later
  kWait,  ///< the loop continues without force; it still reads the device and records. The force fades in
          ///< again after `acknowledge` and the gate's own conditions (the cause is over, the tip is
          ///< outside).
};

/// The state of loop and device, sampled a few times a second.
struct WatchedState {
  double now_s = 0;  ///< ascending
  Fault fault = Fault::kNone;
  std::uint64_t faults = 0;  ///< number so far; reveals faults that came and went between samples
  bool cause_lasts = false;  ///< the cause of the fault persists
  bool acknowledged = false;
  std::uint32_t condition = 0;       ///< DeviceFlag bits
  std::string device_status;         ///< Device::status
  bool acknowledge_pressed = false;  ///< a person acknowledged since the last sample
};

/// Pure logic: no threads, no clock, no device.
class FaultWatch {
 public:
  /// `waits`: the loop waits for an acknowledgement (otherwise the lesson ends with the fault).
  /// `how_to_acknowledge`: "press Enter", "send SIGUSR1 to process 123".
  FaultWatch(bool waits, std::string how_to_acknowledge);

  /// Call before `update`. Returns whether a person acknowledged the present fault after its report. An
  /// earlier key press does not count.
  [[nodiscard]] bool isAcknowledgement(const WatchedState& state) const {
    return state.acknowledge_pressed && state.fault != Fault::kNone && state.faults == faults_;
  }
  /// Returns the messages due now, one line each; usually none.
  std::vector<std::string> update(const WatchedState& state);
  /// Returns the present fault in one line for an instructor; empty without a fault.
  [[nodiscard]] std::string trouble() const;

 private:
  std::string instructionFor(const WatchedState& state) const;
  void updateFault(const WatchedState& state, std::vector<std::string>& messages);
  void updateHolds(const WatchedState& state, std::vector<std::string>& messages);
  void updateDevice(const WatchedState& state, std::vector<std::string>& messages);

  bool waits_;
  std::string how_to_acknowledge_;
  std::uint64_t faults_ = 0;
  Fault fault_ = Fault::kNone;
  bool waits_for_outside_ = false;
  std::uint32_t held_ = 0;  // reported holds that persist
  std::array<double, 3> hold_message_s_;
  std::string device_status_;
  double device_message_s_;
  std::uint32_t condition_ = 0;
};

/// Returns what a person must do before a fault of this kind can end; empty if nothing.
std::string remedyOf(Fault fault);

}  // namespace needlelab
