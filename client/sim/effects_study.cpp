#include "client/sim/effects_study.h"

#include <algorithm>
#include <memory>

#include "client/effect_cost/instruction_count.h"
#include "client/effect_cost/tick_run.h"
#include "client/sim/tools/closed_loop.h"
#include "common/base/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr std::size_t kBatchTicks = 64, kBatchesInTurn = 8;
constexpr int kRounds = 120;        // at 15 ns a tick half a second in all
constexpr double kMostTime_s = 20;  // for models whose tick takes long
constexpr std::size_t kLeastRounds = 3;

// one set, ready to be stepped
struct Runner {
  std::unique_ptr<SceneModel> model;
  std::unique_ptr<TickRun> run;
  std::vector<double> means_ns = {};
};

Result<Runner> runnerOf(SceneSpec scene, EffectMask effects, double rate_hz,
                        const std::vector<TipSample>& gesture) {
  scene.effects = effects;
  ASSIGN_OR_RETURN(auto model, compile(scene, rate_hz));
  Runner runner{std::make_unique<SceneModel>(std::move(model)), nullptr};
  runner.run = std::make_unique<TickRun>(*runner.model, gesture);
  return runner;
}

}  // namespace

Result<SceneSpec> effectsScene(const std::filesystem::path& profile) {
  if (!profile.empty()) {
    ASSIGN_OR_RETURN(const auto loaded, loadProfile(profile));
    auto scene = sceneSpecOf(loaded);
    if (!scene.ok()) return scene;
    RETURN_IF_ERROR(addCompliance(*scene));
    return scene;
  }
  ASSIGN_OR_RETURN(auto scene, paperSceneSpec("paper-six-layers", Pose{}));
  // what the paper's six layers leave open: lateral stiffness and torque of its clamping experiment's size,
  // friction and membranes (future work there) of the size that soft tissue has
  static constexpr double kLateral_N_per_m2[] = {9000, 6000, 12000, 15000, 20000, 40000};
  static constexpr double kFriction_N_per_m[] = {18, 10, 14, 20, 25, 30};
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    scene.layers[i].lateral_stiffness_N_per_m2 = kLateral_N_per_m2[i % std::size(kLateral_N_per_m2)];
    scene.layers[i].friction_N_per_m = kFriction_N_per_m[i % std::size(kFriction_N_per_m)];
  }
  scene.orientation_limit = {0.5, 0.2};
  scene.layers.at(0).membrane = MembraneSpec{200, 20'000, 0.6};
  scene.layers.at(2).membrane = MembraneSpec{100, 60'000, 0.8};
  scene.layers.at(4).membrane = MembraneSpec{300, 0, 0.5};
  for (const EffectEntry* effect : effectEntries())
    if (effect->stage != nullptr) useUsualNumbers(*effect, scene);
  scene.effects = kAllEffects;
  return scene;
}

Result<std::vector<EffectMask>> effectSets(const SceneSpec& scene, double rate_hz) {
  ASSIGN_OR_RETURN(const auto model, compile(scene, rate_hz));
  std::vector<EffectMask> sets;
  for (EffectMask mask = 0; mask <= kAllEffects; ++mask)
    if ((mask & ~model.live) == 0) sets.push_back(mask);
  return sets;
}

Result<std::vector<EffectSetCost>> timeEffectSets(const SceneSpec& scene, double rate_hz,
                                                  const std::function<void(double)>& progress) {
  ASSIGN_OR_RETURN(const auto masks, effectSets(scene, rate_hz));
  const auto gesture = measuringGesture(scene, rate_hz);
  std::vector<Runner> runners;
  for (const EffectMask mask : masks) {
    ASSIGN_OR_RETURN(auto runner, runnerOf(scene, mask, rate_hz, gesture));
    runners.push_back(std::move(runner));
  }

  const std::int64_t from_ns = steadyNowNs();
  for (int round = 0; round < kRounds; ++round) {
    const double spent_s = static_cast<double>(steadyNowNs() - from_ns) * 1e-9;
    if (round >= static_cast<int>(kLeastRounds) && spent_s > kMostTime_s) break;
    progress(std::max(static_cast<double>(round) / kRounds, spent_s / kMostTime_s));
    for (Runner& runner : runners)
      measureBatches(
          kBatchesInTurn, kBatchTicks, [&] { runner.run->tick(); }, runner.means_ns);
  }
  progress(1);

  std::vector<EffectSetCost> sets;
  for (std::size_t i = 0; i < runners.size(); ++i)
    sets.push_back({masks[i], timingOf(std::move(runners[i].means_ns), kBatchTicks), {}});
  return sets;
}

Status runSetsForCounting(const SceneSpec& scene, double rate_hz) {
  ASSIGN_OR_RETURN(const auto masks, effectSets(scene, rate_hz));
  const auto gesture = measuringGesture(scene, rate_hz);
  for (const EffectMask mask : masks) {
    ASSIGN_OR_RETURN(auto runner, runnerOf(scene, mask, rate_hz, gesture));
    for (std::size_t k = 0; k < gesture.size(); ++k) runner.run->tick();
    endCountedPart();
  }
  return {};
}

Status countEffectSets(const std::vector<std::string>& command, std::size_t ticks,
                       std::vector<EffectSetCost>& sets) {
  ASSIGN_OR_RETURN(const auto counts, countStepInstructions(command, sets.size()));
  for (std::size_t i = 0; i < sets.size(); ++i)
    sets[i].instructions = static_cast<double>(counts[i]) / static_cast<double>(ticks);
  return {};
}

std::size_t ticksOfGesture(const SceneSpec& scene, double rate_hz) {
  return measuringGesture(scene, rate_hz).size();
}

std::vector<MarginalCost> marginalCosts(const std::vector<EffectSetCost>& sets) {
  std::vector<MarginalCost> costs;
  for (std::size_t i = 0; i < kEffectCount; ++i) {
    MarginalCost cost;
    cost.effect = static_cast<Effect>(i);
    std::vector<double> more_ns;
    double more_instructions = 0;
    bool counted = true;
    for (const EffectSetCost& with : sets) {
      if ((with.effects & bitOf(cost.effect)) == 0) continue;
      const auto without = std::find_if(sets.begin(), sets.end(), [&](const EffectSetCost& other) {
        return other.effects == (with.effects & ~bitOf(cost.effect));
      });
      if (without == sets.end()) continue;
      more_ns.push_back(with.timing.median_ns - without->timing.median_ns);
      counted = counted && with.instructions && without->instructions;
      if (counted) more_instructions += *with.instructions - *without->instructions;
    }
    if (more_ns.empty()) continue;
    const auto pairs = static_cast<double>(more_ns.size());
    for (const double ns : more_ns) cost.mean_ns += ns / pairs;
    cost.least_ns = *std::min_element(more_ns.begin(), more_ns.end());
    cost.most_ns = *std::max_element(more_ns.begin(), more_ns.end());
    if (counted) cost.instructions = more_instructions / pairs;
    costs.push_back(cost);
  }
  return costs;
}

}  // namespace needlelab
