#include "tests/bench/realtime/loop_slices.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "client/device/factory/device_factory.h"
#include "client/net/spool/spool_writer.h"
#include "client/station/run/loop/black_box.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/servo_loop.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "tests/support/scenes/scenes.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

// of the whole process
std::uint64_t voluntarySwitches() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_nvcsw);
}

std::vector<RtStep> makeRealTime(const SliceOptions& options, std::optional<int> core) {
  if (options.priority == 0) return {{"FIFO priority", false, "not asked for (--priority 0)"}};
  RtOptions rt;
  rt.priority = options.priority;
  rt.cpu = core;
  rt.spin_ns = options.spin_ns;
  rt.rate_hz = options.rate_hz;
  return makeThreadRealTime(rt);
}

// the station's own way from the device to the disk: simulated device, loop, black box, ring, spool
Status runLoop(const SliceOptions& options, SliceResult& result) {
  DeviceOptions device_options;
  device_options.scene = allEffects();
  device_options.hand.plan = "depth";
  device_options.hand.repeat = 0;
  auto device = makeDevice("simulated", device_options);
  if (!device.ok()) return device.error();
  if (auto status = (*device)->open(options.rate_hz); !status.ok()) return status;
  const auto model = compile(device_options.scene, options.rate_hz);
  if (!model.ok()) return model.error();

  const TempFolder folder;
  auto spool = Spool::open(folder.path());
  if (!spool.ok()) return spool.error();
  pb::SessionDescription description;
  const Uuid id = makeUuidV7();
  description.set_session_id(id.data(), id.size());
  description.set_station("bench");
  description.set_trainee("bench");
  description.set_profile_id("bench");
  description.set_profile_json("{}");
  description.set_engine_version(programVersion());
  description.set_device((*device)->info().name);
  description.set_rate_hz(options.rate_hz);
  setResolution(description, Resolution::standard());
  description.set_started_unix_ns(wallNowNs());
  description.set_started_steady_ns(steadyNowNs());
  auto session = (*spool)->create(description);
  if (!session.ok()) return session.error();

  auto ring = std::make_unique<SampleRing>();
  SpoolWriterOptions writer_options;
  writer_options.rate_hz = options.rate_hz;
  const auto core = coreForLoop(options.cpu);
  auto keep_off = std::make_optional<KeepOffCore>(core);
  SpoolWriter writer(*ring, *session, writer_options, {});
  keep_off.reset();
  BlackBox black_box(options.rate_hz);
  LoopTime clock(options.spin_ns);
  ServoSettings settings;
  settings.rate_hz = options.rate_hz;
  settings.max_ticks = static_cast<std::uint64_t>(std::llround(options.slice_s * options.rate_hz));
  settings.black_box = &black_box;
  ServoLoop loop(*model, **device, clock, *ring, settings);
  const ShallowSleep shallow_sleep;
  const std::uint64_t switches = voluntarySwitches();
  std::int64_t took_ns = 0;
  std::thread haptic([&] {
    result.realtime = makeRealTime(options, core);
    const std::int64_t from_ns = steadyNowNs();
    loop.run();
    took_ns = steadyNowNs() - from_ns;
  });
  haptic.join();
  result.switches += voluntarySwitches() - switches;
  result.realtime.push_back(shallow_sleep.step());
  if (const Status stored = writer.finish(std::chrono::seconds(60)); !stored.ok()) return stored;
  const ServoStats& stats = loop.stats();
  if (stats.end != ServoEnd::kTicksDone || ring->dropped() > 0)
    return Error{ErrorCode::kFailed,
                 fmt::format("the loop ended early ({}) or lost samples", faultText(stats.first_fault))};
  result.loop.add(
      {stats.wakeup, stats.wakeup.total(), stats.late_wakeups, static_cast<double>(took_ns) * 1e-9});
  result.tick.add(stats.tick);
  result.missed_ticks += stats.missed_ticks;
  return {};
}

// clock_nanosleep to absolute times, and nothing else
void runPlain(const SliceOptions& options, SliceResult& result) {
  const ShallowSleep shallow_sleep;
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e9 / options.rate_hz));
  const auto ticks = static_cast<std::uint64_t>(std::llround(options.slice_s * options.rate_hz));
  std::thread([&] {
    (void)makeRealTime(options, coreForLoop(options.cpu));
    Wakeups& plain = result.plain;
    const std::int64_t from_ns = steadyNowNs();
    std::int64_t due_ns = from_ns;
    for (std::uint64_t tick = 0; tick < ticks;) {
      due_ns += period_ns;
      ++tick;
      const timespec due{due_ns / 1'000'000'000, due_ns % 1'000'000'000};
      while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {
      }
      const std::int64_t late_ns = steadyNowNs() - due_ns;
      plain.late.add(late_ns);
      ++plain.count;
      if (late_ns < period_ns) continue;
      // skips what has passed, as the haptic loop does
      ++plain.over_T;
      due_ns += late_ns / period_ns * period_ns;
      tick += static_cast<std::uint64_t>(late_ns / period_ns);
    }
    plain.seconds += static_cast<double>(steadyNowNs() - from_ns) * 1e-9;
  }).join();
}

}  // namespace

Result<SliceResult> runSlices(const SliceOptions& options,
                              const std::function<void(const std::string&)>& progress) {
  SliceResult result;
  if (const RtStep step = lockMemory(); !step.ok) progress(step.name + ": " + step.message);
  const auto slices = static_cast<std::size_t>(std::max(1.0, std::round(options.seconds / options.slice_s)));
  for (std::size_t i = 0; i < slices; ++i)
    for (std::size_t turn = 0; turn < 3; ++turn) {
      const std::size_t side = (i + turn) % 3;  // each of them is first in turn
      constexpr std::array<const char*, 3> kSides = {"the haptic loop", "cyclictest", "a plain loop"};
      progress(fmt::format("slice {} of {}: {}, {:g} s", i + 1, slices, kSides.at(side), options.slice_s));
      if (side == 0) {
        RETURN_IF_ERROR(runLoop(options, result));
      } else if (side == 2) {
        runPlain(options, result);
      } else if (auto wakeups = runCyclictest(options); wakeups.ok()) {
        if (!result.cyclictest) result.cyclictest.emplace();
        result.cyclictest->add(*wakeups);
      } else {
        result.cyclictest_trouble = wakeups.error().message;
      }
    }
  return result;
}

}  // namespace needlelab::test
