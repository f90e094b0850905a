/// One tick from a device's reading to its wrench: tool → gate → engine → tool → gate. The station runs it in
/// real time, the offline tool on virtual time.
#pragma once

#include <cstdint>
#include <optional>

#include "client/device/device.h"
#include "client/device/plunger.h"
#include "common/gesture/sample.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/gate/passivity_control.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// Returns a rotation that takes +z to the unit vector `axis`; the turn about `axis` is unspecified. Exact
/// for the directions of the axes of W.
Quat rotationOfAxis(Vec3 axis) noexcept;

/// Assumes a needle perpendicular to the skin, which then points where it goes. Outside the tissue its axis
/// is the inward normal at the nearest point of the limb; at the entry it is the inward normal at P0 as the
/// engine computes it, so the engine's u is −n. It stays so until the needle is 2 mm in; from there on it is
/// the line from P0 to the tip. (Closer to P0 a tip's noise of 60 µm is more than 2°.) Thread: one. Real-time
/// safe.
class AssumedAxis {
 public:
  /// Returns the tip's orientation for the next tick, for a tip at `p_WT_m`. `before`: the engine's state
  /// after the last tick.
  [[nodiscard]] Quat at(const SceneModel& model, const SimState& before, Vec3 p_WT_m) const noexcept;
  /// Stores the orientation of the stepped tick; an insertion keeps it.
  void keep(Quat q_WT) noexcept { kept_ = q_WT; }

 private:
  Quat kept_;
};

/// Inputs and results of a tick.
struct ChainTick {
  std::uint64_t tick = 0;  ///< includes missed ticks
  Pose X_WH, X_WT;         ///< handle and tip of the last accepted sample
  StepReport report;       ///< forces before the gate; in a skipped tick, those of the last stepped one
  Wrench rendered_W;       ///< after the gate, at the handle
  /// The same torque about the tip. Zero without a measured orientation: handle and tip are then points.
  Vec3 torque_at_tip_Nm;
  std::uint32_t gate_flags = 0;
  Fault fault = Fault::kNone;
  double plunger = 0;  ///< 0-1
  std::uint32_t buttons = 0;
};

/// Gate and engine behind a device's readings. Same readings, same bits. Allocates only in its constructor.
/// Thread: the haptic thread only. Real-time safe, in a body if its PathMaker is.
class HapticChain {
 public:
  /// `model` must outlive the chain. `X_HT` is the tool: the tip in the handle's frame. `paths` makes the
  /// paths in a body and must outlive the chain, too; null: they are made in place, which is not real-time
  /// safe.
  HapticChain(const SceneModel& model, const DeviceLimits& limits, const Pose& X_HT,
              PathMaker* paths = nullptr);
  /// For a given device. Without an orientation the chain assumes the needle's axis (AssumedAxis), and uses
  /// only the tool's offset, along W. For a device without torque it requests none, not even for the lever of
  /// the tool: the handle gets the tip's force. The plunger's source is the device's; `plunger.source` is
  /// ignored.
  HapticChain(const SceneModel& model, const DeviceInfo& device, const Pose& X_HT,
              PlungerSettings plunger = {}, PathMaker* paths = nullptr);

  /// One tick; `fresh` and `elapsed_ticks` as in ForceGate::admit; `share` scales the engine's wrench (1,
  /// less while a session fades out). Returns the device's wrench, also in `out.rendered_W`.
  GuardedWrench tick(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks, double share,
                     ChainTick& out) noexcept;

  /// Inserts a passivity control between engine and gate. Call before the first tick.
  void controlPassivity(const PassivitySettings& settings) noexcept {
    passivity_.emplace(settings, engine_.model().rate_hz);
  }
  /// Null without passivity control.
  [[nodiscard]] const PassivityControl* passivity() const noexcept {
    return passivity_ ? &*passivity_ : nullptr;
  }
  /// Begins with the needle's cap on, in a scene with PALPATION. Call before the first tick.
  void beginCapped() noexcept {
    wants_cap_ = true;
    engine_.wantCap(true);
  }
  /// Takes the cap off or puts it on, as kCapButton of the device does, once the tip is clear of the skin.
  void switchCap() noexcept {
    wants_cap_ = !wants_cap_;
    engine_.wantCap(wants_cap_);
  }
  [[nodiscard]] const ForceGate& gate() const noexcept { return gate_; }
  /// Acknowledges the fault for a person (ForceGate::acknowledge).
  void acknowledge() noexcept { gate_.acknowledge(); }
  /// Raises a FAULT that the program detected. Call it before `tick`, in each tick while the cause lasts
  /// (ForceGate::raiseFromOutside).
  void raiseFromOutside(Fault fault) noexcept { gate_.raiseFromOutside(fault); }

 private:
  [[nodiscard]] Pose tipOf(const Pose& X_WH) const noexcept;
  [[nodiscard]] Wrench stepped(const Pose& X_WH, const Pose& X_WT, double share) noexcept;
  void skipped(const Pose& X_WH, const Pose& X_WT) noexcept;

  const Limb& limb_;  // the scene's; in a body the engine's model has a path's plane
  SceneEngine engine_;
  Pose X_HT_;
  bool has_orientation_ = true, renders_torque_ = true;
  AssumedAxis assumed_axis_;
  std::optional<PassivityControl> passivity_;
  ForceGate gate_;
  Plunger plunger_;
  bool wants_cap_ = false, cap_button_pressed_ = false;
  StepReport report_{};
  Pose handle_, tip_;
  std::uint64_t next_tick_ = 0;
};

/// Returns the tick as a recorded sample. `time_ns` is the due time; the others are the durations of device
/// and engine.
GestureSample sampleOf(const ChainTick& tick, std::int64_t time_ns, std::int64_t device_ns,
                       std::int64_t engine_ns) noexcept;

}  // namespace needlelab
