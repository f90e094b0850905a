/// One tick from a device's reading to its wrench: tool → gate → engine → tool → gate. The station runs it in
/// real time, the offline tool on virtual time: the same code.
#pragma once

#include <cstdint>

#include "client/device/device.h"
#include "client/device/plunger.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "common/haptics/force_gate.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The rotation that takes +z to the unit vector `axis`; turned about `axis` in no particular way. Exact for
/// the directions of the axes of W.
Quat rotationOfAxis(Vec3 axis) noexcept;

/// The needle stands on the skin: outside the tissue its axis is the inward normal at the nearest point of
/// the limb, at the entry the inward normal at P0 as the engine computes it, and that one is kept for the
/// insertion. So the engine's u is −n. Thread: one. Real-time safe.
class AssumedAxis {
 public:
  /// The tip's orientation in the tick to come, for a tip at `p_WT_m`. `before`: the engine's state after the
  /// last tick.
  [[nodiscard]] Quat at(const SceneModel& model, const SimState& before, Vec3 p_WT_m) const noexcept;
  /// That tick was stepped with `q_WT`: an insertion keeps it.
  void keep(Quat q_WT) noexcept { kept_ = q_WT; }

 private:
  Quat kept_;
};

/// All that a tick saw and did.
struct ChainTick {
  std::uint64_t tick = 0;  ///< missed ones are counted too
  Pose X_WH, X_WT;         ///< handle and tip, as last reported by a sample that was not rejected
  StepReport
      report;  ///< forces before the gate; in a tick that was not stepped those of the last one that was
  Wrench rendered_W;  ///< after the gate, at the handle
  /// The same torque about the tip. Zero where no orientation is measured: such a handle is a point, and so
  /// is its tip.
  Vec3 torque_at_tip_Nm;
  std::uint32_t gate_flags = 0;
  Fault fault = Fault::kNone;
  double plunger = 0;  ///< 0-1
  std::uint32_t buttons = 0;
};

/// Gate and engine behind a device's readings. Same readings, same bits. Allocates nothing after it was made.
/// Thread: the haptic thread only. Real-time safe.
class HapticChain {
 public:
  /// `model` must outlive the chain. `X_HT` is the tool: the tip in the handle's frame.
  HapticChain(const SceneModel& model, const DeviceLimits& limits, const Pose& X_HT);
  /// For a given device. Without an orientation the needle's axis is assumed (AssumedAxis), and of the tool
  /// only the offset is used, along W. Without torque none is requested, also not for the lever of the tool's
  /// force: the handle gets the tip's force. The plunger's source is the device's; `plunger.source` is
  /// ignored.
  HapticChain(const SceneModel& model, const DeviceInfo& device, const Pose& X_HT,
              PlungerSettings plunger = {});

  /// One tick; `fresh` and `elapsed_ticks` as in ForceGate::admit; `share` is the part of the engine's wrench
  /// that is requested (1, less while a session fades out). The device's wrench is in `out.rendered_W` and
  /// the result.
  GuardedWrench tick(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks, double share,
                     ChainTick& out) noexcept;

  [[nodiscard]] const ForceGate& gate() const noexcept { return gate_; }
  /// A person has seen the fault (ForceGate::acknowledge).
  void acknowledge() noexcept { gate_.acknowledge(); }
  /// A FAULT that only the program knows of: before `tick`, in each tick in which its cause lasts
  /// (ForceGate::raiseFromOutside).
  void raiseFromOutside(Fault fault) noexcept { gate_.raiseFromOutside(fault); }

 private:
  [[nodiscard]] Pose tipOf(const Pose& X_WH) const noexcept;
  [[nodiscard]] Wrench stepped(const Pose& X_WH, const Pose& X_WT, double share) noexcept;
  void skipped(const Pose& X_WH, const Pose& X_WT) noexcept;

  const SceneModel& model_;
  Pose X_HT_;
  bool has_orientation_ = true, renders_torque_ = true;
  AssumedAxis assumed_axis_;
  ForceGate gate_;
  Plunger plunger_;
  SimState state_{};
  StepReport report_{};
  Pose handle_, tip_;
  std::uint64_t next_tick_ = 0;
};

/// A tick as a recording has it. `time_ns` is when it was due; the others are the times that device and
/// engine took.
GestureSample sampleOf(const ChainTick& tick, std::int64_t time_ns, std::int64_t device_ns,
                       std::int64_t engine_ns) noexcept;

}  // namespace needlelab
