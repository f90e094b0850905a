/// What the haptic loop counted, and why it ended.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/base/histogram.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// Why the loop ended.
enum class ServoEnd : std::uint8_t {
  kNotYet,
  kStopped,         ///< asked to
  kTicksDone,       ///< max_ticks
  kDeviceFinished,  ///< a recording or a hand's plan is over
  kFault,           ///< the gate took the force away, and nobody was to be waited for; see `fault`
  kCrash,           ///< crashStop: another part of the program died
};

/// A fault of the lesson.
struct FaultNote {
  Fault fault = Fault::kNone;
  std::uint64_t tick = 0;                  ///< in which it was raised
  std::optional<std::uint64_t> over_tick;  ///< in which it was over: acknowledged, the needle outside
};

/// Thread: the histograms may be read while the loop runs; everything else when `run` has returned.
struct ServoStats {
  ServoEnd end = ServoEnd::kNotYet;
  Fault fault = Fault::kNone;        ///< that stood when the loop ended; none when it was over by then
  Fault first_fault = Fault::kNone;  ///< of the whole lesson
  std::uint64_t faults = 0;          ///< how often one was raised
  std::uint64_t fault_ticks = 0;     ///< ticks in FAULT
  static constexpr std::size_t kMostFaultNotes = 64;
  std::array<FaultNote, kMostFaultNotes> fault_notes{};  ///< of the first faults
  std::size_t fault_note_count = 0;
  std::uint64_t ticks = 0;         ///< that passed, missed ones included
  std::uint64_t samples = 0;       ///< ticks that ran: each gave one sample
  std::uint64_t missed_ticks = 0;  ///< that passed before the loop woke: not stepped, no sample
  std::uint64_t late_wakeups = 0;  ///< wake-ups late by a period or more: each missed one tick or several
  std::array<std::uint64_t, 32>
      flag_ticks{};         ///< bit i of StepFlag, GateFlag, DeviceFlag: in how many ticks it was set
  LatencyHistogram wakeup;  ///< how late after its due time a tick began
  LatencyHistogram tick;    ///< how long a tick worked: all of the following
  LatencyHistogram read;    ///< … the device's read
  LatencyHistogram engine;  ///< … tool, gate and engine
  LatencyHistogram write;   ///< … the device's write
  LatencyHistogram record;  ///< … the sample into its ring, and what others see of the tick
  LatencyHistogram device;  ///< read and write of a tick together

  /// Once per tick: the fault of this tick, and whether it was raised in it. Real-time safe.
  void noteFault(Fault now, bool raised, std::uint64_t tick_number) noexcept {
    if ((raised || now == Fault::kNone) && open_fault_) {
      fault_notes[fault_note_count - 1].over_tick = tick_number;
      open_fault_ = false;
    }
    if (!raised || fault_note_count == kMostFaultNotes) return;
    fault_notes[fault_note_count++] = {now, tick_number, std::nullopt};
    open_fault_ = true;
  }

 private:
  bool open_fault_ = false;
};

}  // namespace needlelab
