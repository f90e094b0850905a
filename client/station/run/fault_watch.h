/// The loop's policy in FAULT, and the messages to a person about faults and holds.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/haptics/force_gate.h"

namespace needlelab {

/// The loop's reaction once the gate has taken the force away.
enum class FaultPolicy : std::uint8_t {
  kEnd,   ///< it ends 50 ms later
  kWait,  ///< it goes on without force, reading the device and recording, until `acknowledge` and the gate's
          ///< own conditions (the cause is over, the tip is outside) let the force fade in again
};

/// How the loop and the device stand, looked at a few times a second.
struct WatchedState {
  double now_s = 0;  ///< ascending
  Fault fault = Fault::kNone;
  std::uint64_t faults = 0;  ///< raised so far: a fault that came and went between two looks is seen, too
  bool cause_lasts = false;  ///< of the fault
  bool acknowledged = false;
  std::uint32_t condition = 0;       ///< DeviceFlag bits
  std::string device_status;         ///< Device::status
  bool acknowledge_pressed = false;  ///< a person acknowledged since the last look
};

/// Pure logic: no threads, no clock, no device.
class FaultWatch {
 public:
  /// `waits`: the loop waits for an acknowledgement (otherwise the lesson ends with the fault).
  /// `how_to_acknowledge`: "press Enter", "send SIGUSR1 to process 123".
  FaultWatch(bool waits, std::string how_to_acknowledge);

  /// Before `update`: whether a person acknowledged the present fault after it was reported. A key pressed
  /// before that does not count.
  [[nodiscard]] bool isAcknowledgement(const WatchedState& state) const {
    return state.acknowledge_pressed && state.fault != Fault::kNone && state.faults == faults_;
  }
  /// The messages that are due now, one line each; mostly none.
  std::vector<std::string> update(const WatchedState& state);
  /// The present fault in one line for an instructor; empty without one.
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
  std::uint32_t held_ = 0;  // holds that were reported and last
  std::array<double, 3> hold_message_s_;
  std::string device_status_;
  double device_message_s_;
  std::uint32_t condition_ = 0;
};

/// What a person has to do before a fault of this kind can end; empty where nothing can be done.
std::string remedyOf(Fault fault);

}  // namespace needlelab
