/// Force sources of the hard cases: the real engine, or in a test a variant with a planted defect.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "client/device/simulated_device.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
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
  SimulatedDeviceOptions device;  ///< delay in whole ticks of `rate_hz`; no tool
  double rate_hz = 1000;
  double jitter_share = 0;   ///< a tick comes late by up to this share of a period, [0, 1)
  double missing_share = 0;  ///< share of ticks in which the device gives no update, [0, 1)
  std::uint64_t seed = 1;    ///< of jitter and missing ticks
};

/// The record of one tick. Positions and forces are in W.
struct PlantTick {
  double time_s = 0;
  bool stepped = false;   ///< false: no update, or the gate rejected the sample; report as of the tick before
  TipSample seen;         ///< the tip as the encoders say
  Vec3 p_W_m, v_W_mps;    ///< the tip as it is
  Vec3 p_wanted_W_m;      ///< the hand's target, tremor included
  StepReport report;      ///< forces before the gate
  Vec3 rendered_force_N;  ///< after the gate
  std::uint32_t gate_flags = 0;
  double slant = 1;     ///< c of the source, see ForceSource::slant
  double energy_J = 0;  ///< ∫ f·v dt of the rendered force since the start: the energy given to the hand
};

struct PlantRun {
  double rate_hz = 0;
  double axial_stiffness_N_per_m = 0;
  std::vector<PlantTick> ticks;
  Fault fault = Fault::kNone;  ///< first fault of the gate; the run goes on without force
};

/// Runs the plan to its end. Deterministic. Errors: kInvalidInput, as of SimulatedDevice::open.
Result<PlantRun> runPlant(ForceSource& source, const HandPlan& plan, const PlantOptions& options);

}  // namespace needlelab
