#include "client/station/run/checks/measure_delay.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "client/device/factory/device_factory.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/loop/signals.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

using nlohmann::ordered_json;

constexpr double kMaxMissed = 0.01;
constexpr double kMaxApart_s = 1e-3;
constexpr std::size_t kMaxFile_bytes = 1u << 16;

// limits the probe's force, however strong the device is
DeviceLimits probeLimits(DeviceLimits limits) {
  limits.peak_force_N = std::min(limits.peak_force_N, kProbe_N);
  limits.continuous_force_N = std::min(limits.continuous_force_N, kProbe_N);
  limits.peak_torque_Nm = limits.continuous_torque_Nm = 0;
  return limits;
}

Result<ordered_json> readDelays(const std::filesystem::path& file) {
  std::error_code missing;
  if (!std::filesystem::exists(file, missing)) return ordered_json::object();
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(file, kMaxFile_bytes));
  auto json = ordered_json::parse(text, nullptr, false);
  if (!json.is_object())
    return Error{ErrorCode::kInvalidInput, file.string() +
                                               ": is not what --measure-delay wrote; delete it, then measure "
                                               "the delay again"};
  return json;
}

std::string resultText(const DelayFit& fit, double rate_hz) {
  return fmt::format(
      "delay           {:.2f} ms from a reading to its force, {:.1f} ticks: {:.2f} ms late, behind a lag of "
      "{:.2f} ms\n"
      "check           the first and the second half of the measurement are {:.2f} ms apart\n"
      "handle and hand {:.2f} kg, {:.1f} N·s/m, {:.0f} N/m; {:.0f} % of the movement is something else\n",
      1e3 * fit.total_s(), fit.total_s() * rate_hz, 1e3 * fit.delay_s, 1e3 * fit.lag_s,
      1e3 * fit.halves_apart_s, fit.mass_kg, fit.damping_Ns_per_m, fit.stiffness_N_per_m,
      100 * fit.unexplained);
}

ordered_json resultRow(const std::string& device, const DelayFit& fit) {
  return {{"device", device},
          {"delay_s", fit.delay_s},
          {"lag_s", fit.lag_s},
          {"halves_apart_s", fit.halves_apart_s},
          {"mass_kg", fit.mass_kg},
          {"damping_ns_per_m", fit.damping_Ns_per_m},
          {"stiffness_n_per_m", fit.stiffness_N_per_m},
          {"unexplained", fit.unexplained}};
}

// returns whether a person agrees; a signal means no
bool isAgreed(const DeviceInfo& device, const sigset_t& stop_signals) {
  EnterKey enter(STDIN_FILENO);
  std::cerr << wrapped(
      fmt::format(
          "The {} will push to and fro for {:g} s, with {:g} N at most. Hold the handle as in a lesson, "
          "in the middle of its space{}, and keep it still. Press Enter to begin; Ctrl-C gives up.",
          device.name, kProbe_s, kProbe_N, device.has_dead_man ? ", with your hand on its sensor" : ""),
      0);
  while (!enter.pressed())
    if (signalWithin(stop_signals, std::chrono::milliseconds(50), machineTime()) != 0) return false;
  return true;
}

}  // namespace

// --- measuring ---

ProbeLoop::ProbeLoop(Device& device, TimeSource& clock, double rate_hz, std::vector<double> force_N,
                     Vec3 along_W)
    : ZeroForceLoop(device, clock, {rate_hz, force_N.size(), force_N.size()}),
      gate_(probeLimits(device.info().limits), rate_hz),
      force_N_(std::move(force_N)),
      along_W_(along_W),
      response_(force_N_.size()) {}

GuardedWrench ProbeLoop::answer(std::uint64_t number, DeviceRead read,
                                const DeviceReading& reading) noexcept {
  const bool fresh = read == DeviceRead::kFresh;
  const auto elapsed = static_cast<std::int64_t>(number - next_) + 1;
  // without a scene, the handle's origin serves as the tip
  const bool admitted =
      gate_.admit({reading.X_WH.p, reading.X_WH.q}, fresh, reading.speed_mps, elapsed, reading.condition);
  if (fault_ == Fault::kNone) fault_ = gate_.fault();
  lost_force_ = lost_force_ || (reading.condition & kDeviceHoldFlags) != 0;
  const GuardedWrench wrench = gate_.guard(admitted ? Wrench{along_W_ * force_N_[number], {}} : Wrench{});
  for (; next_ < number; ++next_) response_[next_] = last_;
  last_.force_N = dot(along_W_, wrench.wrench().force_N);
  if (fresh) last_.place_m = dot(along_W_, reading.X_WH.p);
  response_[next_++] = last_;
  return wrench;
}

