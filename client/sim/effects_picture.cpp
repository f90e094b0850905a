// The table of `needlelab-sim effects` for a terminal, and its picture.
#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cstdio>

#include "client/sim/effects_study.h"
#include "client/sim/tools/figure_table.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"
#include "common/base/text.h"

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
  return instructions ? formatted("%12.1f", *instructions) : formatted("%12s", "-");
}

}  // namespace

std::string effectsTable(const std::vector<EffectSetCost>& sets) {
  std::string text;
  for (const EffectEntry* effect : effectEntries()) text += fmt::format("{:<7}", effect->short_name);
  text += formatted("%10s %8s %10s %12s\n", "median ns", "p99 ns", "over none", "instructions");
  const double none_ns = costOfNone(sets);
  for (const EffectSetCost& set : fromTheCheapest(sets)) {
    for (const EffectEntry* effect : effectEntries())
      text += fmt::format("{:<7}", (set.effects & bitOf(effect->effect)) != 0 ? "x" : ".");
    text += formatted("%10.1f %8.1f %10.1f ", set.timing.median_ns, set.timing.p99_ns,
                      set.timing.median_ns - none_ns) +
            count(set.instructions) + "\n";
  }
  text += "\nwhat an effect adds, over all pairs of sets that differ in it only\n";
  text += formatted("%-18s %8s %8s %8s %12s\n", "effect", "mean ns", "least", "most", "instructions");
  for (const MarginalCost& cost : marginalCosts(sets))
    text += formatted("%-18s %8.1f %8.1f %8.1f ", effectWords(effectEntry(cost.effect)).c_str(), cost.mean_ns,
                      cost.least_ns, cost.most_ns) +
            count(cost.instructions) + "\n";
  if (!sets.empty())
    text += "median and p99 of " + std::to_string(sets.front().timing.batches) + " batches of " +
            std::to_string(sets.front().timing.per_batch) +
            " ticks with hot caches; torque and turn of the trajectory idle\n";
  return text;
}

Status drawEffects(const std::vector<EffectSetCost>& sets, const std::filesystem::path& folder) {
  // the sets from the cheapest on; the columns say which effects are in
  const auto sorted = fromTheCheapest(sets);
  std::string header = "place,count,median_ns,p99_ns";
  for (const EffectEntry* effect : effectEntries()) header += ',' + effectWords(*effect, '_');
  FigureTable table(header);
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    std::vector<double> row = {static_cast<double>(i + 1),
                               static_cast<double>(std::popcount(sorted[i].effects)),
                               sorted[i].timing.median_ns, sorted[i].timing.p99_ns};
    for (const EffectEntry* effect : effectEntries())
      row.push_back((sorted[i].effects & bitOf(effect->effect)) != 0 ? 1.0 : 0.0);
    table.row(row);
  }
  FigureTable marginal("place,mean_ns,least_ns,most_ns,effect");
  const auto costs = marginalCosts(sets);
  double most_ns = 0, least_ns = 0;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    marginal.row({static_cast<double>(i), costs[i].mean_ns, costs[i].least_ns, costs[i].most_ns},
                 {effectWords(effectEntry(costs[i].effect))});
    most_ns = std::max(most_ns, costs[i].most_ns);
    least_ns = std::min(least_ns, costs[i].least_ns);
  }
  const auto sets_csv = folder / "effects.csv", marginal_csv = folder / "effects_marginal.csv";
  for (auto& [path, text] : {std::pair{sets_csv, table.take()}, std::pair{marginal_csv, marginal.take()}})
    if (auto status = writeFileAtomically(path, viewOf(text)); !status.ok()) return status;
  if (!hasGnuplot() || sorted.empty()) return {};

  const double none_ns = costOfNone(sets), all_ns = sorted.back().timing.median_ns;
  std::string script = figureStyle();
  script += "set multiplot layout 1,2 title " +
            quoted("Only live effects cost: a tick takes " + fixed(none_ns, 1) + " ns with none and " +
                   fixed(all_ns, 1) + " ns with the costliest set") +
            " font ',15'\n";
  // left: every set
  script += "set lmargin 9\nset rmargin 3\nset bmargin 5\nset tmargin 5\nunset key\n";
  script += "set title 'all sets, from the cheapest on' font ',13'\nset xlabel 'sets of live effects'\n";
  script +=
      "set ylabel 'one tick, ns'\nset yrange [0:*]\nset xrange [0:" + std::to_string(sorted.size() + 1) +
      "]\nset grid y\n";
  script += "set key bottom right Left reverse\n";
  script +=
      "plot " + quoted(sets_csv.string()) +
      " skip 1 using 1:4 with points pt 2 ps 0.7 lc rgb '#7d8790' title 'p99 of batches', '' skip 1 using "
      "1:3 with points pt 7 ps 1.1 lc rgb '#1f5fa8' title 'median'\n";
  // right: what each adds
  script += "set title 'what each effect adds: mean, range over its pairs' font ',13'\n";
  script += "set xlabel 'added to a tick, ns'\nunset ylabel\nset lmargin 20\nunset key\nset grid x\n";
  script +=
      "set xrange [" + fixed(std::min(0.0, least_ns * 1.15), 2) + ":" + fixed(most_ns * 1.15, 2) + "]\n";
  script += "set yrange [" + fixed(static_cast<double>(costs.size()) - 0.4, 1) + ":-0.6]\nset ytics ()\n";
  script += "set boxwidth 0.55\nset style fill solid 0.85 noborder\n";
  script += "plot " + quoted(marginal_csv.string()) +
            " skip 1 using 2:1:(0):2:($1-0.28):($1+0.28):ytic(5) with boxxyerror lc rgb '#1f5fa8', '' skip 1 "
            "using 2:1:3:4 with xerrorbars pt 7 ps 0.6 lc rgb '#e07b1f' lw 2\n";
  script += "unset multiplot\n";
  return plotPng(script, folder / "effects.png", 1400, 640);
}

}  // namespace needlelab
