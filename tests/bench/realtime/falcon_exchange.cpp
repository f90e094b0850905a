// How many packets a second the device `falcon` exchanges with the emulated Falcon, and how regularly. Run it
// through tests/support/falcon_emulator/mocked_usb.sh; tests/bench/realtime/run does so.
#include <pthread.h>
#include <sched.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <thread>

#include "client/device/falcon/falcon_device.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/base/time/time_source.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/bench/realtime/figures.h"
#include "tests/support/falcon_emulator/falcon_emulator.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

/// SCHED_FIFO below the haptic loop's, for this thread and those that it starts: a real kernel would not be
/// late on a busy machine. Without permission they keep their scheduling.
void preferThisThread() {
  sched_param parameters{};
  parameters.sched_priority = 60;
  static_cast<void>(::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters));
}

int exchange(double seconds) {
  preferThisThread();
  UsbTestbed testbed;
  if (const std::string why = testbed.trouble(); !why.empty()) {
    std::fprintf(stderr, "needlelab_falcon_exchange: %s\n", why.c_str());
    return kExitFailed;
  }
  FalconEmulator falcon(testbed);
  falcon.plug();
  FalconDevice device{FalconOptions{}};
  if (const Status opened = device.open(1000); !opened.ok()) {
    std::fprintf(stderr, "needlelab_falcon_exchange: %s\n", opened.error().message.c_str());
    return kExitFailed;
  }
  ForceGate gate(DeviceLimits{}, 1000);
  DeviceReading reading;
  std::uint64_t fresh = 0;
  const auto tickFor = [&](const std::function<bool()>& goes_on) {
    auto due = std::chrono::steady_clock::now();
    while (goes_on()) {
      fresh += device.read(reading) == DeviceRead::kFresh ? 1 : 0;
      gate.admit(TipSample{}, true, 0);
      device.write(gate.guard(Wrench{}));
      due = std::max(due + 1ms, std::chrono::steady_clock::now());
      std::this_thread::sleep_until(due);
    }
  };
  // pulls the grip out and pushes it in, so that the encoders find their zero
  falcon.hold([](double t_s) { return Vec3{std::fmod(t_s, 0.1) < 0.05 ? 0.035 : -0.035, 0, 0}; });
  const auto nowNs = [] { return machineTime().nowNs(); };
  const std::int64_t patience_ns = nowNs() + 60'000'000'000;
  tickFor([&] { return fresh == 0 && nowNs() < patience_ns; });
  if (fresh == 0) {
    std::fprintf(stderr, "needlelab_falcon_exchange: no position: %s\n", device.status().c_str());
    return kExitFailed;
  }
  falcon.holdAt({});

  fresh = 0;
  const std::int64_t begin_ns = nowNs(), end_ns = begin_ns + static_cast<std::int64_t>(1e9 * seconds);
  tickFor([&] { return nowNs() < end_ns; });
  const double took_s = 1e-9 * static_cast<double>(nowNs() - begin_ns);
  LatencyHistogram between;
  std::uint64_t commands = 0;
  std::int64_t last_ns = 0;
  for (const Heard& heard : falcon.heard()) {
    if (heard.at_ns < begin_ns) continue;
    if (commands++ > 0) between.add(heard.at_ns - last_ns);
    last_ns = heard.at_ns;
  }
  device.close();
  Figures figures;
  figures.push_back(
      {"Falcon: packets to the device", "Hz", static_cast<double>(commands) / took_s, Beside::kRate});
  figures.push_back(
      {"Falcon: ticks with a new position", "Hz", static_cast<double>(fresh) / took_s, Beside::kRate});
  addQuantiles(figures, "Falcon: from packet to packet", between);
  std::printf("%s\n", figuresJson(figures).c_str());
  return kExitDone;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  double seconds = 5;
  CLI::App app{"The Falcon's rate of exchange on the emulated USB, as JSON", "needlelab_falcon_exchange"};
  app.add_option("--seconds", seconds)->check(CLI::Range(0.1, 15.0))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return needlelab::test::exchange(seconds);
}
