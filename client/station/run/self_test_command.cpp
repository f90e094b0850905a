/// The command line's side of the self-test.

#include <algorithm>
#include <cmath>
#include <iostream>

#include "client/device/factory/device_factory.h"
#include "client/station/run/loop_core.h"
#include "client/station/run/modes.h"
#include "client/station/run/report_output.h"
#include "client/station/run/self_test.h"
#include "common/base/program.h"
#include "common/base/range.h"

namespace needlelab {
namespace {

constexpr double kDefault_s = 5, kLongest_s = 600;

// the simulated hand keeps still for as long as the test needs it
DeviceOptions quietOptions(const StationOptions& options, double seconds) {
  DeviceOptions device{{}, {}, options.X_HT, options.hand};
  device.hand.plan = "rest";
  device.hand.hold_s = std::min(600.0, seconds + 5);
  device.hand.repeat = 0;
  device.hand.tremor_m = 0;
  return device;
}

}  // namespace

int runSelfTest(const StationOptions& options, const sigset_t& stop_signals) {
  const auto say = [](const std::string& text) { std::cerr << "station: " << text << std::endl; };
  if (options.seconds > kLongest_s) {
    say(outOfRange("--seconds of a self-test", options.seconds, {0.001, kLongest_s}).message);
    return kExitInvalid;
  }
  const double seconds = options.seconds > 0 ? options.seconds : kDefault_s;
  SelfTestFacts facts;
  facts.device.spec = options.device;
  auto device = makeDevice(options.device, quietOptions(options, seconds));
  if (!device.ok() && device.error().code == ErrorCode::kInvalidInput) {
    say(device.error().message);
    return kExitInvalid;
  }
  if (!device.ok()) {
    facts.device.trouble = device.error().message;
  } else {
    say("testing " + (*device)->info().name + numberText(seconds).insert(0, " for ") +
        " s; it gives no force. Leave the handle alone");
    RtOptions real_time;
    real_time.cpu = coreForLoop(options.cpu);
    real_time.cpu_needs_fifo = !options.cpu;
    real_time.spin_ns = std::llround(options.spin_us * 1e3);
    real_time.rate_hz = options.rate_hz;
    SteadyLoopClock clock(real_time.spin_ns);
    bool stopped = false;
    facts.device = measureDevice(**device, clock, real_time, seconds, stop_signals, say, stopped);
    if (stopped) {
      say("stopped; the test is not complete");
      return kExitFailed;
    }
  }
  facts.device.spec = options.device;
  facts.device.rate_hz = options.rate_hz;
  facts.device.hardware = options.device != "simulated" && !options.device.starts_with("recording:");
  facts.device.tool_given = options.tool_given;
  facts.device.X_HT = options.X_HT;
  facts.machine = measureMachine();
  facts.engine = measureEngine(options.rate_hz);
  facts.disk = measureDisk(options.spool);
  facts.server = measureServer(options);

  const auto checks = judge(facts);
  const bool failed =
      std::any_of(checks.begin(), checks.end(), [](const Check& c) { return c.verdict == Verdict::kFailed; });
  return printReport(options, selfTestText(checks), selfTestJson(checks), failed ? kExitFailed : kExitDone);
}

}  // namespace needlelab
