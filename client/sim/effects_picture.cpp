// The table of `needlelab-sim effects` for a terminal, and its picture.
#include <fmt/core.h>

#include <algorithm>
#include <bit>

#include "client/sim/effects_study.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"

namespace needlelab {
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
                        cost.mean_ns, cost.least_ns, cost.most_ns) +
            count(cost.instructions) + "\n";
  if (!sets.empty())
    text += fmt::format(
        "median and p99 of {} batches of {} ticks with hot caches; torque and turn of the trajectory idle\n",
        sets.front().timing.batches, sets.front().timing.per_batch);
  return text;
}

Status drawEffects(const std::vector<EffectSetCost>& sets, const std::filesystem::path& folder) {
  // the sets from the cheapest on; the columns say which effects are in
  const auto sorted = fromTheCheapest(sets);
  std::string header = "place,count,median_ns,p99_ns";
  for (const EffectEntry* effect : effectEntries()) header += ',' + effectWords(*effect, '_');
  PlotTable table(header);
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    std::vector<double> row = {static_cast<double>(i + 1),
                               static_cast<double>(std::popcount(sorted[i].effects)),
                               sorted[i].timing.median_ns, sorted[i].timing.p99_ns};
    for (const EffectEntry* effect : effectEntries())
      row.push_back((sorted[i].effects & bitOf(effect->effect)) != 0 ? 1.0 : 0.0);
    table.row(row);
  }
  PlotTable marginal("place,mean_ns,least_ns,most_ns,effect");
  const auto costs = marginalCosts(sets);
  for (std::size_t i = 0; i < costs.size(); ++i)
    marginal.row({static_cast<double>(i), costs[i].mean_ns, costs[i].least_ns, costs[i].most_ns},
                 {effectWords(effectEntry(costs[i].effect))});
  const auto sets_csv = folder / "effects.csv", marginal_csv = folder / "effects_marginal.csv";
  for (auto& [path, text] : {std::pair{sets_csv, table.take()}, std::pair{marginal_csv, marginal.take()}})
    RETURN_IF_ERROR(writeFileAtomically(path, viewOf(text)));
  if (!hasGnuplot() || sorted.empty()) return {};

  return drawPlot("effects", folder / "effects.png",
                  {{"csv", sets_csv.string()},
                   {"marginal", marginal_csv.string()},
                   {"none_ns", costOfNone(sets)},
                   {"all_ns", sorted.back().timing.median_ns}});
}

}  // namespace needlelab
