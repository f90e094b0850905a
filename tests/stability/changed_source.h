/// The shipped engine followed by a defect: controls for the cases of prescribed motion.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "client/sim/stability/loop/plant.h"

namespace needlelab::test {

/// Applied to a tick's report after the engine.
using Change = std::function<void(const TipSample& tip, ForceSource& inner, StepReport& report)>;
/// A source that wraps another one.
class ChangedSource final : public ForceSource {
 public:
  ChangedSource(std::unique_ptr<ForceSource> inner, Change change)
      : inner_(std::move(inner)), change_(std::move(change)) {}
  void step(const TipSample& tip, StepReport& report) noexcept override {
    inner_->step(tip, report);
    change_(tip, *inner_, report);
  }
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
    return inner_->axialStiffness_N_per_m();
  }
  [[nodiscard]] double slant() const noexcept override { return inner_->slant(); }
  [[nodiscard]] Vec3 trajectory() const noexcept override { return inner_->trajectory(); }

 private:
  std::unique_ptr<ForceSource> inner_;
  Change change_;
};
/// The engine followed by `change`.
inline ForceSourceFactory changed(Change change) {
  return [change = std::move(change)](const SceneSpec& scene,
                                      double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    auto inner = engineSource()(scene, rate_hz);
    if (!inner.ok()) return inner.error();
    return std::unique_ptr<ForceSource>(std::make_unique<ChangedSource>(std::move(*inner), change));
  };
}
/// The engine, but with the scene changed before it is compiled.
inline ForceSourceFactory ofScene(std::function<void(SceneSpec&)> change) {
  return [change = std::move(change)](SceneSpec scene, double rate_hz) {
    change(scene);
    return engineSource()(scene, rate_hz);
  };
}

}  // namespace needlelab::test
