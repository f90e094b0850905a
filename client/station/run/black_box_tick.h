/// What the black box keeps of a tick: all that went into it and came out, for whoever asks afterwards why.
#pragma once

#include <cstdint>
#include <type_traits>

#include "client/device/device.h"

namespace needlelab {

/// Poses and wrenches in W; H handle, T tip.
struct BlackBoxTick {
  std::uint64_t tick = 0;           ///< of the loop; a gap: missed, see `missed_before`
  std::uint64_t missed_before = 0;  ///< ticks that passed unseen just before this one
  std::int64_t due_ns = 0;          ///< station's steady clock
  std::int64_t late_ns = 0;         ///< how late the loop woke, for the tick that it had slept for
  std::int64_t read_ns = 0, engine_ns = 0, write_ns = 0, record_ns = 0;  ///< how long each phase took
  DeviceReading reading;                ///< as the device gave it, before any check
  bool fresh = false;                   ///< false: the device gave nothing new, `reading` is the last one
  Pose X_WT;                            ///< of the last tick whose sample was not rejected
  Wrench wanted_W;                      ///< the engine's, about the tip, before the gate
  Wrench rendered_W;                    ///< the gate's, at the handle: what the device got
  double depth_m = 0, insertion_m = 0;  ///< δ and d_t
  double speed_mps = 0;                 ///< the engine's v
  std::uint32_t flags = 0;              ///< StepFlag | GateFlag | DeviceFlag
  std::int8_t layer = -1;
  std::uint8_t phase = 0;  ///< needlelab::Phase
  std::uint8_t fault = 0;  ///< needlelab::Fault
};
static_assert(std::is_trivially_copyable_v<BlackBoxTick>);

/// Why the black box was kept.
enum class BlackBoxCause : std::uint8_t {
  kFault,        ///< the gate raised a fault
  kMissedTicks,  ///< 20 ms of ticks were missed, at once or within a short time
};

/// One stretch of ticks that is kept.
struct BlackBoxDump {
  std::uint32_t number = 0;                     ///< of the session, from 1
  BlackBoxCause cause = BlackBoxCause::kFault;  ///< of the first trigger in it
  Fault fault = Fault::kNone;                   ///< that stood at the first trigger
  std::uint64_t tick = 0;                       ///< at which that was
  std::uint32_t triggers = 0;                   ///< how many fell into this stretch
  std::uint64_t first = 0, count = 0;           ///< where it lies in the ring: the box's own
};

}  // namespace needlelab
