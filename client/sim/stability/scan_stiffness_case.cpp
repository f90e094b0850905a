/// The largest stiffness that theory allows for, less a tenth, at every rate and delay: a nudge must die out.
#include <algorithm>
#include <cstdio>
#include <string>

#include "stability/closed_loop_case.h"
#include "stability/scan_cases.h"
#include "stability/scan_model.h"
#include "stability/scan_nudge.h"
#include "stability/scan_theory.h"

namespace needlelab {
namespace {

constexpr double kMaxProfileStiffness_N_per_m = 10'000;  // DESIGN §4

std::string pointText(double stiffness_N_per_m, const PlantOptions& plant) {
  char text[100];
  std::snprintf(text, sizeof text, "K %.0f N/m, %g Hz, %u ticks late", stiffness_N_per_m, plant.rate_hz,
                static_cast<unsigned>(plant.device.delay_ticks));
  return text;
}

}  // namespace

Result<CaseOutcome> stiffnessScan(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "stiffness_scan", settings.long_form);
  const SceneSpec scene = entry.scene();
  PlantOptions plant = entry.plant();
  const NudgeOptions options = nudgeOptionsOf(entry);
  const auto rates = entry.numbers("rates_hz"), delays = entry.numbers("delays_ticks"),
             shares = entry.numbers("shares");
  const BandFilter band = entry.chatterFilter();
  if (!entry.status().ok()) return entry.status().error();

  const auto scanned = ScannedModel::prepare(scene, model, plant, options);
  if (!scanned.ok()) return scanned.error();
  const std::size_t points = rates.size() * delays.size() * shares.size();
  CaseTally tally("nudges of " + std::to_string(points) + " that do not die out", 0, band);
  const double damping = plant.device.limits.damping_Ns_per_m + plant.device.hand.damping_Ns_per_m;
  int swinging = 0;
  std::string note;
  for (const double rate : rates)
    for (const double delay : delays)
      for (const double share : shares) {
        plant.rate_hz = rate;
        plant.device.delay_ticks = static_cast<std::uint32_t>(delay);
        const double stiffness =
            std::min(share * passiveStiffnessLimit(damping, 1 / rate, delay), kMaxProfileStiffness_N_per_m);
        const auto run = nudge(source, scanned->with(stiffness), stiffness, plant, options);
        if (!run.ok()) return run.error();
        const std::string point = pointText(stiffness, plant);
        if (!run->outcome.stable) {
          ++swinging;
          note = "swings on at " + point;
        }
        const bool diverges = !run->outcome.finite || run->outcome.fault != Fault::kNone;
        tally.add(run->run, run->watch, swinging, point, diverges);
      }
  CaseOutcome outcome = tally.finish();
  outcome.row.note = note;
  return outcome;
}

}  // namespace needlelab
