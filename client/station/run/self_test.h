/// `needlelab-station --self-test`: facts about device, computer and server, and their judgement. The two are
/// separate, so that every judgement can be tested without hardware.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/options.h"
#include "client/station/run/real_time.h"
#include "client/station/run/zero_force_loop.h"
#include "common/base/program.h"

namespace needlelab {

// --- facts ---

struct DeviceFacts {
  std::string spec;     ///< of --device
  std::string trouble;  ///< why it could not be made or opened; all below is empty then
  std::optional<DeviceInfo> info;
  bool hardware = true;  ///< neither simulated nor a recording
  bool tool_given = false;
  double rate_hz = 1000;
  std::string status;  ///< Device::status at the end
  ZeroForceStats loop;
  Pose last_X_WH;         ///< the last handle pose, and
  Pose X_HT;              ///< the tool, for the tip
  double farthest_m = 0;  ///< from the origin of its frame
  double moved_m = 0;     ///< greatest distance from the mean position
  double noise_m = 0;     ///< see restNoise_m
  std::vector<RtStep> realtime;
};

struct MachineFacts {
  std::string text;  ///< processor, cores, system
  unsigned cores = 0;
  std::string clock_source;        ///< e.g. "tsc"; empty when unknown
  double clock_resolution_ns = 0;  ///< as the system reports
  double clock_cost_ns = 0;        ///< of one reading
};

struct DiskFacts {
  std::string folder;
  std::string trouble;  ///< it cannot be made or written
  double free_bytes = 0;
  double sync_median_s = 0, sync_max_s = 0;  ///< of 20 syncs of 8 KiB
};

struct EngineFacts {
  std::string trouble;
  std::size_t scenes = 0;  ///< that were tried
  std::string heaviest;    ///< its profile's id
  double tick_median_ns = 0;
};

struct ServerFacts {
  bool asked = false;  ///< --server was given
  std::string address, trouble;
  std::string program, name;  ///< the server's; the name under which it knows this station
  double connect_s = 0;       ///< TCP, TLS 1.3 with its certificate checked, log-in with the key
  double round_trip_s = 0;    ///< least of several
  double clock_offset_s = 0;  ///< the server's time of day minus this computer's
};

struct SelfTestFacts {
  DeviceFacts device;
  MachineFacts machine;
  DiskFacts disk;
  EngineFacts engine;
  ServerFacts server;
};

/// Position noise of a device at rest: root mean square distance from the straight line through each 0.2 s,
/// median over these windows, so that a slow drift and a short knock do not count. 0 with too few samples.
double restNoise_m(std::span<const ZeroForceSample> samples);

/// At `real_time.rate_hz`: opens the device, waits until it is ready (at most `patience_s`:
/// firmware is loaded, a zero looked for, power switched on), reads it for `seconds`
/// with zero force, closes it. `log` gets messages for a person meanwhile. `stopped`: a signal came.
DeviceFacts measureDevice(Device& device, LoopClock& clock, const RtOptions& real_time, double seconds,
                          const sigset_t& stop_signals, const std::function<void(const std::string&)>& log,
                          bool& stopped, double patience_s = 15);
MachineFacts measureMachine();
/// Makes the folder if need be, and writes a file there for a moment.
DiskFacts measureDisk(const std::filesystem::path& folder);
/// The profiles of db/samples, inside the program.
std::span<const EmbeddedFile> sampleProfiles();
/// Each of the sample profiles for about 20 ms.
EngineFacts measureEngine(double rate_hz);
ServerFacts measureServer(const StationOptions& options);

// --- judgement ---

enum class Verdict : std::uint8_t { kOk, kWarning, kFailed, kNotChecked };
const char* verdictText(Verdict verdict);  ///< OK, WARNING, FAILED, not checked

struct Check {
  std::string name;  ///< e.g. "exchange time"
  Verdict verdict = Verdict::kOk;
  std::string found;                 ///< with unit, for a person
  std::string limit;                 ///< the expected range; empty without one
  std::string advice;                ///< what to do; empty when OK
  std::optional<double> value = {};  ///< the number that was judged
  std::string unit = {};
};

/// The verdict and text of a DeviceFlag.
struct ConditionText {
  std::uint32_t flag = 0;
  Verdict verdict = Verdict::kOk;
  const char* found = "";
  const char* advice = "";
};
/// Every DeviceFlag once.
std::span<const ConditionText> conditionTexts();

/// All checks, in the order of doing.
std::vector<Check> judge(const SelfTestFacts& facts);

std::string selfTestText(const std::vector<Check>& checks);
/// {"version", "machine", "rows": [{"check", "verdict", "value", "unit", "found", "limit", "advice"}]}
std::string selfTestJson(const std::vector<Check>& checks);

/// `--self-test`. Exit code 0 when no check failed, 1 otherwise.
int runSelfTest(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
