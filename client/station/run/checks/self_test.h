/// `needlelab-station --self-test`: measures facts about device, computer and server, and judges them.
/// Measurement and judgement are separate, so that tests can check every judgement without hardware.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/io/options.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/zero_force_loop.h"
#include "client/view/model/letters.h"
#include "common/base/program.h"

namespace needlelab {

// --- monitors: the sizes that they report (EDID), as suggestions for --monitor ---

struct MonitorSize {
  std::string plug;  ///< "HDMI-A-1"
  double diagonal_m = 0;
};

/// Returns the picture's diagonal from an EDID's base block (VESA E-EDID 1.4): of the preferred timing in mm,
/// otherwise of the screen in cm. Nothing if `edid` is not an EDID or gives no size (a projector).
std::optional<double> edidDiagonal_m(std::string_view edid);

/// The connected monitors that report a size. `drm`: the kernel's folder of graphics cards.
std::vector<MonitorSize> connectedMonitors(const std::filesystem::path& drm = "/sys/class/drm");

// --- facts ---

struct DeviceFacts {
  std::string spec;     ///< value of --device
  std::string trouble;  ///< why the device could not be made or opened; all later fields are empty then
  std::optional<DeviceInfo> info;
  bool hardware = true;  ///< false: simulated, or a recording
  bool tool_given = false;
  double rate_hz = 1000;
  std::string status;  ///< Device::status at the end
  ZeroForceStats loop;
  Pose last_X_WH;         ///< last handle pose
  Pose X_HT;              ///< the tool, to compute the tip
  double farthest_m = 0;  ///< greatest distance from the origin of its frame
  double moved_m = 0;     ///< greatest distance from the mean position
  double noise_m = 0;     ///< see restNoise_m
  std::vector<RtStep> realtime;
  Result<LoopDelay> delay = LoopDelay{0, 0, true};  ///< as lessons use it
};

struct MachineFacts {
  std::string text;  ///< processor, cores, system
  unsigned cores = 0;
  std::string clock_source;        ///< e.g. "tsc"; empty when unknown
  double clock_resolution_ns = 0;  ///< as the system reports
  double clock_cost_ns = 0;        ///< cost of one reading
};

struct DiskFacts {
  std::string folder;
  std::string trouble;  ///< why the folder cannot be created or written
  double free_bytes = 0;
  double sync_median_s = 0, sync_max_s = 0;  ///< over 20 syncs of 8 KiB
};

struct EngineFacts {
  std::string trouble;
  std::size_t scenes = 0;  ///< number of tested scenes
  std::string heaviest;    ///< profile id of the slowest scene
  double tick_median_ns = 0;
};

struct ServerFacts {
  std::string address, trouble;
  std::string program, name;  ///< the server's program; this station's name on the server
  double connect_s = 0;       ///< for TCP, TLS 1.3 with certificate check, and log-in with the key
  double round_trip_s = 0;    ///< shortest of several
  double clock_offset_s = 0;  ///< the server's time of day minus this computer's
};

struct MonitorFacts {
  Viewing viewing;                 ///< --monitor, --viewing-distance
  bool wanted = true;              ///< false: --headless has no window
  std::vector<MonitorSize> found;  ///< as the connected monitors report
};

struct SelfTestFacts {
  DeviceFacts device;
  MachineFacts machine;
  MonitorFacts monitor;
  DiskFacts disk;
  EngineFacts engine;
  std::vector<ServerFacts> servers;  ///< each of --server; empty without it
};

/// Returns the position noise of a device at rest: the root mean square distance from the fitted straight
/// line in each 0.2 s window, median over the windows. Slow drift and a short knock do not count. 0 with too
/// few samples.
double restNoise_m(std::span<const ZeroForceSample> samples);

struct DeviceTestSettings {
  double rate_hz = 1000;
  double seconds = 5;                    ///< duration of the reading
  double patience_s = 15;                ///< longest time until it is ready
  const RtOptions* real_time = nullptr;  ///< of the haptic thread, at the same rate; null: an ordinary thread
};

/// Opens the device, waits until it is ready (firmware load, homing, power on) or the patience is over, reads
/// it at zero force, and closes it. `log` receives messages for a person. Sets `stopped` if a signal came.
/// `clock`: the loop's; `time`, `threads`: as in runZeroForceLoop.
DeviceFacts measureDevice(Device& device, TimeSource& clock, const DeviceTestSettings& settings,
                          const sigset_t& stop_signals, const std::function<void(const std::string&)>& log,
                          bool& stopped, TimeSource& time = machineTime(),
                          TurnRunner& threads = machineThreads());
MachineFacts measureMachine();
/// Creates the folder if needed and writes a temporary file there.
DiskFacts measureDisk(const std::filesystem::path& folder);
/// Returns the profiles of db/samples, which are embedded in the program.
std::span<const EmbeddedFile> sampleProfiles();
/// Runs each sample profile for about 20 ms.
EngineFacts measureEngine(double rate_hz);
ServerFacts measureServer(const StationOptions& options, const Endpoint& server);

// --- judgement ---

enum class Verdict : std::uint8_t { kOk, kWarning, kFailed, kNotChecked };
const char* verdictText(Verdict verdict);  ///< OK, WARNING, FAILED, not checked

struct Check {
  std::string name;  ///< e.g. "exchange time"
  Verdict verdict = Verdict::kOk;
  std::string found;                 ///< with unit, for a person
  std::string limit;                 ///< the expected range; may be empty
  std::string advice;                ///< empty when OK
  std::optional<double> value = {};  ///< the judged number
  std::string unit = {};
};

/// Verdict and text for a DeviceFlag.
struct ConditionText {
  std::uint32_t flag = 0;
  Verdict verdict = Verdict::kOk;
  const char* found = "";
  const char* advice = "";
};
/// Returns each DeviceFlag once.
std::span<const ConditionText> conditionTexts();

/// Returns all checks in the order of measurement.
std::vector<Check> judge(const SelfTestFacts& facts);

std::string selfTestText(const std::vector<Check>& checks);
/// {"version", "machine", "rows": [{"check", "verdict", "value", "unit", "found", "limit", "advice"}]}
std::string selfTestJson(const std::vector<Check>& checks);

/// Runs `--self-test`. Exit code 0 if no check failed, 1 otherwise.
int runSelfTest(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