Result<DelayFit> measureDelay(Device& device, TimeSource& clock, double rate_hz, bool real_time,
                              const sigset_t& stop_signals, const std::function<void(double)>& progress,
                              TimeSource& time, TurnRunner& threads) {
  ProbeLoop loop(device, clock, rate_hz, probeForce(rate_hz, kProbe_s, kProbe_N), {1, 0, 0});
  const RtOptions options;
  const ZeroForceRun run = runZeroForceLoop(
      loop, device, real_time ? &options : nullptr, stop_signals,
      [&] {
        progress(loop.elapsed_s());
        return true;
      },
      time, threads);
  if (run.stopped) return Error{ErrorCode::kFailed, "stopped; nothing was kept"};
  const ZeroForceStats& stats = loop.stats();
  if (loop.fault() != Fault::kNone)
    return Error{ErrorCode::kUnavailable, std::string("the device lost its force: ") +
                                              faultText(loop.fault()) +
                                              "; needlelab-station --self-test says more"};
  if (loop.lostForce())
    return Error{ErrorCode::kUnavailable,
                 "the device had no force for a while: hold the handle until the measurement ends, with the "
                 "motors on"};
  if (stats.fresh == 0)
    return Error{ErrorCode::kUnavailable, "the device gave no pose; needlelab-station --self-test says more"};
  if (static_cast<double>(stats.missed) > kMaxMissed * static_cast<double>(stats.ticks))
    return Error{ErrorCode::kUnavailable,
                 fmt::format("{} of {} ticks were missed: end other programs, then measure again",
                             stats.missed, stats.ticks)};
  ASSIGN_OR_RETURN(const DelayFit fit,
                   fitDelay(loop.response(), rate_hz, device.info().limits.apparent_mass_kg));
  if (fit.halves_apart_s > kMaxApart_s)
    return Error{
        ErrorCode::kFailed,
        fmt::format("two halves of the measurement give delays {:.1f} ms apart: hold the handle still "
                    "and measure again",
                    1e3 * fit.halves_apart_s)};
  return fit;
}

// --- stored delays ---

std::filesystem::path delayFile(const StationOptions& options) {
  return options.spool / "device-delays.json";
}

Status keepDelay(const std::filesystem::path& file, const std::string& device, const DelayFit& fit,
                 std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(auto json, readDelays(file));
  ordered_json row = resultRow(device, fit);
  row.erase("device");
  row["measured_unix_ns"] = now_unix_ns;
  json[device] = std::move(row);
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);  // the write reports a failure
  return writeFileAtomically(file,
                             viewOf(json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"));
}

Result<LoopDelay> loopDelayOf(const StationOptions& options, const DeviceInfo& device) {
  if (device.delay_ticks) return LoopDelay{*device.delay_ticks, 0, true};
  const auto file = delayFile(options);
  ASSIGN_OR_RETURN(const auto json, readDelays(file));
  const auto row = json.find(options.device);
  if (row == json.end()) {
    const DeviceKind* kind = deviceKindOf(options.device);
    return LoopDelay{kind != nullptr ? kind->assumed_delay_ticks : 0};
  }
  const auto numberOf = [&](const char* field) -> Result<double> {
    const auto value = row->find(field);
    const double number = value != row->end() && value->is_number() ? value->get<double>() : -1;
    if (number >= 0 && number <= 0.1) return number;
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: {}.{}: must be a number from 0 to 0.1; measure the delay again: "
                             "needlelab-station --device {} --measure-delay",
                             file.string(), options.device, field, options.device)};
  };
  ASSIGN_OR_RETURN(const double delay_s, numberOf("delay_s"));
  ASSIGN_OR_RETURN(const double lag_s, numberOf("lag_s"));
  return LoopDelay{delay_s * options.rate_hz, lag_s, true};
}

// --- the command ---

int runMeasureDelay(const StationOptions& options, const sigset_t& stop_signals) {
  auto made = makeDevice(options.device, {{}, {}, options.X_HT, options.hand});
  if (!made.ok()) return refused(made.error());
  Device& device = **made;
  if (!device.info().renders_force)
    return refused({ErrorCode::kInvalidInput, device.info().name + " renders no force: it has no delay"});
  const bool real = options.device != "simulated";
  if (real && !isAgreed(device.info(), stop_signals))
    return refused({ErrorCode::kFailed, "stopped; nothing was kept"});
  if (auto status = device.open(options.rate_hz); !status.ok()) return refused(status.error());
  LoopTime steady;
  ImpatientClock impatient;
  TimeSource& clock = real ? static_cast<TimeSource&>(steady) : impatient;
  const auto progress = [real, next_s = 2.0](double t_s) mutable {
    if (!real || t_s < next_s) return;
    std::cerr << fmt::format("{:.0f} of {:g} s\n", t_s, kProbe_s);
    next_s += 2;
  };
  const auto fit = measureDelay(device, clock, options.rate_hz, real, stop_signals, progress);
  device.close();
  if (!fit.ok()) return refused(fit.error());
  if (auto kept = keepDelay(delayFile(options), options.device, *fit, wallNowNs()); !kept.ok())
    return refused(kept.error());
  auto rows = ordered_json::array();
  rows.push_back(resultRow(options.device, *fit));
  return printReport(options,
                     resultText(*fit, options.rate_hz) + "kept            in " + delayFile(options).string() +
                         "; lessons with --device " + options.device + " read it\n",
                     reportJson(rows), kExitDone);
}

}  // namespace needlelab
