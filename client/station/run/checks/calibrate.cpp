#include "client/station/run/checks/calibrate.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/device/factory/device_factory.h"
#include "client/device/hand/hand_plan.h"
#include "client/device/hand/simulated_device.h"
#include "client/device/pose_option.h"
#include "client/station/run/io/terminal.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/base/units.h"

namespace needlelab {
namespace {

constexpr double kShortestBase_m = 0.02;  // least distance between two points that define a direction
constexpr double kPoseRate_hz = 1000;     // more poses add nothing

constexpr double kCalibrationDefault_s = 30, kCalibrationLongest_s = 600;

// "simulated" is a pivoting hand; a recording is read as fast as possible
Result<std::unique_ptr<Device>> deviceFor(const StationOptions& options) {
  if (options.device != "simulated") return makeDevice(options.device, {{}, {}, options.X_HT, options.hand});
  PivotMotion motion;
  if (options.tool_given) motion.X_HT = options.X_HT;
  motion.seed = options.hand.seed;
  return std::unique_ptr<Device>(std::make_unique<PivotDevice>(motion));
}

// overwrites one line on a terminal; elsewhere prints a new line at intervals
class ProgressLine {
 public:
  void operator()(const CalibrationProgress& now) {
    const double step_s = terminal_ ? 0.2 : 5;
    if (now.t_s < next_s_) return;
    next_s_ = now.t_s + step_s;
    std::string text;
    if (now.t_s < 0)
      text = fmt::format("begins in {:.0f} s: put the tip into the dimple", std::ceil(-now.t_s));
    else
      text = fmt::format("{:4.1f} s  {:6} poses  swing {:3.0f} % of what is needed{}", now.t_s, now.poses,
                         100 * std::min(9.99, now.spread / kMinSpread),
                         now.residual_rms_m && now.spread > kMinSpread / 4
                             ? fmt::format("  residual {:.2f} mm", 1e3 * *now.residual_rms_m)
                             : "");
    if (terminal_)
      std::cerr << "\r" << padded(text, 78) << std::flush;
    else
      std::cerr << text << "\n";
    written_ = true;
  }
  void end() {
    if (terminal_ && written_) std::cerr << "\n";
  }

