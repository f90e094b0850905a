#include "client/sim/stability/scan_limits.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/stability/case.h"
#include "client/sim/stability/loop/stiffness_theory.h"
#include "client/sim/stability/scan_nudge.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"

namespace needlelab {
namespace {

constexpr double kMinStiffness_N_per_m = 20;
constexpr double kStep = 1.25;       // factor on the way up from a stable stiffness
constexpr double kPrecision = 1.02;  // of the bisection

// The largest K in (least, cap] that `stable` accepts when searching upward: the first rejected K ends the
// search, regardless of what lies above.
struct Found {
  double stiffness_N_per_m = 0;
  bool at_cap = false;
  int runs = 0;
};
Result<Found> largestStable(double guess, double least, double cap,
                            const std::function<Result<bool>(double)>& stable) {
  Found found;
  const auto ask = [&](double stiffness) {
    ++found.runs;
    return stable(stiffness);
  };
  // down to a stable stiffness, then up to an unstable one
  double low = std::clamp(guess, least, cap), high = 0;
  for (;;) {
    ASSIGN_OR_RETURN(const auto answer, ask(low));
    if (answer) break;
    high = low;
    low /= kStep;
    if (low < least) return found;
  }
  while (high == 0) {
    if (low >= cap) {
      found.at_cap = true;
      break;
    }
    const double next = std::min(cap, low * kStep);
    ASSIGN_OR_RETURN(const auto answer, ask(next));
    (answer ? low : high) = next;
  }
  while (!found.at_cap && high > low * kPrecision) {
    const double middle = std::sqrt(low * high);
    ASSIGN_OR_RETURN(const auto answer, ask(middle));
    (answer ? low : high) = middle;
  }
  found.stiffness_N_per_m = low;
  return found;
}

// the study's entry in cases.json
struct Study {
  SceneSpec wall;
  PlantOptions plant;
  NudgeOptions nudge;
  std::vector<double> rates_hz, delays;
  [[nodiscard]] double damping() const {
    return plant.device.limits.damping_Ns_per_m + plant.device.hand.damping_Ns_per_m;
  }
};

Result<Study> readStudy(const CaseSettings& settings) {
  CaseEntry entry(settings.file, "stiffness_limits", settings.long_form);
  Study study;
  study.wall = entry.scene();
  study.plant = entry.plant();
  study.nudge = nudgeOptionsOf(entry);
  study.rates_hz = entry.numbers("rates_hz");
  study.delays = entry.numbers("delays_ticks");
  if (!entry.status().ok()) return entry.status().error();
  return study;
}

// Finds one model's limit in the study's scene at one rate and delay.
Result<StiffnessLimitRow> limitAt(const Study& study, const ScannedModel& scene, double rate_hz,
                                  unsigned delay) {
  const SimulatedDeviceOptions& device = study.plant.device;
  StiffnessLimitRow row;
  row.model = scene.model();
  row.rate_hz = rate_hz;
  row.delay_ticks = delay;
  row.coupled_N_per_m = passiveStiffnessLimit(study.damping(), 1 / rate_hz, delay);
  row.passive_N_per_m = passiveStiffnessLimit(device.limits.damping_Ns_per_m, 1 / rate_hz, delay);
  row.sampled_N_per_m =
      sampledStiffnessLimit({device.limits.apparent_mass_kg, study.damping(), device.hand.stiffness_N_per_m,
                             1 / rate_hz, delay, scene.damping_Ns_per_m()});
  PlantOptions plant = study.plant;
  plant.rate_hz = rate_hz;
  plant.device.delay_ticks = delay;
  const auto stable = [&](double stiffness) -> Result<bool> {
    ASSIGN_OR_RETURN(const auto run,
                     nudge(engineSource(), scene.with(stiffness), stiffness, plant, study.nudge));
    if (run.outcome.stable) row.felt_N_per_m = run.outcome.wall_N_per_m;
    return run.outcome.stable;
  };
  ASSIGN_OR_RETURN(const auto found, largestStable(0.7 * row.coupled_N_per_m, kMinStiffness_N_per_m,
                                                   kMaxProfileStiffness_N_per_m, stable));
  row.stiffness_N_per_m = found.stiffness_N_per_m;
  row.at_cap = found.at_cap;
  row.runs = found.runs;
  return row;
}

// Scans one model at all rates and delays. Rows found before a failure are kept.
Status scanModel(const Study& study, AxialModel model, const std::function<void(double)>& tell,
                 StiffnessLimits& limits) {
  ASSIGN_OR_RETURN(const auto scene, ScannedModel::prepare(study.wall, model, study.plant, study.nudge));
  for (std::size_t r = 0; r < study.rates_hz.size(); ++r) {
    tell(static_cast<double>(r) / static_cast<double>(study.rates_hz.size()));
    for (const double delay : study.delays) {
      ASSIGN_OR_RETURN(const auto row,
                       limitAt(study, scene, study.rates_hz[r], static_cast<unsigned>(delay)));
      limits.rows.push_back(row);
    }
  }
  return {};
}

// ---- tables and pictures; the first column of a model's row is its index in kAxialModelNames

double place(AxialModel model) {
  return static_cast<double>(model);
}

nlohmann::ordered_json jsonOf(const StiffnessLimits& limits) {
  auto rows = nlohmann::ordered_json::array();
  for (const StiffnessLimitRow& row : limits.rows)
    rows.push_back({{"model", axialModelName(row.model)},
                    {"rate_hz", row.rate_hz},
                    {"delay_ticks", row.delay_ticks},
                    {"stiffness_n_per_m", row.stiffness_N_per_m},
                    {"at_cap", row.at_cap},
                    {"felt_n_per_m", row.felt_N_per_m},
                    {"coupled_n_per_m", row.coupled_N_per_m},
                    {"sampled_n_per_m", row.sampled_N_per_m},
                    {"passive_n_per_m", row.passive_N_per_m},
                    {"runs", row.runs}});
  return {{"rows", rows}, {"notes", limits.notes}};
}

std::string limitsCsv(const StiffnessLimits& limits) {
  PlotTable table(
      "model_index,rate_hz,delay_ticks,stiffness_n_per_m,at_cap,felt_n_per_m,coupled_n_per_m,sampled_n_per_m,"
      "runs,passive_n_per_m,model");
  for (const StiffnessLimitRow& row : limits.rows)
    table.row({place(row.model), row.rate_hz, static_cast<double>(row.delay_ticks), row.stiffness_N_per_m,
               row.at_cap ? 1.0 : 0.0, row.felt_N_per_m, row.coupled_N_per_m, row.sampled_N_per_m,
               static_cast<double>(row.runs), row.passive_N_per_m},
              {axialModelName(row.model)});
  return table.take();
}

}  // namespace

Result<StiffnessLimits> findStiffnessLimits(const CaseSettings& settings, const StabilityProgress& progress) {
  ASSIGN_OR_RETURN(const auto study, readStudy(settings));

  StiffnessLimits limits;
  constexpr double kParts = kAxialModelCount;
  for (std::size_t i = 0; i < kAxialModelCount; ++i) {
    const auto model = static_cast<AxialModel>(i);
    const auto tell = [&](double share) {
      if (progress)
        progress("largest stable stiffness, " + std::string(axialModelName(model)),
                 (static_cast<double>(i) + share) / kParts);
    };
    const Status done = scanModel(study, model, tell, limits);
    if (!done.ok()) limits.notes.push_back(std::string(axialModelName(model)) + ": " + done.error().message);
  }
  return limits;
}

Result<StiffnessLimits> drawStiffnessLimits(const std::filesystem::path& dir, const CaseSettings& settings,
                                            const StabilityProgress& progress) {
  ASSIGN_OR_RETURN(auto limits, findStiffnessLimits(settings, progress));
  const std::string json = jsonOf(limits).dump(2) + "\n";
  RETURN_IF_ERROR(writeFileAtomically(dir / "stiffness_limits.json", viewOf(json)));
  const auto csv = dir / "stiffness_limits.csv";
  RETURN_IF_ERROR(writeFileAtomically(csv, viewOf(limitsCsv(limits))));
  if (!hasGnuplot())
    limits.notes.push_back("gnuplot is not on the PATH: tables only, no pictures");
  else if (!limits.rows.empty())  // tables without rows get no picture
    RETURN_IF_ERROR(drawPlot("stiffness_limits", dir / "stiffness_limits.png",
                             {{"rows", static_cast<double>(limits.rows.size())}, {"csv", csv.string()}}));
  return limits;
}

}  // namespace needlelab
