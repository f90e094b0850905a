/// `needlelab-station --measure-delay`: how late the device renders a force. A person holds the handle as in
/// a lesson; the device pushes with at most kProbe_N, and the encoders show when. Lessons read what was
/// found: limits of stiffness and passivity control count it.
#pragma once

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/device/delay_fit.h"
#include "client/station/run/lesson.h"
#include "client/station/run/options.h"
#include "client/station/run/zero_force_loop.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

inline constexpr double kProbe_N = 0.5, kProbe_s = 10;

/// Gives the device a force along an axis, tick by tick, and keeps the place along it. The force passes a
/// gate that lets through kProbe_N at most. As a ZeroForceLoop otherwise.
class ProbeLoop final : public ZeroForceLoop {
 public:
  ProbeLoop(Device& device, TimeSource& clock, double rate_hz, std::vector<double> force_N, Vec3 along_W);
  /// One for each tick; ticks that were missed have the force and place before them. Read them after `run`.
  [[nodiscard]] std::span<const ResponseSample> response() const noexcept { return response_; }
  /// The first fault of the gate; kNone: none. A device that was released or without power for a moment has
  /// `lostForce`.
  [[nodiscard]] Fault fault() const noexcept { return fault_; }
  [[nodiscard]] bool lostForce() const noexcept { return lost_force_; }

 protected:
  GuardedWrench answer(std::uint64_t number, DeviceRead read, const DeviceReading& reading) noexcept override;

 private:
  ForceGate gate_;
  std::vector<double> force_N_;
  Vec3 along_W_;
  std::vector<ResponseSample> response_;
  std::uint64_t next_ = 0;  // tick
  ResponseSample last_;
  Fault fault_ = Fault::kNone;
  bool lost_force_ = false;
};

/// Measures the open device. Errors: kUnavailable (released, a fault, too many missed ticks: the message says
/// what to do), kFailed (stopped by a signal; no answer; a result that two halves do not agree on).
/// `time`, `threads`: as of runZeroForceLoop; `real_time` false: for devices that advance by ticks.
Result<DelayFit> measureDelay(Device& device, TimeSource& clock, double rate_hz, bool real_time,
                              const sigset_t& stop_signals, const std::function<void(double t_s)>& progress,
                              TimeSource& time = machineTime(), TurnRunner& threads = machineThreads());

/// Reads what was measured for this --device from the station's file (`delayFile`). Without a measurement
/// kAssumedDelayTicks. Errors: kInvalidInput (a damaged file).
Result<LoopDelay> loopDelayOf(const StationOptions& options, const DeviceInfo& device);

/// Where the station keeps the delays of its devices: beside the spool's sessions.
std::filesystem::path delayFile(const StationOptions& options);
/// Adds or replaces the device's row, atomically.
Status keepDelay(const std::filesystem::path& file, const std::string& device, const DelayFit& fit,
                 std::int64_t now_unix_ns);

/// Runs `--measure-delay`. Asks a person before the device pushes. Exit code: 0 if a delay was found and
/// kept, 1 if not, 2 for wrong input.
int runMeasureDelay(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
