#include "client/sim/stability/passivity_search.h"

#include <algorithm>

#include "client/sim/stability/passivity_shrink.h"

namespace needlelab {
namespace {

void worsen(PassivityRecord& worst, const PassivityRecord& one) {
  worst.finite = worst.finite && one.finite;
  for (double PassivityRecord::*member :
       {&PassivityRecord::max_force_N, &PassivityRecord::net_J, &PassivityRecord::worst_insertion_J,
        &PassivityRecord::worst_running_J, &PassivityRecord::worst_step_N,
        &PassivityRecord::worst_torque_step_Nm})
    worst.*member = std::max(worst.*member, one.*member);
  worst.ticks += one.ticks;
  worst.insertions += one.insertions;
  worst.flags |= one.flags;
}

}  // namespace

LimbShape shapeOf(std::uint64_t seed) {
  return static_cast<LimbShape>(seed % kLimbShapeNames.size());
}

CounterExample smallestOf(const PassivityGesture& gesture, const PassivityFinding& finding,
                          const PassivityLimits& limits, AxialModel model, const ForceSourceFactory& source) {
  const auto found = [&](const PassivityGesture& candidate) -> std::optional<PassivityFinding> {
    const auto record = runGesture(candidate, model, source);
    return record.ok() ? findingOf(*record, limits, finding.check) : std::nullopt;
  };
  CounterExample example;
  example.model = model;
  example.gesture = shrunk(gesture, [&](const PassivityGesture& candidate) {
                      return found(candidate).has_value();
                    }).gesture;
  example.finding = found(example.gesture).value_or(finding);
  return example;
}

Result<PassivityFindings> searchGestures(const PassivitySearch& search, AxialModel model,
                                         const ForceSourceFactory& source) {
  PassivityFindings findings;
  findings.worst.net_J = -1e9;  // nets of gestures are negative as a rule
  for (std::uint64_t seed = search.first_seed; seed < search.first_seed + search.gestures; ++seed) {
    PassivityGesture gesture = randomGesture(seed, shapeOf(seed), search.range);
    gesture.rate_hz = search.rate_hz;
    const auto record = runGesture(gesture, model, source);
    if (!record.ok()) return record.error();
    ++findings.gestures;
    if (judgedEnergy_J(*record) > judgedEnergy_J(findings.worst)) findings.energy_seed = seed;
    if (record->worst_step_N > findings.worst.worst_step_N) findings.step_seed = seed;
    worsen(findings.worst, *record);
    const auto finding = findingOf(*record, search.limits);
    if (!finding) continue;
    ++findings.failed;
    if (findings.counter_examples.size() >= search.most_counter_examples) continue;
    CounterExample example = smallestOf(gesture, *finding, search.limits, model, source);
    example.source = search.source_name;
    example.seed = seed;
    findings.counter_examples.push_back(std::move(example));
  }
  return findings;
}

}  // namespace needlelab
