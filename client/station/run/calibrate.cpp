#include "client/station/run/calibrate.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/hand_plan.h"
#include "client/device/pose_option.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kShortestBase_m = 0.02;  // between two points that shall give a direction
constexpr double kKeptRate_hz = 1000;     // more poses tell nothing more

}  // namespace

Result<NeedleAxis> parseNeedleAxis(const std::string& text) {
  if (text == "from-tip") return NeedleAxis{NeedleAxis::Source::kFromTip, {}};
  if (text == "given") return NeedleAxis{NeedleAxis::Source::kGiven, {}};
  if (text.starts_with("hub:") && text.size() > 4) {
    auto hub = parsePoseOption(text.substr(4), "--axis hub");
    if (!hub.ok()) return hub.error();
    return NeedleAxis{NeedleAxis::Source::kHub, hub->p};
  }
  return Error{ErrorCode::kInvalidInput,
               "--axis '" + text + "' is unknown; there are from-tip, given, and hub:FILE"};
}

std::string needleAxisText(const NeedleAxis& axis) {
  switch (axis.source) {
    case NeedleAxis::Source::kFromTip:
      return "along the line from the handle's origin to the tip";
    case NeedleAxis::Source::kGiven:
      return "as the orientation in --tool says";
    case NeedleAxis::Source::kHub:
      return "along the line from the needle's hub to the tip";
  }
  return {};
}

Result<Pose> toolOf(Vec3 p_HT_m, const NeedleAxis& axis, const Pose& given) {
  if (axis.source == NeedleAxis::Source::kGiven) return Pose{p_HT_m, given.q};
  const bool hub = axis.source == NeedleAxis::Source::kHub;
  const Vec3 along = hub ? p_HT_m - axis.p_HH_m : p_HT_m;
  if (norm(along) < kShortestBase_m)
    return Error{ErrorCode::kFailed,
                 formatted("the tip lies only %.1f mm from %s: too near to tell where the needle points. Use "
                           "--axis given with the orientation in --tool%s",
                           1e3 * norm(along), hub ? "the hub of --axis hub" : "the handle's origin",
                           hub ? "" : ", or --axis hub:FILE")};
  return Pose{p_HT_m, normalized(given.q * orientationAlong(rotate(conjugate(given.q), along)))};
}

Result<Calibration> calibrateTip(Device& device, LoopClock& clock, const CalibrationSettings& settings,
                                 const sigset_t& stop_signals,
                                 const std::function<void(const CalibrationProgress&)>& progress) {
  QuietSettings quiet;
  quiet.rate_hz = settings.rate_hz;
  quiet.max_ticks = static_cast<std::uint64_t>(
      std::max(1.0, std::ceil((settings.settle_s + settings.seconds) * settings.rate_hz)));
  quiet.keep_every = static_cast<std::uint64_t>(std::max(1.0, std::round(settings.rate_hz / kKeptRate_hz)));
  QuietLoop loop(device, clock, quiet);

  // the samples of the settling stay away from sums and fit
  PivotSums sums;
  std::size_t seen = 0;
  const auto follow = [&] {
    const auto samples = loop.samples();
    for (; seen < samples.size(); ++seen)
      if (samples[seen].t_s >= settings.settle_s) sums.add(samples[seen].X_WH);
    CalibrationProgress now{loop.elapsed_s() - settings.settle_s, sums.samples(), sums.spread(), {}};
    if (const auto solution = sums.solve(); solution.ok()) now.residual_rms_m = solution->residual_rms_m;
    progress(now);
    return now.t_s < settings.enough_s || now.spread < 2 * kLeastSpread;
  };
  const RtOptions real_time;
  const QuietRun run =
      runQuietly(loop, device, settings.real_time ? &real_time : nullptr, stop_signals, follow);
  if (run.stopped) return Error{ErrorCode::kFailed, "stopped; nothing was written"};
  follow();

  std::vector<PivotSample> poses;
  for (const QuietSample& sample : loop.samples())
    if (sample.t_s >= settings.settle_s) poses.push_back({sample.t_s - settings.settle_s, sample.X_WH});
  if (poses.empty()) {
    const std::string words = device.status();
    return Error{ErrorCode::kUnavailable, "the device gave no pose" +
                                              (words.empty() ? std::string() : ": " + words) +
                                              "; needlelab-station --self-test says more"};
  }
  auto fit = fitPivot(poses);
  if (!fit.ok()) return fit.error();

  Calibration found{*fit, {}};
  const std::span<const PivotSample> all(poses);
  const auto first = fitPivot(all.first(all.size() / 2)), second = fitPivot(all.subspan(all.size() / 2));
  if (first.ok() && second.ok() && std::min(first->spread, second->spread) >= kLeastSpread / 2)
    found.halves_apart_m = norm(first->p_HT_m - second->p_HT_m);
  return found;
}

}  // namespace needlelab
