/// Force sources of the hard cases: the real engine, or in a test a variant with a planted defect.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "client/device/simulated_device.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/passivity_control.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// One scene at one rate, with its state. Thread: one at a time.
class ForceSource {
 public:
  virtual ~ForceSource() = default;
  /// One tick, as needlelab::step.
  virtual void step(const TipSample& tip, StepReport& report) noexcept = 0;
  /// Steepest stiffness along the trajectory that can act at once, as SceneModel::axialStiffness_N_per_m.
  [[nodiscard]] virtual double axialStiffness_N_per_m() const noexcept = 0;
  /// c of the last tick (FORCE_MODEL.md, "Contact"): the needle's slant to the skin; 1 when free.
  [[nodiscard]] virtual double slant() const noexcept { return 1; }
  /// u of the last tick; zero when free, or when the source does not say.
  [[nodiscard]] virtual Vec3 trajectory() const noexcept { return {}; }
};

/// A new source, as before the first tick. Errors: kInvalidInput as of `compile`.
using ForceSourceFactory =
    std::function<Result<std::unique_ptr<ForceSource>>(const SceneSpec& scene, double rate_hz)>;

/// The engine that ships: compile once, then step. FEM's compliance is made on the first use and kept with
/// the factory: hold one factory over many runs. Thread: one at a time.
ForceSourceFactory engineSource();

struct PlantOptions {
  SimulatedDeviceOptions device;  ///< delay in whole ticks of `rate_hz`; the plan is for the tip of its tool
  double rate_hz = 1000;
  double jitter_share = 0;  ///< a tick comes late by up to this share of a period, [0, 1)
  /// Each wrench comes so many whole ticks later, drawn evenly from 0 to this; none overtakes another.
  std::uint32_t delay_spread_ticks = 0;
  double missing_share = 0;  ///< share of ticks in which the device gives no update, [0, 1)
  std::uint64_t seed = 1;    ///< of jitter and missing ticks
  std::optional<PassivitySettings> passivity = {};  ///< none: no passivity control, as the station's default
};

/// The record of one tick. Positions and forces are in W.
struct PlantTick {
  double time_s = 0;
  bool stepped = false;   ///< false: no update, or the gate rejected the sample; report as of the tick before
  TipSample seen;         ///< the tip as the encoders say
  Vec3 p_W_m;             ///< the tip as it is
  Vec3 v_W_mps;           ///< of the handle, which is the tip's without a tool
  Vec3 w_W_radps;         ///< angular velocity of the handle
  StepReport report;      ///< forces before the gate
  Vec3 rendered_force_N;  ///< after the gate
  std::uint32_t gate_flags = 0;
  double passivity_share = 1;  ///< what the passivity control left of the report's wrench
  double slant = 1;            ///< c of the source, see ForceSource::slant
  double energy_J = 0;  ///< ∫ f·v dt of the rendered force since the start: the energy given to the hand
  double turn_energy_J = 0;  ///< ∫ τ·ω dt of the rendered torque at the handle, likewise
};

/// What theory allows, over the steepest stiffness of a run: K ≤ b/(T (½ + d)) (passiveStiffnessLimit).
/// Infinite where the run has no stiffness.
struct LoopMargins {
  double coupled = 0;  ///< b of the device and of the run's hand: stable with this hand
  double passive = 0;  ///< b of the device alone: passive, so stable whatever the hand. Below 1 it is the
                       ///< hand that keeps the loop stable
};

struct PlantRun {
  double rate_hz = 0;
  double axial_stiffness_N_per_m = 0;
  std::vector<PlantTick> ticks;
  Fault fault = Fault::kNone;  ///< first fault of the gate; the run goes on without force
  LoopMargins margins = {};
  double grip_energy_J = 0;  ///< as greatestGripEnergy_J
};

/// Runs the plan to its end. Deterministic. Errors: kInvalidInput, as of SimulatedDevice::open.
Result<PlantRun> runPlant(ForceSource& source, const HandPlan& plan, const PlantOptions& options);

/// What the passivity control of `options`' device and delay counts: the device's own damping.
PassivitySettings passivityOf(const PlantOptions& options);

/// The greatest force that the passivity control took off, before the gate; 0 without one. In N.
double greatestDistortion_N(const PlantRun& run);

/// Damping that a motion of the tip across the needle meets: handle and lever give way one after the other,
/// 1/b_tip = 1/b + lever²/b_turn. In N·s/m; 0 where one of both is 0.
double dampingAcross(double damping_Ns_per_m, double rotational_damping_Nms_per_rad, double lever_m);

/// The margins of a run: the stiffness along the trajectory acts on the handle's own damping, the clamping
/// stiffness, which acts across the needle, also through the tool's lever. The lesser of both. A hand that
/// lets go within the plan counts as none.
LoopMargins marginsOf(const PlantRun& run, const PlantOptions& options);

/// The greatest energy, at any moment since the start, that the rendered wrench had given beyond the losses
/// in the device's own damping and dry friction and the handle's kinetic energy: the hand has got it. A
/// passive loop gives none; energy that the tissue took before hides what it gives later. At least 0. In J.
double greatestGripEnergy_J(const PlantRun& run, const SimulatedDeviceOptions& device);

}  // namespace needlelab
