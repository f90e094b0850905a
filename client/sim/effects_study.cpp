#include "client/sim/effects_study.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "client/effect_cost/tick_cost.h"
#include "client/sim/tools/closed_loop.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

constexpr std::size_t kBatchTicks = 64, kBatchesInTurn = 8;
constexpr int kRounds = 120;       // half a second in total at 15 ns per tick
constexpr double kMaxTime_s = 20;  // for models with a slow tick
constexpr std::size_t kMinRounds = 3;

// A set that is ready to be stepped.
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
  // Numbers that the paper's six layers leave open. Lateral stiffness and torque have the size of its
  // clamping experiment; friction and membranes (future work there) have typical sizes of soft tissue.
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
    if (!isPlaced(effect->effect)) useUsualNumbers(*effect, scene);
  scene.effects = kNeedleEffects;
  return scene;
}

Result<std::vector<EffectMask>> effectSets(const SceneSpec& scene, double rate_hz) {
  ASSIGN_OR_RETURN(const auto model, compile(scene, rate_hz));
  std::vector<EffectMask> sets;
  for (EffectMask mask = 0; mask <= kNeedleEffects; ++mask)
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
    if (round >= static_cast<int>(kMinRounds) && spent_s > kMaxTime_s) break;
    progress(std::max(static_cast<double>(round) / kRounds, spent_s / kMaxTime_s));
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
    std::vector<double> more_instructions;
    for (const EffectSetCost& with : sets) {
      if ((with.effects & bitOf(cost.effect)) == 0) continue;
      const auto without = std::find_if(sets.begin(), sets.end(), [&](const EffectSetCost& other) {
        return other.effects == (with.effects & ~bitOf(cost.effect));
      });
      if (without == sets.end()) continue;
      more_ns.push_back(with.timing.median_ns - without->timing.median_ns);
      if (with.instructions && without->instructions)
        more_instructions.push_back(*with.instructions - *without->instructions);
    }
    if (more_ns.empty()) continue;
    const auto pairs = static_cast<double>(more_ns.size());
    for (const double ns : more_ns) cost.mean_ns += ns / pairs;
    cost.min_ns = *std::min_element(more_ns.begin(), more_ns.end());
    cost.max_ns = *std::max_element(more_ns.begin(), more_ns.end());
    if (more_instructions.size() == more_ns.size()) {
      cost.instructions = 0;
      for (const double more : more_instructions) *cost.instructions += more / pairs;
      cost.min_instructions = *std::min_element(more_instructions.begin(), more_instructions.end());
      cost.max_instructions = *std::max_element(more_instructions.begin(), more_instructions.end());
    }
    costs.push_back(cost);
  }
  return costs;
}

namespace {

std::vector<EffectSetCost> fromTheCheapest(std::vector<EffectSetCost> sets) {
  std::stable_sort(sets.begin(), sets.end(), [](const EffectSetCost& a, const EffectSetCost& b) {
    return a.timing.median_ns < b.timing.median_ns;
  });
  return sets;
}

double costOfNone(const std::vector<EffectSetCost>& sets) {
  const auto none =
      std::find_if(sets.begin(), sets.end(), [](const EffectSetCost& set) { return set.effects == 0; });
  return none == sets.end() ? 0 : none->timing.median_ns;
}

std::string count(const std::optional<double>& instructions) {
  return instructions ? fmt::format("{:12.1f}", *instructions) : fmt::format("{:>12}", "-");
}

}  // namespace

