// The cost of a haptic tick, beside the literal transcription of DESIGN §3 in the same run. A benchmark, not
// a test.
//   build/release/bin/needlelab_step_bench --benchmark_repetitions=9 --benchmark_report_aggregates_only
#include <benchmark/benchmark.h>

#include "haptics/engine.h"
#include "support/motions.h"
#include "support/reference_engine.h"
#include "support/scenes.h"

namespace {

using namespace needlelab;
using namespace needlelab::test;

constexpr double kRateHz = 1000;

// in through all six layers, a hold, and out; the axis tilted by `tangent` from the trajectory half way in
Motion lesson(double tangent) {
  const Site site = defaultSite();
  const Vec3 top = -site.inward * 0.005, deep = site.inward * 0.035;
  const Vec3 aside = site.across_1 * 0.0005;
  MotionBuilder builder(kRateHz, top, site.inward);
  builder.moveTo(site.inward * 0.018 + aside, 1.0);
  builder.moveTo(deep + aside, tilted(site.inward, tangent, site.across_1), 1.0).hold(1.0).moveTo(top, 1.0);
  return withTremor(builder.take(), kRateHz, 20e-6, 1);
}

void stepThrough(benchmark::State& state, const SceneSpec& scene, double tangent) {
  const SceneModel model = *compile(scene, kRateHz);
  const Motion motion = lesson(tangent);
  StepReport report;
  for (auto _ : state) {
    SimState sim{};
    for (const TipSample& sample : motion) {
      step(model, sample, sim, report);
      benchmark::DoNotOptimize(report);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(motion.size()));
}

void referenceThrough(benchmark::State& state, const SceneSpec& scene) {
  const Motion motion = lesson(0);
  for (auto _ : state) {
    ReferenceEngine reference(scene, kRateHz);
    for (const TipSample& sample : motion) {
      auto report = reference.step(sample);
      benchmark::DoNotOptimize(report);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(motion.size()));
}

BENCHMARK_CAPTURE(stepThrough, no_effect, withEffects(paperSixLayers(), 0), 0.0);
BENCHMARK_CAPTURE(stepThrough, wall_only, withEffects(paperSixLayers(), bitOf(Effect::kCutting)), 0.0);
BENCHMARK_CAPTURE(stepThrough, paper_four_effects, paperSixLayers(), 0.0);
BENCHMARK_CAPTURE(stepThrough, paper_with_torque, paperSixLayers(), 0.9);
BENCHMARK_CAPTURE(stepThrough, all_six_effects, allEffects(), 0.0);
BENCHMARK_CAPTURE(referenceThrough, paper_four_effects, paperSixLayers());

}  // namespace

BENCHMARK_MAIN();
