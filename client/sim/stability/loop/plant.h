/// Force sources of the hard cases: the real engine, or in a test a variant with a planted defect.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "client/device/hand/simulated_device.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/passivity_control.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// One scene at one rate, with its state. Thread: one at a time.
class ForceSource {
 public:
  virtual ~ForceSource() = default;
  /// One tick, as needlelab::step.
  virtual void step(const TipSample& tip, StepReport& report) noexcept = 0;
  /// The steepest stiffness along the trajectory that can act at once, as SceneModel::axialStiffness_N_per_m.
  [[nodiscard]] virtual double axialStiffness_N_per_m() const noexcept = 0;
  /// What its springs hold, as heldEnergy_J.
  [[nodiscard]] virtual double held_J(const StepReport& /*report*/) const noexcept { return 0; }
  /// c of the last tick (FORCE_MODEL.md, "Contact"): the needle's slant to the skin; 1 when free.
  [[nodiscard]] virtual double slant() const noexcept { return 1; }
  /// u of the last tick; zero when free, or if the source does not provide it.
  [[nodiscard]] virtual Vec3 trajectory() const noexcept { return {}; }
};

/// Creates a source in its initial state. Errors: kInvalidInput, as `compile`.
using ForceSourceFactory =
    std::function<Result<std::unique_ptr<ForceSource>>(const SceneSpec& scene, double rate_hz)>;

/// The shipped engine: compiles once, then steps. FEM's compliance is computed on first use and kept in the
/// factory, so reuse one factory for many runs. Thread: one at a time.
ForceSourceFactory engineSource();

struct PlantOptions {
  SimulatedDeviceOptions device;  ///< delay in whole ticks of `rate_hz`; the plan is for the tip of its tool
  double rate_hz = 1000;
  double jitter_share = 0;  ///< a tick is late by up to this share of a period, [0, 1)
  /// Each wrench is delayed by additional whole ticks, uniformly from 0 to this; none overtakes another.
  std::uint32_t delay_spread_ticks = 0;
  double missing_share = 0;  ///< share of ticks without an update from the device, [0, 1)
  std::uint64_t seed = 1;    ///< for jitter and missing ticks
  std::optional<PassivitySettings> passivity = {};  ///< empty: no passivity control, the station's default
};

/// The record of one tick. Positions and forces are in W.
struct PlantTick {
  double time_s = 0;
  bool stepped = false;   ///< false: no update, or the gate rejected the sample; then `report` is the
                          ///< previous tick's
  TipSample seen;         ///< the tip as measured by the encoders
  Vec3 p_W_m;             ///< the true tip
  Vec3 v_W_mps;           ///< of the handle; without a tool it equals the tip's
  Vec3 w_W_radps;         ///< angular velocity of the handle
  StepReport report;      ///< forces before the gate
  Vec3 rendered_force_N;  ///< after the gate
  std::uint32_t gate_flags = 0;
  double passivity_share = 1;  ///< share of the report's wrench that the passivity control kept
  double slant = 1;            ///< c of the source, see ForceSource::slant
  double energy_J = 0;       ///< ∫ f·v dt of the rendered force since the start: energy given to the hand
  double turn_energy_J = 0;  ///< ∫ τ·ω dt of the rendered torque at the handle, likewise
  /// What the hand has received since the start: both of these minus the losses in the device's own damping
  /// and dry friction and the handle's kinetic energy. Falls while the hand pays for an insertion.
  double grip_J = 0;
};

/// Theoretical limits relative to the steepest stiffness of a run: K ≤ b/(T (½ + d)) (passiveStiffnessLimit).
/// Infinite for a run without stiffness.
struct LoopMargins {
  double coupled = 0;  ///< b of the device and the run's hand: stable with this hand
  double passive = 0;  ///< b of the device alone: passive, so stable with any hand. Below 1, stability
                       ///< depends on the hand
};

struct PlantRun {
  double rate_hz = 0;
  double axial_stiffness_N_per_m = 0;
  std::vector<PlantTick> ticks;
  Fault fault = Fault::kNone;  ///< first fault of the gate; the run continues without force
  LoopMargins margins = {};
  double grip_energy_J = 0;  ///< the greatest `grip_J` of a tick. A passive loop gives none; energy that
                             ///< the tissue absorbed earlier hides what it gives later (greatestRise). At
                             ///< least 0
};

/// Runs the plan to its end. Deterministic. Errors: kInvalidInput, as of SimulatedDevice::open.
Result<PlantRun> runPlant(ForceSource& source, const HandPlan& plan, const PlantOptions& options);

/// Settings for a passivity control with `options`' device and delay: counts the device's own damping.
PassivitySettings passivityOf(const PlantOptions& options);

/// The largest force that the passivity control removed, before the gate, in N; 0 without a control.
double greatestDistortion_N(const PlantRun& run);

/// The margins of a run. The stiffness along the trajectory acts against the handle's own damping; the
/// clamping stiffness, across the needle, also through the tool's lever. Uses the smaller of both. A hand
/// that lets go during the plan does not count.
LoopMargins marginsOf(const PlantRun& run, const PlantOptions& options);

}  // namespace needlelab
