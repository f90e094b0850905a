/// The largest stiffness that theory allows for, less a tenth, at every rate and delay: a nudge must die out.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/scan_cases.h"
#include "client/sim/stability/scan_model.h"
#include "client/sim/stability/scan_nudge.h"
#include "client/sim/stability/scan_theory.h"

namespace needlelab {
namespace {

struct Point {
  double hand_N_per_m = 0, hand_Ns_per_m = 0;
  double rate_hz = 0, delay_ticks = 0;
  double share = 0;  // of the theory's limit
};

std::string pointText(double stiffness_N_per_m, const PlantOptions& plant) {
  char text[120];
  std::snprintf(text, sizeof text, "K %.0f N/m, %g Hz, %u ticks late, hand %g N/m", stiffness_N_per_m,
                plant.rate_hz, static_cast<unsigned>(plant.device.delay_ticks),
                plant.device.hand.stiffness_N_per_m);
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
  // other hands, from nearly free to stiff, at the plant's own rate
  const auto stiffnesses = entry.numbers("hands.stiffness_n_per_m"),
             dampings = entry.numbers("hands.damping_ns_per_m");
  const BandFilter band = entry.chatterFilter();
  if (!entry.status().ok()) return entry.status().error();

  std::vector<Point> points;
  const HandOptions own = plant.device.hand;
  for (const double rate : rates)
    for (const double delay : delays)
      for (const double share : shares)
        points.push_back({own.stiffness_N_per_m, own.damping_Ns_per_m, rate, delay, share});
  for (std::size_t i = 0; i < std::min(stiffnesses.size(), dampings.size()); ++i)
    for (const double delay : delays)
      points.push_back({stiffnesses[i], dampings[i], plant.rate_hz, delay, shares.back()});

  const auto scanned = ScannedModel::prepare(scene, model, plant, options);
  if (!scanned.ok()) return scanned.error();
  CaseTally tally("nudges of " + std::to_string(points.size()) + " that do not die out", 0, band);
  int swinging = 0;
  std::string note;
  for (const Point& at : points) {
    plant.rate_hz = at.rate_hz;
    plant.device.delay_ticks = static_cast<std::uint32_t>(at.delay_ticks);
    plant.device.hand.stiffness_N_per_m = at.hand_N_per_m;
    plant.device.hand.damping_Ns_per_m = at.hand_Ns_per_m;
    const double damping = plant.device.limits.damping_Ns_per_m + at.hand_Ns_per_m;
    const double stiffness =
        std::min(at.share * passiveStiffnessLimit(damping, 1 / at.rate_hz, at.delay_ticks),
                 kMaxProfileStiffness_N_per_m);
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
