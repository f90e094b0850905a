/// What gives the force in a hard case: the real engine, or in a test a variant of it with a planted defect.
#pragma once

#include <functional>
#include <memory>

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
  /// c of the last tick (DESIGN §3.1): the needle's slant to the skin; 1 when free.
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

}  // namespace needlelab
