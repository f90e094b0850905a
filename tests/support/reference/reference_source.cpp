#include "tests/support/reference/reference_source.h"

#include <utility>

namespace needlelab::test {
namespace {

class ReferenceSource final : public ForceSource {
 public:
  ReferenceSource(const SceneSpec& scene, double rate_hz, Defect planted, double axial_stiffness)
      : engine_(scene, rate_hz, planted), axial_stiffness_(axial_stiffness) {}
  void step(const TipSample& tip, StepReport& report) noexcept override { report = engine_.step(tip); }
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override { return axial_stiffness_; }
  [[nodiscard]] double slant() const noexcept override { return engine_.slant().value_or(1); }
  [[nodiscard]] Vec3 trajectory() const noexcept override { return engine_.direction().value_or(Vec3{}); }

 private:
  ReferenceEngine engine_;
  double axial_stiffness_;
};

}  // namespace

ForceSourceFactory referenceSource(Defect planted) {
  return [planted](SceneSpec scene, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    scene.axial_model = AxialModel::kEnhancedTrackingWall;
    const auto model = compile(scene, rate_hz);
    if (!model.ok()) return model.error();
    return std::unique_ptr<ForceSource>(
        std::make_unique<ReferenceSource>(scene, rate_hz, planted, model->axialStiffness_N_per_m()));
  };
}

}  // namespace needlelab::test
