#include "client/sim/stability/passivity_check.h"

#include <algorithm>

#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {

Result<PassivityRecord> runGesture(const PassivityGesture& gesture, AxialModel model,
                                   const ForceSourceFactory& make_source) {
  auto scene = sceneSpecOf(gesture.profile);
  if (!scene.ok()) return scene.error();
  auto source = make_source(likeForLike(*scene, model), gesture.rate_hz);
  if (!source.ok()) return source.error();
  PassivityObserver observer((*source)->axialStiffness_N_per_m());
  StepReport report;
  for (const TipSample& tip : samplesOf(gesture)) {
    (*source)->step(tip, report);
    observer.add(tip, report, (*source)->slant());
  }
  return observer.record();
}

double judgedEnergy_J(const PassivityRecord& record) {
  return std::max(record.net_J, record.worst_running_J);
}

std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits,
                                          PassivityCheck check) {
  switch (check) {
    case PassivityCheck::kFinite:
      if (!record.finite) return PassivityFinding{check, 1, 0};
      break;
    case PassivityCheck::kEnergy:
      if (const double energy = judgedEnergy_J(record); !(energy <= limits.energy_J))
        return PassivityFinding{check, energy, limits.energy_J};
      break;
    case PassivityCheck::kForceStep:
      if (!(record.worst_step_N <= limits.step_N))
        return PassivityFinding{check, record.worst_step_N, limits.step_N};
      break;
  }
  return std::nullopt;
}

std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits) {
  for (const auto check : {PassivityCheck::kFinite, PassivityCheck::kEnergy, PassivityCheck::kForceStep})
    if (auto finding = findingOf(record, limits, check)) return finding;
  return std::nullopt;
}

}  // namespace needlelab