 private:
  bool terminal_ = ::isatty(STDERR_FILENO) == 1, written_ = false;
  double next_s_ = -1e9;
};

double degreesBetween(Quat a, Quat b) {
  const Vec3 u = zAxis(a), v = zAxis(b);
  return degreesOf(std::atan2(norm(cross(u, v)), dot(u, v)));
}

std::string resultText(const Calibration& found, const Pose& tool, const NeedleAxis& axis,
                       const StationOptions& options) {
  const PivotFit& fit = found.fit;
  const auto mm = [](double m) { return 1e3 * m; };
  const auto place = [&](double m) { return fixedText(mm(m), 2); };
  const std::string swing =
      fmt::format("swing           {:.0f} % of what is needed\n", 100 * fit.spread / kMinSpread);
  // a tip from too small a swing is meaningless
  if (fit.spread < kMinSpread) return swing;
  std::string text;
  text +=
      fmt::format("tip             x {}  y {}  z {} mm in the handle's frame, {:.1f} mm from its origin\n",
                  place(fit.p_HT_m.x), place(fit.p_HT_m.y), place(fit.p_HT_m.z), mm(norm(fit.p_HT_m)));
  text += fmt::format("error to expect ±{:.2f} mm at the tip in use (2σ); of it the tool itself ±{:.3f} mm\n",
                      mm(expectedError_m(fit)), mm(2 * fit.worst_sigma_m));
  if (found.halves_apart_m)
    text +=
        fmt::format("check           the first and the second half of the run give tips {:.3f} mm apart\n",
                    mm(*found.halves_apart_m));
  text += fmt::format("residual        {:.2f} mm RMS, {:.2f} mm at most, over {} of {} poses\n",
                      mm(fit.residual_rms_m), mm(fit.residual_max_m), fit.used, fit.samples);
  for (const PivotSlip& slip : fit.slips)
    text += fmt::format("left out        {:.1f} to {:.1f} s: the tip was {:.2f} mm out of the dimple\n",
                        slip.from_s, slip.to_s, mm(slip.distance_m));
  text += swing;
  text += "needle's axis   " + needleAxisText(axis);
  if (options.tool_given && axis.source != NeedleAxis::Source::kGiven)
    text += fmt::format(", {:.1f}° away from that of --tool", degreesBetween(tool.q, options.X_HT.q));
  return text + "\n";
}

nlohmann::ordered_json resultRow(const Calibration& found, const Pose& tool, const NeedleAxis& axis,
                                 const std::string& device, const std::string& trouble) {
  const PivotFit& fit = found.fit;
  nlohmann::ordered_json row = {{"ok", trouble.empty()},
                                {"trouble", trouble},
                                {"device", device},
                                {"tool", poseOptionText(tool)},
                                {"tip_x_m", fit.p_HT_m.x},
                                {"tip_y_m", fit.p_HT_m.y},
                                {"tip_z_m", fit.p_HT_m.z},
                                {"axis", needleAxisText(axis)},
                                {"expected_error_m", expectedError_m(fit)},
                                {"tool_error_m", 2 * fit.worst_sigma_m},
                                {"halves_apart_m", nullptr},
                                {"residual_rms_m", fit.residual_rms_m},
                                {"residual_max_m", fit.residual_max_m},
                                {"samples", fit.samples},
                                {"used", fit.used},
                                {"spread", fit.spread},
                                {"spread_needed", kMinSpread}};
  if (found.halves_apart_m) row["halves_apart_m"] = *found.halves_apart_m;
  auto& slips = row["slips"] = nlohmann::ordered_json::array();
  for (const PivotSlip& slip : fit.slips)
    slips.push_back({{"from_s", slip.from_s}, {"to_s", slip.to_s}, {"distance_m", slip.distance_m}});
  return row;
}

// reports the result, or the reason for rejecting it as a tool; writes the tool file
int conclude(const StationOptions& options, const NeedleAxis& axis, const std::string& device,
             const Calibration& found) {
  const PivotFit& fit = found.fit;
  std::string trouble = pivotTrouble(fit);
  Pose tool{fit.p_HT_m, options.X_HT.q};
  if (trouble.empty()) {
    if (auto made = toolOf(fit.p_HT_m, axis, options.X_HT); made.ok())
      tool = *made;
    else
      trouble = made.error().message;
  }
  std::string text = resultText(found, tool, axis, options);
  int code = kExitFailed;
  if (!trouble.empty()) {
    text += wrapped("REFUSED: " + trouble + ". Nothing was written", 0);
  } else if (options.tool_out.empty()) {
    text += "not written     give --out FILE to keep it, or use it as it is:\n  --tool " +
            poseOptionText(tool) + "\n";
    code = kExitDone;
  } else {
    const ToolNotes notes{wallNowNs(),
                          device,
                          needleAxisText(axis),
                          fit.samples,
                          fit.used,
                          fit.residual_rms_m,
                          fit.residual_max_m,
                          expectedError_m(fit),
                          2 * fit.worst_sigma_m,
                          fit.spread};
    if (auto written = writeFileAtomically(options.tool_out, viewOf(toolFileText(tool, notes)));
        !written.ok())
      return refused(written.error());
    text += "written         " + options.tool_out.string() + "; start lessons with --tool " +
            options.tool_out.string() + "\n";
    code = kExitDone;
  }
  auto rows = nlohmann::ordered_json::array();
  rows.push_back(resultRow(found, tool, axis, device, trouble));
  return printReport(options, text, reportJson(rows), code);
}

}  // namespace

// --- measuring ---

Result<NeedleAxis> parseNeedleAxis(const std::string& text) {
  if (text == "from-tip") return NeedleAxis{NeedleAxis::Source::kFromTip, {}};
  if (text == "given") return NeedleAxis{NeedleAxis::Source::kGiven, {}};
  if (text.starts_with("hub:") && text.size() > 4) {
    ASSIGN_OR_RETURN(auto hub, parsePoseOption(text.substr(4), "--axis hub"));
    return NeedleAxis{NeedleAxis::Source::kHub, hub.p};
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
    return Error{
        ErrorCode::kFailed,
        fmt::format("the tip lies only {:.1f} mm from {}: too near to tell where the needle points. Use "
                    "--axis given with the orientation in --tool{}",
                    1e3 * norm(along), hub ? "the hub of --axis hub" : "the handle's origin",
                    hub ? "" : ", or --axis hub:FILE")};
  return Pose{p_HT_m, normalized(given.q * orientationAlong(rotate(conjugate(given.q), along)))};
}

Result<Calibration> calibrateTip(Device& device, TimeSource& clock, const CalibrationSettings& settings,
                                 const sigset_t& stop_signals,
                                 const std::function<void(const CalibrationProgress&)>& progress,
                                 TimeSource& time, TurnRunner& threads) {
  ZeroForceSettings quiet;
  quiet.rate_hz = settings.rate_hz;
  quiet.max_ticks = static_cast<std::uint64_t>(
      std::max(1.0, std::ceil((settings.settle_s + settings.seconds) * settings.rate_hz)));
  quiet.keep_every = static_cast<std::uint64_t>(std::max(1.0, std::round(settings.rate_hz / kPoseRate_hz)));
  ZeroForceLoop loop(device, clock, quiet);

  // excludes the samples of the settling time from sums and fit
  PivotSums sums;
  std::size_t seen = 0;
  const auto follow = [&] {
    const auto samples = loop.samples();
    for (; seen < samples.size(); ++seen)
      if (samples[seen].t_s >= settings.settle_s) sums.add(samples[seen].X_WH);
    CalibrationProgress now{loop.elapsed_s() - settings.settle_s, sums.samples(), sums.spread(), {}};
    if (const auto solution = sums.solve(); solution.ok()) now.residual_rms_m = solution->residual_rms_m;
    progress(now);
    return now.t_s < settings.enough_s || now.spread < 2 * kMinSpread;
  };
  const RtOptions real_time;
  const ZeroForceRun run = runZeroForceLoop(loop, device, settings.real_time ? &real_time : nullptr,
                                            stop_signals, follow, time, threads);
  if (run.stopped) return Error{ErrorCode::kFailed, "stopped; nothing was written"};
  follow();

  std::vector<PivotSample> poses;
  for (const ZeroForceSample& sample : loop.samples())
    if (sample.t_s >= settings.settle_s) poses.push_back({sample.t_s - settings.settle_s, sample.X_WH});
  if (poses.empty()) {
    const std::string status = device.status();
    return Error{ErrorCode::kUnavailable, "the device gave no pose" +
                                              (status.empty() ? std::string() : ": " + status) +
                                              "; needlelab-station --self-test says more"};
  }
  ASSIGN_OR_RETURN(auto fit, fitPivot(poses));

  Calibration found{fit, {}};
  const std::span<const PivotSample> all(poses);
  const auto first = fitPivot(all.first(all.size() / 2)), second = fitPivot(all.subspan(all.size() / 2));
  if (first.ok() && second.ok() && std::min(first->spread, second->spread) >= kMinSpread / 2)
    found.halves_apart_m = norm(first->p_HT_m - second->p_HT_m);
  return found;
}

// --- the tool file ---

std::string toolFileText(const Pose& X_HT, const ToolNotes& notes) {
  // parses the text of the pose's only writer
  auto json = nlohmann::ordered_json::parse(poseOptionJson(X_HT));
  json["calibration"] = {{"made", isoTime(notes.made_unix_ns)},
                         {"program", "needlelab-station " + programVersion()},
                         {"machine", machineText()},
                         {"device", notes.device},
                         {"axis", notes.axis},
                         {"samples", notes.samples},
                         {"used", notes.used},
                         {"residual_rms_m", notes.residual_rms_m},
                         {"residual_max_m", notes.residual_max_m},
                         {"expected_error_m", notes.expected_error_m},
                         {"tool_error_m", notes.tool_error_m},
                         {"spread", notes.spread}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

// --- the command ---

int runCalibrate(const StationOptions& options, const sigset_t& stop_signals) {
  if (options.seconds > kCalibrationLongest_s)
    return refused(outOfRange("--seconds of a calibration", options.seconds, {0.001, kCalibrationLongest_s}));
  const auto axis = parseNeedleAxis(options.axis);
  if (!axis.ok()) return refused(axis.error());
  auto made = deviceFor(options);
  if (!made.ok()) return refused(made.error());
  Device& device = **made;
  if (!device.info().has_orientation)
    return refused(
        {ErrorCode::kInvalidInput,
         device.info().name +
             " does not report how its handle is turned, so there is nothing to calibrate: its grip "
             "is the tip. Where the tip stands off from the grip, give the offset in metres: --tool "
             "x,y,z,0,0,0,1"});
  if (auto status = device.open(options.rate_hz); !status.ok()) return refused(status.error());

  // devices that advance by ticks need no waiting
  const bool recording = options.device.starts_with("recording:");
  const bool real = !recording && options.device != "simulated";
  CalibrationSettings settings;
  settings.rate_hz = options.rate_hz;
  settings.seconds = options.seconds > 0 ? options.seconds : kCalibrationDefault_s;
  settings.real_time = real;
  if (!real) settings.settle_s = 0;
  if (recording)
    settings.enough_s = settings.seconds = options.seconds > 0 ? options.seconds : kCalibrationLongest_s;
  std::cerr << "calibrating with " << device.info().name << "; the device gives no force.\n";
  if (real)
    std::cerr << wrapped(
        fmt::format(
            "Rest the needle's tip in a small dimple in a plate that stands firm. Swing the handle slowly "
            "by 20° or more to every side and turn it about itself, the tip never leaving the dimple, for "
            "{:g} s at most. Ctrl-C gives up.",
            settings.seconds),
        0);

  LoopTime steady;
  ImpatientClock impatient;
  TimeSource& clock = real ? static_cast<TimeSource&>(steady) : impatient;
  ProgressLine line;
  const auto found = calibrateTip(device, clock, settings, stop_signals, std::ref(line));
  line.end();
  device.close();
  if (!found.ok()) return refused(found.error());
  return conclude(options, *axis, device.info().name, *found);
}

}  // namespace needlelab