std::string effectsTable(const std::vector<EffectSetCost>& sets) {
  std::string text;
  for (const EffectEntry* effect : effectEntries()) text += fmt::format("{:<7}", effect->short_name);
  text += fmt::format("{:>10} {:>8} {:>10} {:>12}\n", "median ns", "p99 ns", "over none", "instructions");
  const double none_ns = costOfNone(sets);
  for (const EffectSetCost& set : fromTheCheapest(sets)) {
    for (const EffectEntry* effect : effectEntries())
      text += fmt::format("{:<7}", (set.effects & bitOf(effect->effect)) != 0 ? "x" : ".");
    text += fmt::format("{:10.1f} {:8.1f} {:10.1f} ", set.timing.median_ns, set.timing.p99_ns,
                        set.timing.median_ns - none_ns) +
            count(set.instructions) + "\n";
  }
  text += "\nwhat an effect adds, over all pairs of sets that differ in it only\n";
  text +=
      fmt::format("{:<18} {:>8} {:>8} {:>8} {:>12}\n", "effect", "mean ns", "least", "most", "instructions");
  for (const MarginalCost& cost : marginalCosts(sets))
    text += fmt::format("{:<18} {:8.1f} {:8.1f} {:8.1f} ", effectWords(effectEntry(cost.effect)),
                        cost.mean_ns, cost.min_ns, cost.max_ns) +
            count(cost.instructions) + "\n";
  if (!sets.empty())
    text += fmt::format(
        "median and p99 of {} batches of {} ticks with hot caches; torque and turn of the trajectory idle\n",
        sets.front().timing.batches, sets.front().timing.per_batch);
  return text;
}

Status drawEffects(const std::vector<EffectSetCost>& sets, const std::filesystem::path& folder) {
  const bool counted = std::all_of(sets.begin(), sets.end(),
                                   [](const EffectSetCost& set) { return set.instructions.has_value(); });
  const std::string unit = counted ? "instructions" : "ns";
  const auto costOf = [counted](const EffectSetCost& set) {
    return counted ? *set.instructions : set.timing.median_ns;
  };
  // cheapest sets first; the columns show which effects are included
  auto sorted = fromTheCheapest(sets);
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const EffectSetCost& a, const EffectSetCost& b) { return costOf(a) < costOf(b); });
  std::string header = "place,count,cost_" + unit + ",median_ns,p99_ns";
  for (const EffectEntry* effect : effectEntries()) header += ',' + effectWords(*effect, '_');
  PlotTable table(header);
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    std::vector<double> row = {static_cast<double>(i + 1),
                               static_cast<double>(std::popcount(sorted[i].effects)), costOf(sorted[i]),
                               sorted[i].timing.median_ns, sorted[i].timing.p99_ns};
    for (const EffectEntry* effect : effectEntries())
      row.push_back((sorted[i].effects & bitOf(effect->effect)) != 0 ? 1.0 : 0.0);
    table.row(row);
  }
  PlotTable marginal("place,mean_" + unit + ",least_" + unit + ",most_" + unit + ",effect");
  const auto costs = marginalCosts(sets);
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const MarginalCost& cost = costs[i];
    const std::string words = effectWords(effectEntry(cost.effect));
    if (counted)
      marginal.row({static_cast<double>(i), *cost.instructions, cost.min_instructions, cost.max_instructions},
                   {words});
    else
      marginal.row({static_cast<double>(i), cost.mean_ns, cost.min_ns, cost.max_ns}, {words});
  }
  const auto sets_csv = folder / "effects.csv", marginal_csv = folder / "effects_marginal.csv";
  for (auto& [path, text] : {std::pair{sets_csv, table.take()}, std::pair{marginal_csv, marginal.take()}})
    RETURN_IF_ERROR(writeFileAtomically(path, viewOf(text)));
  if (!hasGnuplot() || sorted.empty()) return {};

  const auto none =
      std::find_if(sets.begin(), sets.end(), [](const EffectSetCost& set) { return set.effects == 0; });
  return drawPlot("effects", folder / "effects.png",
                  {{"csv", sets_csv.string()},
                   {"marginal", marginal_csv.string()},
                   {"unit", unit},
                   {"of_none", none == sets.end() ? 0.0 : costOf(*none)},
                   {"of_all", costOf(sorted.back())}});
}

}  // namespace needlelab
