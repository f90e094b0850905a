#include "client/sim/accuracy/recorded_text.h"

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/rendering.h"

namespace needlelab {

std::string addTickTime(const SceneModel& model, const StraightGesture& gesture, AccuracyRow& row) {
  constexpr std::size_t kBatches = 300, kPerBatch = 64;
  constexpr Quat kDown{1, 0, 0, 0};
  SimState state{};
  StepReport report;
  std::size_t tick = 0;
  const Timing timing = timeBatches(kBatches, kPerBatch, [&] {
    step(model, {{0, 0, -gesture.depth_m[tick]}, kDown}, state, report);
    keep(report);
    if (++tick == gesture.depth_m.size()) tick = 0;
  });
  row.rate_hz = gesture.rate_hz;
  setTimes(row, timing, gesture.rate_hz);
  return timingText(timing);
}

void addGreatestStep(const AxialRun& run, AccuracyRow& row) {
  double most = 0;
  for (std::size_t i = 1; i < run.force_N.size(); ++i)
    if (!isRelease(run.flags[i], run.force_N[i - 1], run.force_N[i]))
      most = std::max(most, std::fabs(run.force_N[i] - run.force_N[i - 1]));
  row.max_step_n = most;
}

}  // namespace needlelab
