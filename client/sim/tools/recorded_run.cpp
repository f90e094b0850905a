#include "client/sim/tools/recorded_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/effects/resume.h"
#include "common/haptics/tick.h"

namespace needlelab {

std::string differenceText(const RecordedDifference& difference) {
  if (difference.compared_ticks == 0) return "no tick in tissue could be compared with the recorded forces\n";
  std::string text = fmt::format(
      "ticks in tissue that differ by more than {} N from the recorded force: {} of {}\n"
      "difference: {:.4f} N in the median, {:.4f} N at the 99th percentile, {:.4f} N at most\n",
      kDiffers_N, difference.differing_ticks, difference.compared_ticks, difference.median_N,
      difference.p99_N, difference.greatest_N);
  if (difference.gate_ticks > 0)
    text += fmt::format("ticks whose force the gate changed, not compared: {}\n", difference.gate_ticks);
  return text;
}

RecordedRun::RecordedRun(const SceneModel& model)
    : model_(model),
      chunk_ticks_(static_cast<std::uint64_t>(std::llround(model.rate_hz))),
      told_(std::make_unique<SimState>()),
      own_(std::make_unique<SimState>()) {
  clearReport(report_, 0.0, 0);
}

const StepReport& RecordedRun::step(const GestureSample& sample) {
  if (ticks_++ % chunk_ticks_ == 0) *own_ = *told_;
  if ((sample.flags & kFlagNotStepped) != 0) {
    report_.flags = kFlagNotStepped;
    return report_;
  }
  const TipSample tip{{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
                      {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}};
  const StoredTick stored = storedTickOf(sample);
  StepReport as_told;
  stepAsStored(model_, tip, stored, *told_, as_told);
  needlelab::step(model_, tip, *own_, report_);

  if (stored.layer < 0 && report_.layer < 0) return report_;
  if (stored.hasEnginesForce())
    differences_N_.push_back(differenceFrom(stored, report_).force_N);
  else
    ++gate_ticks_;
  return report_;
}

RecordedDifference RecordedRun::difference() const {
  RecordedDifference difference;
  difference.compared_ticks = differences_N_.size();
  difference.gate_ticks = gate_ticks_;
  if (differences_N_.empty()) return difference;
  std::vector<double> sorted = differences_N_;
  std::sort(sorted.begin(), sorted.end());
  const auto above = std::upper_bound(sorted.begin(), sorted.end(), kDiffers_N);
  difference.differing_ticks = static_cast<std::size_t>(sorted.end() - above);
  difference.median_N = sorted[sorted.size() / 2];
  difference.p99_N = sorted[sorted.size() * 99 / 100];
  difference.greatest_N = sorted.back();
  return difference;
}

}  // namespace needlelab
