#include "stability/force_source.h"

#include <utility>

namespace needlelab {
namespace {

class EngineSource final : public ForceSource {
 public:
  explicit EngineSource(SceneModel model) : model_(std::move(model)) {}
  void step(const TipSample& tip, StepReport& report) noexcept override {
    needlelab::step(model_, tip, state_, report);
  }
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
    return model_.axialStiffness_N_per_m();
  }
  [[nodiscard]] double slant() const noexcept override { return state_.inside ? state_.slant : 1; }
  [[nodiscard]] Vec3 trajectory() const noexcept override { return state_.inside ? state_.u_W : Vec3{}; }

 private:
  SceneModel model_;
  SimState state_{};
};

}  // namespace

ForceSourceFactory engineSource() {
  return [](const SceneSpec& scene, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    auto model = compile(scene, rate_hz);
    if (!model.ok()) return model.error();
    return std::unique_ptr<ForceSource>(std::make_unique<EngineSource>(*std::move(model)));
  };
}

}  // namespace needlelab
