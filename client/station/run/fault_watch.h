/// What a person is told of faults and holds, and what to do: from how the loop and the device stand to
/// words.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/haptics/force_gate.h"

namespace needlelab {

/// How the loop and the device stand, looked at a few times a second.
struct WatchedState {
  double now_s = 0;  ///< ascending
  Fault fault = Fault::kNone;
  std::uint64_t faults = 0;  ///< raised so far: a fault that came and went between two looks is seen, too
  bool cause_lasts = false;  ///< of the fault
  bool acknowledged = false;
  std::uint32_t condition = 0;       ///< DeviceFlag bits
  std::string device_words;          ///< Device::status
  bool acknowledge_pressed = false;  ///< a person acknowledged since the last look
};

/// Pure logic: no threads, no clock, no device.
class FaultWatch {
 public:
  /// `waits`: the loop waits for an acknowledgement (otherwise the lesson ends with the fault).
  /// `how_to_acknowledge`: "press Enter", "send SIGUSR1 to process 123".
  FaultWatch(bool waits, std::string how_to_acknowledge);

  /// Before `look`: whether a person acknowledged the fault that stands, which has been said by then. What
  /// was pressed before that is none.
  [[nodiscard]] bool counts(const WatchedState& state) const {
    return state.acknowledge_pressed && state.fault != Fault::kNone && state.faults == faults_;
  }
  /// What is to be said now, each a line; mostly nothing.
  std::vector<std::string> look(const WatchedState& state);
  /// The fault that stands, in one line for an instructor; empty when there is none.
  [[nodiscard]] std::string trouble() const;

 private:
  std::string whatToDo(const WatchedState& state) const;
  void lookAtFault(const WatchedState& state, std::vector<std::string>& said);
  void lookAtHolds(const WatchedState& state, std::vector<std::string>& said);
  void lookAtDevice(const WatchedState& state, std::vector<std::string>& said);

  bool waits_;
  std::string how_to_acknowledge_;
  std::uint64_t faults_ = 0;
  Fault fault_ = Fault::kNone;
  bool waits_for_outside_ = false;
  std::uint32_t held_ = 0;  // holds that were said and stand
  std::array<double, 3> hold_said_s_;
  std::string device_words_;
  double device_said_s_;
  std::uint32_t condition_ = 0;
};

/// What a person has to do before a fault of this kind can end; empty when there is nothing but to look.
std::string remedyOf(Fault fault);

}  // namespace needlelab
