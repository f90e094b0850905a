/// The command line's side of the calibration: what it says, and the tool file.

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "client/device/factory/device_factory.h"
#include "client/device/pivot_device.h"
#include "client/device/pose_option.h"
#include "client/station/run/calibrate.h"
#include "client/station/run/modes.h"
#include "client/station/run/report_output.h"
#include "client/station/run/tool_file.h"
#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kDefault_s = 30, kLongest_s = 600;

int refuse(const Error& error) {
  std::cerr << "needlelab-station: " << error.message << "\n";
  return exitCodeOf(error);
}

// "simulated" is a hand that pivots; a recording is read as fast as it can be
Result<std::unique_ptr<Device>> deviceFor(const StationOptions& options) {
  if (options.device != "simulated") return makeDevice(options.device, {{}, {}, options.X_HT, options.hand});
  PivotMotion motion;
  if (options.tool_given) motion.X_HT = options.X_HT;
  motion.seed = options.hand.seed;
  return std::unique_ptr<Device>(std::make_unique<PivotDevice>(motion));
}

// one line that is written over on a terminal, a new one now and then elsewhere
class ProgressLine {
 public:
  void operator()(const CalibrationProgress& now) {
    const double step_s = terminal_ ? 0.2 : 5;
    if (now.t_s < next_s_) return;
    next_s_ = now.t_s + step_s;
    std::string text;
    if (now.t_s < 0)
      text = formatted("begins in %.0f s: put the tip into the dimple", std::ceil(-now.t_s));
    else
      text = formatted("%4.1f s  %6zu poses  swing %3.0f %% of what is needed%s", now.t_s, now.poses,
                       100 * std::min(9.99, now.spread / kLeastSpread),
                       now.residual_rms_m && now.spread > kLeastSpread / 4
                           ? formatted("  residual %.2f mm", 1e3 * *now.residual_rms_m).c_str()
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
  return std::atan2(norm(cross(u, v)), dot(u, v)) * 180 / std::numbers::pi;
}

std::string resultText(const Calibration& found, const Pose& tool, const NeedleAxis& axis,
                       const StationOptions& options) {
  const PivotFit& fit = found.fit;
  const auto mm = [](double m) { return 1e3 * m; };
  const std::string swing =
      formatted("swing           %.0f %% of what is needed\n", 100 * fit.spread / kLeastSpread);
  // a tip from too small a swing is a number without meaning
  if (fit.spread < kLeastSpread) return swing;
  std::string text;
  text +=
      formatted("tip             x %.2f  y %.2f  z %.2f mm in the handle's frame, %.1f mm from its origin\n",
                mm(fit.p_HT_m.x), mm(fit.p_HT_m.y), mm(fit.p_HT_m.z), mm(norm(fit.p_HT_m)));
  text += formatted("error to expect ±%.2f mm at the tip in use (2σ); of it the tool itself ±%.3f mm\n",
                    mm(expectedError_m(fit)), mm(2 * fit.worst_sigma_m));
  if (found.halves_apart_m)
    text += formatted("check           the first and the second half of the run give tips %.3f mm apart\n",
                      mm(*found.halves_apart_m));
  text += formatted("residual        %.2f mm RMS, %.2f mm at most, over %zu of %zu poses\n",
                    mm(fit.residual_rms_m), mm(fit.residual_max_m), fit.used, fit.samples);
  for (const PivotSlip& slip : fit.slips)
    text += formatted("left out        %.1f to %.1f s: the tip was %.2f mm out of the dimple\n", slip.from_s,
                      slip.to_s, mm(slip.distance_m));
  text += swing;
  text += "needle's axis   " + needleAxisText(axis);
  if (options.tool_given && axis.source != NeedleAxis::Source::kGiven)
    text += formatted(", %.1f° away from that of --tool", degreesBetween(tool.q, options.X_HT.q));
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
                                {"spread_needed", kLeastSpread}};
  if (found.halves_apart_m) row["halves_apart_m"] = *found.halves_apart_m;
  auto& slips = row["slips"] = nlohmann::ordered_json::array();
  for (const PivotSlip& slip : fit.slips)
    slips.push_back({{"from_s", slip.from_s}, {"to_s", slip.to_s}, {"distance_m", slip.distance_m}});
  return row;
}

// what was found, or why it must not become a tool
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
      return refuse(written.error());
    text += "written         " + options.tool_out.string() + "; start lessons with --tool " +
            options.tool_out.string() + "\n";
    code = kExitDone;
  }
  auto rows = nlohmann::ordered_json::array();
  rows.push_back(resultRow(found, tool, axis, device, trouble));
  return printReport(options, text, reportJson(rows), code);
}

}  // namespace

int runCalibrate(const StationOptions& options, const sigset_t& stop_signals) {
  if (options.seconds > kLongest_s)
    return refuse(outOfRange("--seconds of a calibration", options.seconds, {0.001, kLongest_s}));
  const auto axis = parseNeedleAxis(options.axis);
  if (!axis.ok()) return refuse(axis.error());
  auto made = deviceFor(options);
  if (!made.ok()) return refuse(made.error());
  Device& device = **made;
  if (!device.info().has_orientation)
    return refuse(
        {ErrorCode::kInvalidInput,
         device.info().name +
             " does not report how its handle is turned, so there is nothing to calibrate: its grip "
             "is the tip. Where the tip stands off from the grip, give the offset in metres: --tool "
             "x,y,z,0,0,0,1"});
  if (auto status = device.open(options.rate_hz); !status.ok()) return refuse(status.error());

  // what lives by the tick needs no patience
  const bool recording = options.device.starts_with("recording:");
  const bool real = !recording && options.device != "simulated";
  CalibrationSettings settings;
  settings.rate_hz = options.rate_hz;
  settings.seconds = options.seconds > 0 ? options.seconds : kDefault_s;
  settings.real_time = real;
  if (!real) settings.settle_s = 0;
  if (recording) settings.enough_s = settings.seconds = options.seconds > 0 ? options.seconds : kLongest_s;
  std::cerr << "calibrating with " << device.info().name << "; the device gives no force.\n";
  if (real)
    std::cerr << wrapped(
        formatted(
            "Rest the needle's tip in a small dimple in a plate that stands firm. Swing the handle slowly "
            "by 20° or more to every side and turn it about itself, the tip never leaving the dimple, for "
            "%g s at most. Ctrl-C gives up.",
            settings.seconds),
        0);

  SteadyLoopClock steady;
  ImpatientClock impatient;
  LoopClock& clock = real ? static_cast<LoopClock&>(steady) : impatient;
  ProgressLine line;
  const auto found = calibrateTip(device, clock, settings, stop_signals, std::ref(line));
  line.end();
  device.close();
  if (!found.ok()) return refuse(found.error());
  return conclude(options, *axis, device.info().name, *found);
}

}  // namespace needlelab
