#include "client/effect_cost/calibration.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "client/effect_cost/tick_run.h"
#include "common/base/median.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kBatchTicks = 64;
constexpr std::size_t kLeastBatches = 3;

// the scene with one set of effects, and the durations of its batches
struct Variant {
  std::unique_ptr<SceneModel> model;
  std::unique_ptr<TickRun> run;
  std::vector<double> batch_ns = {};  ///< per tick
};

}  // namespace

Result<EffectCosts> calibrateEffects(const SceneSpec& scene, double rate_hz, double budget_s) {
  const std::int64_t until_ns = steadyNowNs() + static_cast<std::int64_t>(budget_s * 1e9);
  const auto whole = compile(scene, rate_hz);
  if (!whole.ok()) return whole.error();
  const auto gesture = measuringGesture(scene, rate_hz);

  // the first one has all effects
  EffectCosts costs;
  std::vector<Variant> variants;
  const auto add = [&](EffectMask effects) -> Status {
    SceneSpec some = scene;
    some.effects = effects;
    auto model = compile(some, rate_hz);
    if (!model.ok()) return model.error();
    Variant variant{std::make_unique<SceneModel>(*std::move(model)), nullptr};
    variant.run = std::make_unique<TickRun>(*variant.model, gesture);
    variants.push_back(std::move(variant));
    return {};
  };
  if (auto status = add(whole->live); !status.ok()) return status.error();
  for (std::size_t i = 0; i < kEffectCount; ++i) {
    const auto effect = static_cast<Effect>(i);
    if (!whole->isLive(effect)) continue;
    if (auto status = add(whole->live & ~bitOf(effect)); !status.ok()) return status.error();
    costs.effects.push_back({effect, 0});
  }

  // run one batch of each in turn; the first round only warms up
  for (std::size_t round = 0; round <= kLeastBatches || steadyNowNs() < until_ns; ++round)
    for (Variant& variant : variants) {
      const std::int64_t from_ns = steadyNowNs();
      for (std::size_t i = 0; i < kBatchTicks; ++i) variant.run->tick();
      const auto took_ns = static_cast<double>(steadyNowNs() - from_ns) - clockCost_ns();
      if (round > 0) variant.batch_ns.push_back(std::max(0.0, took_ns) / kBatchTicks);
    }

  costs.tick_ns = medianOf(variants.front().batch_ns);
  for (std::size_t i = 0; i < costs.effects.size(); ++i) {
    std::vector<double> more_ns = variants.front().batch_ns;
    for (std::size_t b = 0; b < more_ns.size(); ++b) more_ns[b] -= variants[i + 1].batch_ns[b];
    costs.effects[i].ns = medianOf(std::move(more_ns));
  }
  return costs;
}

}  // namespace needlelab
