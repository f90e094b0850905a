#include "tests/bench/loop_slices.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "client/device/factory/device_factory.h"
#include "client/net/spool_writer.h"
#include "client/station/run/black_box.h"
#include "client/station/run/real_time.h"
#include "client/station/run/servo_loop.h"
#include "common/base/clock.h"
#include "tests/support/scenes.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

// the station's own way from the device to the disk: simulated device, loop, black box, ring, spool
Status runLoop(const LoopBenchOptions& options, SlicePair& slice, LoopBenchResult& result) {
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
  description.set_engine_version(NEEDLELAB_VERSION);
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
  std::thread haptic([&] {
    RtOptions rt;
    rt.priority = options.priority;
    rt.cpu = core;
    rt.spin_ns = options.spin_ns;
    rt.rate_hz = options.rate_hz;
    result.realtime = makeThreadRealTime(rt);
    if (result.realtime.front().ok) loop.run();
  });
  haptic.join();
  result.realtime.push_back(shallow_sleep.step());
  const Status stored = writer.finish(std::chrono::seconds(5));
  if (!result.realtime.front().ok)
    return Error{ErrorCode::kUnavailable, "SCHED_FIFO is not permitted: " + result.realtime.front().message};
  if (!stored.ok()) return stored;
  const ServoStats& stats = loop.stats();
  if (stats.end != ServoEnd::kTicksDone || ring->dropped() > 0)
    return Error{ErrorCode::kFailed,
                 fmt::format("the loop ended early ({}) or lost samples", faultText(stats.first_fault))};
  slice.loop.late = stats.wakeup;
  slice.loop.count = stats.wakeup.total();
  slice.loop.over_T = stats.late_wakeups;
  result.tick.add(stats.tick);
  result.missed_ticks += stats.missed_ticks;
  return {};
}

}  // namespace

Result<LoopBenchResult> runLoopBench(const LoopBenchOptions& options,
                                     const std::function<void(const std::string&)>& progress) {
  LoopBenchResult result;
  result.options = options;
  if (const RtStep step = lockMemory(); !step.ok) progress(step.name + ": " + step.message);
  const auto slices = static_cast<std::size_t>(std::max(1.0, std::round(options.seconds / options.slice_s)));
  for (std::size_t i = 0; i < slices; ++i) {
    SlicePair slice;
    slice.loop_first = i % 2 == 0;
    for (const bool first : {true, false}) {
      const bool loop = slice.loop_first == first;
      progress(fmt::format("slice {} of {}: {}, {:g} s", i + 1, slices,
                           loop ? "the haptic loop" : "cyclictest", options.slice_s));
      if (loop) {
        if (const Status status = runLoop(options, slice, result); !status.ok()) return status.error();
      } else {
        auto wakeups = runCyclictest(options);
        if (!wakeups.ok()) return wakeups.error();
        slice.cyclictest = *wakeups;
      }
    }
    result.loop.add(slice.loop);
    result.cyclictest.add(slice.cyclictest);
    result.slices.push_back(slice);
  }
  return result;
}

}  // namespace needlelab::test
