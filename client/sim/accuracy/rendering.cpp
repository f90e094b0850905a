#include "client/sim/accuracy/rendering.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

namespace {

double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N + report.friction_N + report.puncture_N;
}

}  // namespace

std::vector<double> axialForces(const SceneModel& model, const StudyGesture& gesture) {
  SimState state{};
  StepReport report;
  std::vector<double> forces_N;
  forces_N.reserve(gesture.tips.size());
  for (const TipSample& tip : gesture.tips) {
    step(model, tip, state, report);
    forces_N.push_back(axialOf(report));
  }
  return forces_N;
}

bool isRelease(std::uint32_t flags, double before_N, double after_N) {
  return (flags & (kFlagLayerChange | kFlagRupture | kFlagExit)) != 0 &&
         std::abs(after_N) < std::abs(before_N);
}

double greatestStep_N(const SceneModel& model, const StudyGesture& gesture) {
  SimState state{};
  StepReport report;
  double step_N = 0, before_N = 0;
  for (const TipSample& tip : gesture.tips) {
    step(model, tip, state, report);
    const double now_N = axialOf(report);
    if (!isRelease(report.flags, before_N, now_N)) step_N = std::max(step_N, std::abs(now_N - before_N));
    before_N = now_N;
  }
  return step_N;
}

ErrorSum errorInTissue(const SceneModel& model, const StudyGesture& gesture,
                       const std::vector<double>& forces_N, const std::vector<double>& reference_N) {
  ErrorSum sum;
  for (std::size_t i = 0; i < forces_N.size(); ++i)
    if (signedDepth(model.limb, gesture.tips[i].p_WT_m) > 0) sum.add(forces_N[i] - reference_N[i]);
  return sum;
}

Timing timeSteps(const SceneModel& model, const StudyGesture& gesture, double budget_s) {
  SimState state{};
  StepReport report;
  std::size_t i = 0;
  return timeFor(budget_s, [&] {
    if (i == gesture.tips.size()) {
      state = {};
      i = 0;
    }
    step(model, gesture.tips[i++], state, report);
    keep(report);
  });
}

}  // namespace needlelab
