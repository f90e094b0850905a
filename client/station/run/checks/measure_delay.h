/// `needlelab-station --measure-delay`: measures how late the device renders a force. A person holds the
/// handle as in a lesson; the device pushes with at most kProbe_N, and the encoders show when it moves.
/// Lessons use the result in stiffness limits and passivity control.
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
#include "client/station/run/io/options.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/loop/zero_force_loop.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

inline constexpr double kProbe_N = 0.5, kProbe_s = 10;

/// Sends the device a force along an axis, tick by tick, and records the position along it. A gate limits the
/// force to kProbe_N. Otherwise a ZeroForceLoop.
class ProbeLoop final : public ZeroForceLoop {
 public:
  ProbeLoop(Device& device, TimeSource& clock, double rate_hz, std::vector<double> force_N, Vec3 along_W);
  /// One sample per tick; a missed tick repeats the sample before it. Read them after `run`.
  [[nodiscard]] std::span<const ResponseSample> response() const noexcept { return response_; }
  /// The gate's first fault; kNone: none. `lostForce`: the device was released or without power for a moment.
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

/// Measures the open device. Errors: kUnavailable (released, a fault, too many missed ticks; the message
/// gives advice), kFailed (stopped by a signal; as fitDelay; the two halves disagree). `time`, `threads`: as
/// in runZeroForceLoop; `real_time`: false for devices that advance by ticks.
Result<DelayFit> measureDelay(Device& device, TimeSource& clock, double rate_hz, bool real_time,
                              const sigset_t& stop_signals, const std::function<void(double t_s)>& progress,
                              TimeSource& time = machineTime(), TurnRunner& threads = machineThreads());

/// Reads the delay measured for this --device from the station's file (`delayFile`); if there is none, that
/// of the table of devices (device_factory.h). Errors: kInvalidInput (a damaged file).
Result<LoopDelay> loopDelayOf(const StationOptions& options, const DeviceInfo& device);

/// The file with the delays of the station's devices, beside the spool's sessions.
std::filesystem::path delayFile(const StationOptions& options);
/// Adds or replaces the device's row, atomically.
Status keepDelay(const std::filesystem::path& file, const std::string& device, const DelayFit& fit,
                 std::int64_t now_unix_ns);

/// Runs `--measure-delay`. Asks for consent before the device pushes. Exit code: 0 if a delay was found and
/// stored, 1 if not, 2 for wrong input.
int runMeasureDelay(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
