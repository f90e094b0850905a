#include "client/sim/tools/recorded_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "common/base/histogram.h"
#include "common/base/plausible.h"
#include "common/base/range.h"
#include "common/base/text/text.h"
#include "common/haptics/effects/resume.h"
#include "common/haptics/tick.h"

namespace needlelab {

std::string differenceText(const RecordedDifference& difference) {
  if (difference.compared_ticks == 0) return "no tick in tissue could be compared with the recorded forces\n";
  std::string text = fmt::format(
      "ticks in tissue or with the cap on that differ by more than {} N from the recorded force: {} of {}\n"
      "difference: {:.4f} N in the median, {:.4f} N at the 99th percentile, {:.4f} N at most\n",
      kDiffers_N, difference.differing_ticks, difference.compared_ticks, difference.median_N,
      difference.p99_N, difference.greatest_N);
  if (difference.gate_ticks > 0)
    text += fmt::format("ticks whose force the gate changed, not compared: {}\n", difference.gate_ticks);
  return text;
}

RecordedRun::RecordedRun(const SceneModel& model)
    : chunk_ticks_(static_cast<std::uint64_t>(std::llround(model.rate_hz))), told_(model), own_(model) {
  clearReport(report_, 0.0, 0);
}

const StepReport& RecordedRun::step(const GestureSample& sample) {
  if (ticks_++ % chunk_ticks_ == 0) own_.continueFrom(told_);
  if ((sample.flags & kFlagNotStepped) != 0) {
    report_.flags = kFlagNotStepped;
    return report_;
  }
  const TipSample tip{{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
                      {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}};
  const StoredTick stored = storedTickOf(sample);
  StepReport told_report;
  for (; !lists_.empty() && told_paths_.noneFrom(sample.tick); lists_.pop_front()) {
    told_paths_.take(lists_.front());
    own_paths_.take(lists_.front());
  }
  told_paths_.giveFor(sample.tick, stored, told_);
  own_paths_.giveFor(sample.tick, stored, own_);
  told_.stepAsStored(tip, stored, told_report);
  own_.stepOnPaths(tip, stored, report_);

  if (stored.layer < 0 && report_.layer < 0 && (stored.flags & kFlagCapped) == 0) return report_;
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

namespace {

Error rowError(const std::filesystem::path& path, std::size_t row, const std::string& why) {
  return {ErrorCode::kInvalidInput, fmt::format("{} row {}: {}", path.string(), row + 1, why)};
}

Status checkOrder(const std::filesystem::path& path, const std::vector<GestureSample>& samples) {
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const GestureSample &before = samples[i - 1], &now = samples[i];
    if (now.tick <= before.tick)
      return rowError(path, i,
                      fmt::format("tick {} comes after {}: ticks must ascend; were the rows sorted?",
                                  now.tick, before.tick));
    if (now.time_ns <= before.time_ns)
      return rowError(
          path, i, fmt::format("time_ns {} comes after {}: times must ascend", now.time_ns, before.time_ns));
  }
  return {};
}

Status checkWays(const std::filesystem::path& path, const std::vector<GestureSample>& samples) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [least, greatest] =
        std::ranges::minmax(samples, {}, [&](const GestureSample& sample) { return sample.p_WT_m[axis]; });
    RETURN_IF_ERROR(checkPlausible(fmt::format("{}: the way of p{}_m", path.string(), "xyz"[axis]),
                                   Quantity::kWay, greatest.p_WT_m[axis] - least.p_WT_m[axis]));
  }
  return {};
}

/// A busy computer may stop the loop for so long; the recording still counts as complete.
constexpr double kMaxMissed_s = 0.5;

/// Detects deleted rows; a thinned recording has every n-th tick.
std::vector<std::string> holesOf(const std::vector<GestureSample>& samples, double tick_s) {
  std::vector<std::uint64_t> steps;
  for (std::size_t i = 1; i < samples.size(); ++i) steps.push_back(samples[i].tick - samples[i - 1].tick);
  if (steps.empty()) return {};
  const double usual = static_cast<double>(medianOf(steps));
  const double most = std::max(3 * usual, kMaxMissed_s / std::max(tick_s, 1e-9));
  std::vector<std::string> holes;
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (static_cast<double>(steps[i]) > most)
      holes.push_back(fmt::format("ticks {} to {} are missing behind row {}", samples[i].tick + 1,
                                  samples[i + 1].tick - 1, i + 1));
  return holes;
}

}  // namespace

Result<RecordedGesture> readRecordedGesture(const std::filesystem::path& path, DamagedRecording damaged,
                                            WallColumns wall, std::optional<double> rate_hz) {
  RecordedGesture gesture;
  const std::string ending = lowerCase(path.extension().string());
  const bool is_csv = !beginsAsRecording(path) && (ending == ".csv" || ending == ".txt");
  if (is_csv) {
    ASSIGN_OR_RETURN(gesture.samples, readSampleCsv(path, wall, &gesture.note));
    RETURN_IF_ERROR(checkWays(path, gesture.samples));
  } else {
    ASSIGN_OR_RETURN(auto read, readRecording(path, damaged));
    gesture.samples = std::move(read.samples);
    gesture.holes = std::move(read.holes);
    gesture.rate_hz = read.rate_hz;
    gesture.paths = std::move(read.paths);
  }
  if (gesture.samples.empty()) return Error{ErrorCode::kInvalidInput, path.string() + ": has no samples"};
  RETURN_IF_ERROR(checkOrder(path, gesture.samples));
  const double tick_s = tickOf_s(gesture.samples);
  if (gesture.rate_hz == 0) gesture.rate_hz = wholeRate_hz(tick_s);
  if (is_csv) gesture.holes = holesOf(gesture.samples, tick_s);
  if (!gesture.holes.empty() && damaged == DamagedRecording::kRefuse)
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: incomplete: {}{}", path.string(), gesture.holes.front(),
                    gesture.holes.size() == 1 ? std::string()
                                              : fmt::format(" (and {} more)", gesture.holes.size() - 1))};
  if (gesture.rate_hz == 0 && !rate_hz)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: its ticks take {} s, which is not a station's rate: give --rate",
                             path.string(), numberText(tick_s))};
  if (gesture.rate_hz == 0) gesture.rate_hz = *rate_hz;
  if (rate_hz && *rate_hz != gesture.rate_hz)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--rate {}: {} was recorded at {} Hz; leave --rate out", numberText(*rate_hz),
                             path.string(), numberText(gesture.rate_hz))};
  return gesture;
}

}  // namespace needlelab
